"""docs/figures/gallery: runs every script of docs/gallery, or those named, and saves the figure that it draws."""

import runpy
import sys
from pathlib import Path

import matplotlib as mpl

DOCS = Path(__file__).parent.parent / "docs"
DPI = 110


def draw(script: Path, folder: Path) -> Path:
    """The picture of one script in a folder."""
    import matplotlib.pyplot as plt

    from stabctl.view.figures import style

    plt.close("all")
    runpy.run_path(str(script), run_name="__main__")
    (number,) = plt.get_fignums()  # a script draws one figure
    return style.save(plt.figure(number), folder / f"{script.stem}.png", dpi=DPI)


if __name__ == "__main__":
    mpl.use("agg")
    for path in sorted((DOCS / "gallery").glob("*.py")):
        if path.stem in sys.argv[1:] or not sys.argv[1:]:
            print(draw(path, DOCS / "figures" / "gallery"), file=sys.stderr)
