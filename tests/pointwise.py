"""A device alone at random points, beside its equations written down a second time, limits and deadbands included.

A reference takes parameters, states, inputs and the bus voltage, and returns rates by state, signals by output, and
"into", the current into the network. Nothing is linearized: every limit takes part, whichever side it is on.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from block_diagram import evaluate

from stabctl import devices

POINTS = 250


def held(x, low, high):
    """x between two limits."""
    return min(max(x, low), high)


def outside(x, low, high):
    """What of x is outside a deadband."""
    return x - held(x, low, high)


def pi(KP, KI, e, x, low, high):
    """Output and rate of [KP + KI/s] between two limits: the integral rests while it would drive y further beyond."""
    y = KP * e + x
    rests = (y >= high and KI * e > 0) or (y <= low and KI * e < 0)
    return held(y, low, high), 0.0 if rests else KI * e


def drawn(device, rng, ranges):
    """Parameters at random: upper limits 0.3 to 0.9, lower ones -0.6 to -0.1, flags 0 or 1, the rest 0.1 to 0.9."""
    made = {}
    for name in device.Par._fields:
        low, high = (-0.6, -0.1) if name.endswith("min") else (0.3, 0.9) if name.endswith("max") else (0.1, 0.9)
        made[name] = float(rng.uniform(low, high))
        if "Flag" in name:
            made[name] = float(rng.integers(2))
        if name in ranges:
            given = ranges[name]
            made[name] = rng.choice(given) if isinstance(given, list) else float(rng.uniform(*given))
    p = device.Par(**made)
    return device.prepared(p)


def kept(device, p, u, name, value):
    """A state within its limits of LIMITS, where the simulator keeps it."""
    low, high, *per = device.limits.get(name, (-np.inf, np.inf))
    scale = u[per[0]] if per else 1.0
    return held(value, *(scale * (getattr(p, edge) if isinstance(edge, str) else edge) for edge in (low, high)))


def injected(device, p, x, u, v, y):
    """Current into the network (pu system)."""
    known = {"p": p, "x": x, "v": v, "u": SimpleNamespace(**u), **u, "y": y}
    if device.has("internal"):
        known["i"] = device.evaluate("internal", known)
    total = sum(complex(*device.evaluate(name, known)) for name in ("source", "current") if device.has(name))
    return total - complex(*device.admittance(p)) * complex(*v) if device.has("admittance") else total


def compare(name, reference, ranges=None, states=(-0.3, 1.3), inputs=(-0.3, 1.3), volts=(0.05, 1.4)):
    """Assert that a device is its reference at every point."""
    device, ranges = devices.every()[name], ranges or {}
    outputs = device.Output._fields
    for seed in range(POINTS):
        rng = np.random.default_rng(seed)
        p = drawn(device, rng, ranges)
        u = {n: float(rng.uniform(*ranges.get(f"u.{n}", inputs))) for n in device.Input._fields}
        free = {n: float(rng.uniform(*ranges.get(f"x.{n}", states))) for n in device.State._fields}
        x = device.State(*(kept(device, p, u, name, value) for name, value in free.items()))
        V = rng.uniform(*volts) * np.exp(1j * rng.uniform(-3, 3))
        v = (V.real, V.imag)
        rates, out = evaluate(device, p, x, u, v)
        of = [f"rate of {n}" if n in outputs else n for n in device.State._fields]
        found = dict(zip([*outputs, *of], [*out, *rates], strict=True))
        wanted = reference(p, x, SimpleNamespace(**u), V)
        assert set(wanted) - {"into"} == set(found), "every rate and every output has a reference"
        for signal, value in found.items():
            assert value == pytest.approx(wanted[signal], rel=1e-9, abs=1e-9), (seed, signal)
        if "into" in wanted:
            assert injected(device, p, x, u, v, device.Output(*out)) == pytest.approx(wanted["into"], abs=1e-9), seed
