"""Signals of rotors from estimates, beside what they mean, machine by machine: islands, groups, ages, units."""

import numpy as np
import pytest
from uneven import uneven_point

from stabctl.dynamics.signals import OUTPUTS, chosen
from stabctl.estimation._signals import REACH, Deviations, RotorSignals
from stabctl.estimation.estimators import Estimate

NUMBERS = 7, 3, 12, 5  # as in the table
H = np.array([4.1, 2.7, 21.0, 2.9])
READ = {  # whether the controller belongs to the machine
    "speed:7": True, "speed:3": False, "deviation:3": True, "deviation:7+5": False, "rest_speed:12": False,
    "coi_speed": False, "angle:5": True, "angle:3": False, "angle_deviation:12": True, "angle_deviation:3+5": False,
}  # fmt: skip
SPEEDS = "speed", "rest_speed", "coi_speed"


def drawn(seed):
    """Estimates of two simulations at the present, as the machines and as others know them."""
    rng = np.random.default_rng(seed)
    own, remote = (
        Estimate(
            slip=rng.normal(0, 4e-3, (2, 4)), acceleration=rng.normal(0, 0.05, (2, 4)), variance=np.full((2, 4), 1e-8),
            drift=np.zeros((2, 4)), received=np.ones((2, 4), bool), nis=np.zeros((2, 4)),
            angle=rng.normal(0, 0.6, (2, 4)),
        )
        for _ in range(2)
    )  # fmt: skip
    zero = np.zeros((2, 4))
    return Deviations(zero, zero, zero, np.ones((2, 4), bool), own, remote)


def present(estimate, k, age, start):
    """Slip, angle and acceleration of the machines: the angle has turned for as long as the estimate is old."""
    slip, rate, wb = estimate.slip[k], estimate.acceleration[k], 2 * np.pi * 50.0
    before = slip - rate * age
    return np.stack([slip, estimate.angle[k] + wb * (before * age + rate * age**2 / 2) - start, rate])


def mean(states, inside):
    return sum(H[i] * states[:, i] for i in inside) / sum(H[i] for i in inside)


def meant(label, own, d, k, ages, island, start):
    """Slip, angle and acceleration of a signal; None if its machines are off."""
    kind, _, text = label.partition(":")
    group = [NUMBERS.index(int(n)) for n in text.split("+")] if text else []
    near, far = (present(e, k, min(age, REACH), start) for e, age in zip((d.own, d.remote), ages, strict=True))
    on = [i for i in range(4) if island[i] >= 0]
    first = next((i for i in group if i in on), None)
    if group and first is None:
        return None
    here = [i for i in on if first is None or island[i] == island[first]]
    members, rest = [i for i in group if i in here], [i for i in here if i not in group]
    known = near if own else far
    if kind == "coi_speed":
        return mean(known, here)
    if kind == "rest_speed":
        return mean(known, rest or members)
    others = {"speed": np.zeros(3), "angle": mean(far, here)}.get(kind, mean(far, rest or members))
    return mean(known, members) - others


@pytest.mark.parametrize("island", [(0, 0, 0, 0), (0, 1, 0, 1), (0, 0, 0, -1), (1, 0, 0, 0)])
@pytest.mark.parametrize("ages", [(0.0, 0.0), (0.02, 0.06), (0.04, 0.13)])
def test_every_signal_is_the_weighted_mean_of_what_is_known(island, ages):
    point, d = uneven_point(), drawn(3)
    signals = list(zip(chosen(point.case, list(READ), OUTPUTS), READ.values(), strict=True))
    read, start, island = RotorSignals(point, signals, H, ages), np.array([0.3, -0.2, 0.1, 0.7]), np.array(island)
    for k in (0, 1):
        found, known = read.relative(k, d, island, start)
        rest = np.arange(len(READ)) + 0.5
        values = read(k, d, island, rest)
        for i, (label, own) in enumerate(READ.items()):
            wanted = meant(label, own, d, k, ages, island, start)
            assert known[i], label
            if wanted is None:
                continue
            assert found[i] == pytest.approx(wanted, rel=1e-12, abs=1e-14), label
            kind = label.partition(":")[0]
            plain = meant(label, own, d, k, ages, island, 0.0)
            assert values[i] == pytest.approx(plain[int("angle" in kind)] + (kind in SPEEDS), rel=1e-12), label


def test_what_nothing_is_known_of_rests():
    point, d = uneven_point(), drawn(5)
    signals = list(zip(chosen(point.case, list(READ), OUTPUTS), READ.values(), strict=True))
    read, rest = RotorSignals(point, signals, H, (0.02, 0.06)), np.arange(len(READ)) + 0.5
    d.usable[0, 1] = False  # machine 3
    values = read(0, d, np.zeros(4, int), rest)
    held = [label for label, a, b in zip(READ, values, rest, strict=True) if a == b]
    assert held == [label for label in READ if "3" in label.partition(":")[2].split("+")]
    assert (read(1, d, np.zeros(4, int), rest) != rest).all()
