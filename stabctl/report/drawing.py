"""Pictures of modes as SVG that takes its colors from the page: the s-plane, and the compass of a mode shape."""

import math
from html import escape

from stabctl.smallsignal import Mode, Part

RATIOS = (0.05, 0.1, 0.2)
LEAST = 0.1  # magnitude of an arrow that is named
ARROWS = 4  # the largest of each side that are named


def s_plane(points: list[Mode]) -> str:
    """Upper half of the s-plane with rays of constant damping ratio; a dot per oscillating mode in view."""
    width, height, left, bottom, top, right = 500, 360, 14, 42, 14, 50
    swings = [p for p in points if p.electromechanical] or points
    high = 1.2 * max((p.eigenvalue.imag for p in swings), default=10.0)
    low = min(-1.0, 1.25 * min((p.eigenvalue.real for p in swings), default=-1.0))
    most = max(0.08 * -low, 1.5 * max((p.eigenvalue.real for p in points), default=0.0))

    def x(real: float) -> float:
        return left + (real - low) / (most - low) * (width - left - right)

    def y(imag: float) -> float:
        return height - bottom - imag / high * (height - bottom - top)

    out = [f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="s-plane with damping rays">']
    for real in _ticks(low, most):
        out.append(f'<line class="grid" x1="{x(real):.1f}" x2="{x(real):.1f}" y1="{y(0):.1f}" y2="{top}"/>')
        out.append(f'<text x="{x(real):.1f}" y="{y(0) + 16:.1f}" text-anchor="middle">{real:g}</text>')
    for hertz in _ticks(0, high / (2 * math.pi)):
        at = y(2 * math.pi * hertz)
        out.append(f'<line class="grid" x1="{left}" x2="{width - right}" y1="{at:.1f}" y2="{at:.1f}"/>')
        out.append(f'<text x="{width - right + 6}" y="{at + 4:.1f}">{hertz:g}</text>')
    for ratio in RATIOS:
        slope = math.sqrt(1 - ratio**2) / ratio
        imag = min(high, -low * slope)
        tip = x(-imag / slope), y(imag)
        out.append(f'<line class="ray" x1="{x(0):.1f}" y1="{y(0):.1f}" x2="{tip[0]:.1f}" y2="{tip[1]:.1f}"/>')
        name = f'<text class="ray" x="{tip[0] + 5:.1f}" y="{tip[1] + 13:.1f}">{100 * ratio:g} %</text>'
        out.append(name)
    out.append(f'<line class="axis" x1="{x(0):.1f}" x2="{x(0):.1f}" y1="{y(0):.1f}" y2="{top}"/>')
    out.append(f'<line class="axis" x1="{left}" x2="{width - right}" y1="{y(0):.1f}" y2="{y(0):.1f}"/>')
    outside = 0
    for p in sorted(points, key=lambda m: m.electromechanical):
        s = p.eigenvalue
        if not (low <= s.real <= most and s.imag <= high):
            outside += 1
            continue
        kind = "grows" if s.real > 1e-7 else "swing" if p.electromechanical else "other"
        title = f"<title>{escape(str(p))}</title>"
        out.append(f'<circle class="{kind}" cx="{x(s.real):.1f}" cy="{y(s.imag):.1f}" r="5">{title}</circle>')
    middle = left + (width - left - right) / 2
    out.append(f'<text x="{middle:.0f}" y="{height - 8}" text-anchor="middle">real part, 1/s</text>')
    turned = f"{width - 8} {(height - bottom + top) / 2:.0f}"
    out.append(
        f'<text transform="translate({turned}) rotate(-90)" text-anchor="middle">frequency, Hz</text></svg>'
        f'<p class="key"><span class="dot swing"></span>swing of machines <span class="dot other"></span>other '
        f'oscillating mode <span class="dot grows"></span>growing; rays of damping ratio 5, 10 and 20 %'
        + (f"; {outside} better damped or faster modes lie outside the picture" if outside else "")
        + "</p>"
    )
    return "".join(out)


def compass(mode: Mode) -> str:
    """Speeds of the machines as arrows, the largest of length 1; the largest ones named on the rim."""
    half, radius = 118, 84
    out = [f'<svg class="compass" viewBox="{-half} {-half} {2 * half} {2 * half}" role="img" aria-label="mode shape">']
    out += [f'<circle class="grid" r="{radius * r:.0f}"/>' for r in (0.5, 1.0)]
    out += [
        f'<line class="grid" {ends}/>' for ends in (f'x1="{-radius}" x2="{radius}"', f'y1="{-radius}" y2="{radius}"')
    ]
    parts = sorted(mode.shape, key=lambda p: -p.magnitude)
    lead = parts[0].angle_deg if parts else 0.0
    large = [p for p in parts if p.magnitude >= LEAST]
    named = [p for side in ("with", "against") for p in [p for p in large if _side(p, lead) == side][:ARROWS]]
    for p in reversed(parts):
        if p.magnitude < 0.02:
            continue
        tip = _polar(radius * p.magnitude, p.angle_deg)
        out.append(
            f'<g class="{_side(p, lead)}">'
            f"<title>machine {p.machine}: {p.magnitude:.2f} at {p.angle_deg:.0f} degrees</title>"
            f'<line x2="{tip[0]:.1f}" y2="{tip[1]:.1f}"/><circle cx="{tip[0]:.1f}" cy="{tip[1]:.1f}" r="3"/></g>'
        )
    for p, angle in zip(named, _spread([p.angle_deg for p in named], 17.0), strict=True):
        tip, rim, at = _polar(radius * p.magnitude, p.angle_deg), _polar(radius + 8, angle), _polar(radius + 20, angle)
        out.append(f'<line class="leader" x1="{tip[0]:.1f}" y1="{tip[1]:.1f}" x2="{rim[0]:.1f}" y2="{rim[1]:.1f}"/>')
        out.append(
            f'<text class="{_side(p, lead)}" x="{at[0]:.1f}" y="{at[1] + 4:.1f}" text-anchor="middle">'
            f"{p.machine}</text>"
        )
    return "".join([*out, "</svg>"])


def _side(p: Part, lead: float) -> str:
    return "with" if math.cos(math.radians(p.angle_deg - lead)) >= 0 else "against"


def _polar(length: float, angle_deg: float) -> tuple[float, float]:
    a = math.radians(angle_deg)
    return length * math.cos(a), -length * math.sin(a)


def _spread(angles: list[float], gap: float) -> list[float]:
    """The angles (deg) moved apart, round the circle, to at least `gap`; each run of neighbors about its middle."""
    order = sorted(range(len(angles)), key=lambda i: angles[i] % 360)
    if not order:
        return []
    around = [angles[i] % 360 for i in order]
    widest = max(range(len(around)), key=lambda i: (around[i] - around[i - 1]) % 360 or 360)
    order = order[widest:] + order[:widest]
    runs: list[list[float]] = []  # first angle, number
    start = angles[order[0]] % 360
    for i in order:
        runs.append([start + (angles[i] % 360 - start) % 360, 1])
        while len(runs) > 1 and runs[-2][0] + gap * runs[-2][1] > runs[-1][0]:
            (a, m), (b, n) = runs[-2:]
            middle = (m * (a + gap * (m - 1) / 2) + n * (b + gap * (n - 1) / 2)) / (m + n)
            runs[-2:] = [[middle - gap * (m + n - 1) / 2, m + n]]
    placed = [first + gap * k for first, count in runs for k in range(int(count))]
    out = [0.0] * len(angles)
    for i, angle in zip(order, placed, strict=True):
        out[i] = angle
    return out


def _ticks(low: float, high: float) -> list[float]:
    """Some round numbers from low to high."""
    rough = (high - low) / 6
    unit = 10 ** math.floor(math.log10(rough))
    step = next(m * unit for m in (1, 2, 5, 10) if m * unit >= rough)
    first = math.ceil(low / step - 1e-9)
    return [round(k * step, 10) for k in range(first, math.floor(high / step + 1e-9) + 1)]
