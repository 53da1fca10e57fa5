"""The instants within a step at which the power of storage jumps: orders switch, devices are full or empty."""

from stabctl._util.jit import inline, noinline
from stabctl.devices.blocks import copy

from .orders import decide
from .voltages import FAILED, settle

MOST = 4  # switching instants found in one step; the next orders are those of its end
CHATTER = 8  # steps in a row with switching; the next are not divided until one without
FINE = 1e-6  # of a step; a switch nearer to its ends counts as there
NEAR = 0.02  # of a step; nearer to its ends the interpolated voltages are exact enough


@inline
def set_orders(row, a, q):
    """Set the orders to a row of those stored."""
    for j in range(len(a.held)):
        q.s[a.held[j]] = q.orders[row, j]


@noinline
def interpolate(t, h, q):
    """Set states and voltages to those at the fraction t of the last h seconds.

    A cubic of the states and rates at both ends, a parabola of the voltages at the ends and at the fraction part[2].
    """
    for k in range(len(q.x0)):
        change = q.end[k] - q.x0[k]
        bend = (1 - t) * (h * q.rate[k] - change) - t * (h * q.f[k] - change)
        q.s[k] = q.x0[k] + t * (change + (1 - t) * bend)
    m = q.part[2]
    first, middle, last = (1 - t) * (m - t) / m, t * (1 - t) / (m * (1 - m)), t * (t - m) / (1 - m)
    for i in range(len(q.volt)):
        q.volt[i] = first * q.volts[0, i] + middle * q.volts[1, i] + last * q.volts[2, i]


@noinline
def filled(h, a, q):
    """Fraction of the last h seconds just before a device reached a limit that stops it, 1 if none; marks which."""
    first, q.marks[6] = 1.0, -1
    for k in range(len(a.stops)):
        j = a.stops[k]
        i, per = a.limited[j], q.s[a.scale[j]]
        if q.s[i] == q.x0[i] or not (q.s[i] == a.low[j] * per or q.s[i] == a.high[j] * per):
            continue
        t = (q.s[i] - q.x0[i]) / (h * q.rate[i]) - FINE
        if 0 <= t < first:
            first, q.marks[6] = t, j
    return first


@noinline
def changed(t, h, p, a, net, q):
    """Whether an order has switched at the fraction t of the last h seconds; if so, stores the orders then."""
    set_orders(0, a, q)
    interpolate(t, h, q)
    if not decide(p, a, net, q, 0):
        return False
    for j in range(len(a.held)):
        q.orders[1, j] = q.s[a.held[j]]
    return True


@noinline
def bisect(h, p, a, net, q):
    """Fractions of the last h seconds between which an order first switched; stores the orders from then on."""
    low, high = 0.0, 1.0
    while high - low > FINE:
        t = (low + high) / 2
        if changed(t, h, p, a, net, q):
            high = t
        else:
            low = t
    return low, high


@noinline
def switched(h, p, a, net, q):
    """Fraction of the last h seconds at which an order first switched, 1 if none; stores the orders from then on.

    The voltages are solved for at the instant found, which is then confirmed, or found again if they move it.
    """
    if not decide(p, a, net, q, 0):
        return 1.0
    copy(q.s, q.end)
    copy(q.volt, q.volts[2])
    q.part[2] = 0.5
    for j in range(len(a.held)):
        q.orders[1, j] = q.s[a.held[j]]
    low, high = bisect(h, p, a, net, q)
    set_orders(0, a, q)
    if NEAR < high < 1 - NEAR:
        interpolate(high, h, q)
        if settle(p, a, net, q) < FAILED:
            copy(q.volt, q.volts[1])
            q.part[2] = high
            if changed(low, h, p, a, net, q) or not changed(high, h, p, a, net, q):
                low, high = bisect(h, p, a, net, q)
            set_orders(0, a, q)
    for k in range(len(q.x0)):
        q.s[k] = q.end[k]
    copy(q.volts[2], q.volt)
    return high


@noinline
def instant(h, p, a, net, q):
    """Fraction of the last h seconds at which a power jumps, 1 if none; the orders from then on are in orders[1]."""
    t = filled(h, a, q)
    first = switched(h, p, a, net, q) if a.relay else 1.0
    if first <= t:
        t, q.marks[6] = first, -1
    else:
        for j in range(len(a.held)):
            q.orders[1, j] = q.s[a.held[j]]
    return t if FINE < t < 1 - FINE else 1.0


@noinline
def jump(h, a, q):
    """Switch the orders at the instant found; devices that fill or empty there are exactly at their limits."""
    set_orders(1, a, q)
    for k in range(len(a.stops)):
        j = a.stops[k]
        i, per = a.limited[j], q.s[a.scale[j]]
        low, high = a.low[j] * per, a.high[j] * per
        edge = high if abs(q.s[i] - high) < abs(q.s[i] - low) else low
        if j == q.marks[6] or abs(q.s[i] - edge) < 10 * FINE * h * abs(q.rate[i]):
            q.s[i] = edge
