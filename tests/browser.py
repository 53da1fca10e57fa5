"""A headless browser, and what it finds on a page."""

import json
import re
import shutil
import subprocess
from html import unescape

import pytest

PROGRAMS = "chromium", "chromium-browser", "google-chrome", "chrome"
SWITCHES = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--host-resolver-rules=MAP * ~NOTFOUND",
    "--allow-file-access-from-files",
    "--enable-logging=stderr",
    "--window-size=1400,900",
    "--virtual-time-budget=5000",
    "--dump-dom",
)
FRAME = """<!doctype html><iframe id="frame" src="{page}" style="width:{width}px;height:844px;border:0"></iframe>
<pre id="found"></pre><script>
document.getElementById("frame").onload = (event) => {{
  const inside = event.target.contentDocument, root = inside.documentElement, wide = root.clientWidth + 0.5;
  const name = (e) => e.tagName + "." + e.className + ": " + e.textContent.slice(0, 60);
  const all = [...inside.body.querySelectorAll("*")];
  const boxes = [...inside.body.children].map((e) => [e, e.getBoundingClientRect()]).filter(([, r]) => r.height);
  const colors = event.target.contentWindow.getComputedStyle(inside.body);
  document.getElementById("found").textContent = JSON.stringify({{
    width: root.clientWidth, scroll: root.scrollWidth, title: inside.title,
    beyond: all.filter((e) => e.getBoundingClientRect().right > wide && !e.closest(".scroll, .frame, svg")).map(name),
    overlapping: boxes.slice(1).filter(([e, r], i) => r.top < boxes[i][1].bottom - 0.5).map(([e]) => name(e)),
    pictures: inside.images.length,
    broken: [...inside.images].filter((e) => !e.naturalWidth).map((e) => e.alt),
    unnamed: [...inside.images].filter((e) => !e.alt.trim()).length,
    dead: [...inside.querySelectorAll("a[href^='#']")].map((e) => e.hash).filter((h) => !inside.querySelector(h)),
    fetched: event.target.contentWindow.performance.getEntriesByType("resource").map((e) => e.name),
    ink: colors.color, paper: colors.backgroundColor,
  }});
}};
</script>"""


@pytest.fixture(scope="session")
def browse(tmp_path_factory):
    """browse(page, width, dark) -> what the browser found on it, `console` its messages."""
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        pytest.skip(f"no browser: none of {', '.join(PROGRAMS)} is installed")
    folder = tmp_path_factory.mktemp("browser")

    def look(page, width=390, dark=False):
        frame = page.parent / f"frame_{page.name}"
        frame.write_text(FRAME.format(page=page.name, width=width), encoding="utf-8")
        scheme = f"--blink-settings=preferredColorScheme={0 if dark else 1}"
        command = [program, *SWITCHES, scheme, f"--user-data-dir={folder}", frame.as_uri()]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60)
        found = re.search(r'<pre id="found">(.+?)</pre>', done.stdout, re.DOTALL)
        assert found, done.stderr[-2000:]
        console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
        return json.loads(unescape(found[1])) | {"console": console}

    return look
