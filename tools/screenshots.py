"""docs/figures/live: every view of `stabctl live wnaps`, light and dark, on a phone, a desk and a wide screen.

Needs Chromium. `screenshots.py FOLDER` saves them elsewhere.
"""

import io
import json
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests"))

from live_page import opened, served, until  # noqa: E402
from PIL import Image  # noqa: E402

SIZES = (390, 844), (1280, 860), (2560, 1300)
VIEWS = "time", "modes", "landscape", "theory"
QUALITY = 60  # of WebP
SETTINGS = {
    "fault": "83",
    "trip": "33-83",
    "clear": 6.5,
    "percent": 5,
    "compare": True,
    "signals": ["speed", "storage"],
}


def save(folder: Path) -> None:
    """Open the page once, and take a picture of each view at each size, light and dark."""
    folder.mkdir(parents=True, exist_ok=True)
    with served("wnaps") as address, opened(address) as page:
        page.evaluate(f"change({json.dumps(SETTINGS)})")
        until(page, "!running.busy && critical.answer?.resolution < 0.1", 300)
        for view in VIEWS[1:]:
            page.click(f"#tab-{view}")
        until(page, "landscape.done && modes.found && theory.found", 600)
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            for scheme in ("light", "dark"):
                page.emulate_media(color_scheme=scheme)
                for view in VIEWS:
                    page.click(f"#tab-{view}")
                    page.mouse.move(1, 1)
                    until(page, "!running.busy && !theory.asking.busy")
                    page.wait_for_timeout(500)
                    picture = Image.open(io.BytesIO(page.screenshot(full_page=True)))
                    path = folder / f"{view}-{width}-{scheme}.webp"
                    picture.convert("RGB").save(path, quality=QUALITY, method=6)
                    print(path, f"{path.stat().st_size / 1e3:.0f} kB", file=sys.stderr)


if __name__ == "__main__":
    save(Path(sys.argv[1]) if sys.argv[1:] else ROOT / "docs" / "figures" / "live")
