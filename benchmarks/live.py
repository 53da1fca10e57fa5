"""Time from a move of a slider to the drawn picture of `stabctl live`, measured in Chromium: `live.py [CASE ...]`.

A real key press on the focused slider, until the frame after the last stroke on a canvas.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np
from live_page import opened, served, until

KEYS = 80
WATCH = """() => {
  const w = window.watch = { key: 0, drawn: 0, strokes: 0, waiting: false };
  for (const name of ['stroke', 'fill']) {
    const own = CanvasRenderingContext2D.prototype[name];
    CanvasRenderingContext2D.prototype[name] = function (...given) {
      w.strokes++;
      if (!w.waiting) {
        w.waiting = true;
        requestAnimationFrame(() => { w.waiting = false; w.drawn = performance.now(); });
      }
      return own.apply(this, given);
    };
  }
  addEventListener('keydown', () => { w.key = performance.now(); w.strokes = 0; }, true);
}"""


def main() -> None:
    """Print a row per case: median and 95 % of the time to the picture, and of the simulation in it, ms."""
    for name in sys.argv[1:] or ("wnaps", "ieee39", "two_area"):
        with served(name) as address, opened(address) as page:
            page.evaluate(WATCH)
            page.focus("#clear")
            page.wait_for_timeout(2500)
            total, simulated = [], []
            for k in range(KEYS + 8):
                runs = page.evaluate("live.timing.length ? live.answers : 0")
                page.keyboard.press("ArrowRight" if (k // 20) % 2 == 0 else "ArrowLeft")
                until(page, f"live.answers > {runs} && !watch.waiting && watch.strokes > 0 && !running.busy")
                page.wait_for_timeout(60)
                if k >= 8:
                    total.append(page.evaluate("watch.drawn - watch.key"))
                    simulated.append(page.evaluate("live.run.head.simulated_ms"))
            said = (f"{np.median(v):6.1f} {np.percentile(v, 95):6.1f}" for v in (total, simulated))
            print(f"{name:10s} picture {next(said)}  simulation {next(said)}  ms (median, 95 %)", flush=True)


if __name__ == "__main__":
    main()
