"""Limit cycles by describing functions against the simulation, and what is refused."""

from pathlib import Path
from typing import NamedTuple

import control
import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import StudyError

PAGE = Path(__file__).parents[2] / "docs" / "limit-cycles.md"
LAG = control.ss(1 / (1 + 0.1 * control.tf("s")))
UNSTABLE, STABLE = "two_area_thyristor", "two_area"


class Trial(NamedTuple):
    """A case with storage and one controller from deviations to orders; and the load pulse that starts the swing."""

    case: str
    mw: int
    gain: float
    deadband: float
    limits: float
    delay: int  # frames of 1/60 s
    pulse: float  # MW
    relay: bool = False
    continuous: bool = False
    machine: int = 1
    four: bool = False

    def base(self):
        return st.load(self.case).initialize(storage=f"{self.mw}MW")

    def controller(self, base):
        order = next(f"order:{s.machine}@{s.bus}" for s in base.case.storage if s.machine == self.machine)
        names = ("deviation", "order") if self.four else (f"deviation:{self.machine}", order)
        gain = LAG * self.gain if self.continuous else control.ss([], [], [], self.gain * np.eye(4 if self.four else 1))
        return st.Controller.from_control(
            gain, *names, rate=None if self.continuous else 60, delay=self.delay / 60, name="controller",
            deadband=self.deadband, limits=self.limits, relay=self.relay,
        )  # fmt: skip

    def found(self, base):
        return base.limit_cycles(self.controller(base), signals=f"deviation:{self.machine}")


CYCLES = {
    "relay 12 mHz": Trial(UNSTABLE, 50, 1, 2e-4, 1, 0, 5, relay=True),
    "relay 30 mHz": Trial(UNSTABLE, 50, 1, 5e-4, 1, 0, 5, relay=True),
    "relay 60 mHz, 100 ms": Trial(UNSTABLE, 100, 1, 1e-3, 1, 6, 10, relay=True),
    "relay 12 mHz, 300 ms": Trial(UNSTABLE, 50, 1, 2e-4, 1, 18, 5, relay=True),
    "relay 0.6 mHz, 400 ms": Trial(STABLE, 200, 1, 1e-5, 1, 24, 5, relay=True),
    "relay 1.2 mHz, 200 ms": Trial(STABLE, 100, 1, 2e-5, 1, 12, 5, relay=True),
    "relay 6 mHz, 300 ms": Trial(STABLE, 100, 1, 1e-4, 1, 18, 20, relay=True),
    "relay 6 mHz, 500 ms": Trial(STABLE, 100, 1, 1e-4, 1, 30, 20, relay=True),
    "relay 6 mHz, 100 ms": Trial("wscc9", 20, 1, 1e-4, 1, 6, 5, relay=True, machine=2),
    "deadband 6 mHz": Trial(UNSTABLE, 50, 200, 0.02, np.inf, 0, 5),
    "deadband 12 mHz, 100 ms": Trial(UNSTABLE, 50, 100, 0.02, np.inf, 6, 60),
    "deadband 15 mHz to 165 mHz, 200 ms": Trial(UNSTABLE, 50, 200, 0.05, 0.5, 12, 60),
    "deadband 12 mHz, continuous, lag 100 ms": Trial(UNSTABLE, 50, 100, 0.02, np.inf, 0, 50, continuous=True),
    "limits 6 mHz, 400 ms": Trial(STABLE, 50, 3000, 0, 0.3, 24, 5),
    "limits 9 mHz, 500 ms": Trial(STABLE, 50, 2000, 0, 0.3, 30, 5),
    "four relays 1.2 mHz, 300 ms": Trial(STABLE, 50, 1, 2e-5, 1, 18, 5, relay=True, four=True),
}
NONE = {
    "relay 60 mHz, 100 ms": Trial(STABLE, 50, 1, 1e-3, 1, 6, 5, relay=True),
    "relay 30 mHz, 200 ms": Trial(STABLE, 20, 1, 5e-4, 1, 12, 5, relay=True),
    "deadband 2.4 mHz, 400 ms": Trial(STABLE, 50, 500, 0.02, np.inf, 24, 100),
    "limits 24 mHz, 400 ms": Trial(STABLE, 50, 500, 0, 0.2, 24, 100),
    "deadband 3 mHz to 33 mHz, 500 ms": Trial(STABLE, 50, 1000, 0.05, 0.5, 30, 50),
}
FAST = ("relay 1.2 mHz, 200 ms", "limits 6 mHz, 400 ms")


def named(trials, fast):
    marks = [() if n in fast else pytest.mark.slow for n in trials]
    return [pytest.param(n, id=n.replace(" ", "_"), marks=m) for n, m in zip(trials, marks, strict=True)]


def swing(trial, base, until=120.0):
    """Time and deviation (mHz) of the machine in the simulation after a load pulse of 0.5 s."""
    bus = 5 if trial.case == "wscc9" else 7
    events = [st.LoadStep(bus, "0.1s", p=trial.pulse), st.LoadStep(bus, "0.6s", p=-trial.pulse)]
    run = base.simulate(events, until, control=trial.controller(base))
    assert run.outcome.stable
    H, i = base.inertia, base.rotor_numbers.index(trial.machine)
    rest = np.arange(len(H)) != i
    speed = run.arrays.speed
    return run.time, 1e3 * base.case.frequency_hz * (speed[:, i] - speed[:, rest] @ H[rest] / H[rest].sum())


@pytest.mark.parametrize("name", ["relay 0.6 mHz, 400 ms", "relay 6 mHz, 500 ms", "relay 6 mHz, 100 ms"])
def test_the_outcome_names_a_slow_limit_cycle(name):
    """Relays of the page reverse twice per period, as slowly as machines swing, at whatever phase the run ends."""
    trial = CYCLES[name]
    base, bus = trial.base(), 5 if trial.case == "wscc9" else 7
    events = [st.LoadStep(bus, "0.1s", p=trial.pulse), st.LoadStep(bus, "0.6s", p=-trial.pulse)]
    for until in (20.0, 20.3, 20.6):
        ran = base.simulate(events, until, control=trial.controller(base))
        assert ran.outcome.cycling == (f"{trial.machine}@{7 if trial.case == 'wscc9' else 5}",)


def steady(t, y, last=25.0):
    """Frequency (Hz) and amplitude of the fundamental of the last seconds, in whole periods."""
    t, y = t[t > t[-1] - last], y[t > t[-1] - last]
    up = np.flatnonzero((y[:-1] < 0) & (y[1:] >= 0))
    crossings = t[up] - y[up] * (t[up + 1] - t[up]) / (y[up + 1] - y[up])
    whole = crossings[-1] - crossings[0]
    hz = (len(crossings) - 1) / whole
    inside = (t >= crossings[0]) & (t < crossings[-1])
    return hz, 2 * abs(np.trapezoid(y[inside] * np.exp(-2j * np.pi * hz * t[inside]), t[inside])) / whole


def row(name, trial, kind):
    """Numbers of the row of the table on the page: predicted Hz and mHz, simulated Hz and mHz."""
    for line in PAGE.read_text("utf-8").splitlines():
        cells = [c.strip() for c in line.strip("|").split("|")]
        if cells[:3] == [name, trial.case, f"{trial.mw} MW"] and len(cells) == kind:
            return cells[3:]
    raise AssertionError(f"the page has no row for {name}, {trial.case}, {trial.mw} MW")


@pytest.mark.parametrize("name", named(CYCLES, FAST))
def test_the_limit_cycle_is_that_of_the_simulation(name):
    """Frequency within 5 % and amplitude within 15 %, of one of the stable limit cycles; the page shows both."""
    trial = CYCLES[name]
    base = trial.base()
    hz, mhz = steady(*swing(trial, base))
    stable = [c for c in trial.found(base).cycles if c.stable]
    near = min(stable, key=lambda c: abs(np.log(c.frequency_hz / hz)) + abs(np.log(c.signals[0].amplitude / mhz)))
    assert near.signals[0].unit == "mHz"
    assert hz == pytest.approx(near.frequency_hz, rel=0.05)  # at most 0.0487
    assert mhz == pytest.approx(near.signals[0].amplitude, rel=0.15)  # at most 0.134
    shown = [float(x) for x in row(name, trial, 7)]
    assert shown == pytest.approx([near.frequency_hz, near.signals[0].amplitude, hz, mhz], rel=0.02)


def random_relays(count, seed=2):
    """Relays of random size, deadband and delay at machines of five systems."""
    rng = np.random.default_rng(seed)
    places = [("two_area", 1), ("two_area_pss", 1), ("wscc9", 2), (UNSTABLE, 1), ("ieee39", 3), ("wscc9", 3)]
    for _ in range(count):
        case, machine = places[rng.integers(len(places))]
        mw, deadband = int(rng.choice([20, 50, 100, 200])), float(rng.choice([1e-5, 2e-5, 1e-4, 2e-4]))
        yield Trial(case, mw, 1, deadband, 1, int(rng.integers(3, 37)), 20, relay=True, machine=machine)


@pytest.mark.slow
def test_other_systems_agree_as_the_page_says():
    """Of 15 that oscillate on, half of the frequencies are within 3 %, four of five within 6 %; one is 46 % off."""
    off = []
    for trial in random_relays(24):
        base = trial.base()
        stable = [c for c in trial.found(base).cycles if c.stable]
        try:
            t, y = swing(trial, base)
        except AssertionError:  # lost synchronism
            continue
        if stable and np.ptp(y[t > 100]) > 2:
            hz, _ = steady(t, y)
            off.append(min(abs(hz / c.frequency_hz - 1) for c in stable))
    assert len(off) >= 12
    assert np.median(off) < 0.03  # 0.019
    assert np.quantile(off, 0.8) < 0.06  # 0.033


@pytest.mark.parametrize("name", named(NONE, ("deadband 2.4 mHz, 400 ms",)))
def test_without_a_limit_cycle_swings_decay(name):
    trial = NONE[name]
    base = trial.base()
    assert not trial.found(base).cycles
    t, y = swing(trial, base, 90.0)
    first, last = (np.abs(y - y[-1])[(t > a) & (t < a + 10)].max() for a in (1.0, 80.0))
    assert last < 1e-3 * first
    assert row(name, trial, 4) == ["none"]


@pytest.mark.slow
def test_an_unstable_limit_cycle_is_the_border_between_decay_and_growth(cases):
    """A damper with small limits in a system that is unstable without it: pulses below and above the border."""
    trial = Trial(UNSTABLE, 50, 300, 0, 0.02, 6, 0)
    base = trial.base()
    (cycle,) = trial.found(base).cycles
    assert not cycle.stable
    border = cycle.signals[0].amplitude
    grown = {}
    for mw in np.linspace(20, 120, 11):
        t, y = swing(trial._replace(pulse=mw), base, 20.0)
        sizes = [np.abs(y[(t > a) & (t < a + 3)]).max() for a in (2.0, 17.0)]
        grown[sizes[0]] = sizes[1] > sizes[0]
    largest = max(a for a, up in grown.items() if not up)
    smallest = min(a for a, up in grown.items() if up)
    assert largest < smallest
    assert largest < 1.15 * border  # 1.08
    assert smallest > 0.85 * border


def test_loops_of_several_rates_are_refused(cases):
    base = cases("two_area").initialize(storage="50MW")
    one = CYCLES["relay 1.2 mHz, 200 ms"].controller(base)
    linear = st.Controller.from_control(LAG, "speed:3", "vs:3", rate=30)
    with pytest.raises(StudyError, match="of one rate, not for 30/s and 60/s"):
        base.limit_cycles(one, linear)


@pytest.mark.parametrize(("band", "rate"), [("0..1Hz", None), ("5..10Hz", 20)])
def test_a_band_that_is_not_searched_is_refused(cases, band, rate):
    base = cases("two_area").initialize(storage="50MW")
    one = st.Controller.from_control(LAG, "deviation:1", "order:1@5", limits=1.0, rate=rate)
    with pytest.raises(StudyError, match="The band must begin above 0 Hz and below"):
        base.limit_cycles(one, band=band)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"rate": 60, "ramp": 1.0}, "has a ramp limit"),
        ({"limits": (-0.1, 0.2)}, r"has the limits -0.1 and 0.2; limit cycles are found for limits that are equal"),
    ],
)
def test_what_has_no_describing_function_here_is_refused(cases, options, says):
    base = cases("two_area").initialize(storage="50MW")
    with pytest.raises(StudyError, match=says):
        base.limit_cycles(st.Controller.from_control(LAG, "speed:1", "vs:1", **options))


def test_a_python_function_has_no_describing_function(cases):
    """Neither a relay in Python, nor a function next to a relay: what acts in it is not known."""
    base = cases("two_area").initialize(storage="100MW")
    relay = CYCLES["relay 1.2 mHz, 200 ms"].controller(base)
    own = st.Controller.from_function(
        lambda seen: np.sign(seen["deviation:1"]) * (abs(seen["deviation:1"]) > 2e-5), relay.inputs, relay.outputs,
        limits=1, delay="200ms", name="own",
    )  # fmt: skip
    for loop in ((own,), (relay, own)):
        with pytest.raises(StudyError, match="own is a Python function, whose describing function is not known"):
            base.limit_cycles(*loop)


def test_a_linear_loop_has_no_limit_cycles(cases):
    base = cases("two_area").initialize()
    with pytest.raises(StudyError, match="the loop is linear"):
        base.limit_cycles(st.Controller.from_control(LAG, "speed:1", "vs:1"))


def test_limits_with_linear_stabilizers(cases):
    """Linear controllers change the loop gain: the same as with a system whose model has them."""
    base = cases("two_area_thyristor").initialize(storage="50MW")
    trial = CYCLES["relay 12 mHz"]
    s = control.tf("s")
    pss = [
        st.Controller.from_control(
            2 * s / (1 + 10 * s) / (1 + 0.02 * s), f"speed:{i}", f"vs:{i}", rate=60, delay="50ms"
        )
        for i in (1, 3)
    ]
    alone, both = (base.limit_cycles(trial.controller(base), *more) for more in ((), pss))
    assert both.cycles[0].frequency_hz != pytest.approx(alone.cycles[0].frequency_hz, rel=1e-4)
    cycle = both.cycles[0]
    assert [one.signal for one in cycle.signals] == ["deviation:1"]  # what the relay reads
    equivalent = -1 / cycle.inverse
    linear = st.Controller.from_control(control.ss([], [], [], equivalent), "deviation:1", "order:1@5", rate=60)
    values = base.closed_loop(linear, *pss).modes().eigenvalues
    assert np.abs(values - 2j * np.pi * cycle.frequency_hz).min() < 1e-8


@pytest.mark.parametrize("name", ["relay 1.2 mHz, 200 ms", "deadband 12 mHz, continuous, lag 100 ms"])
def test_the_closed_loop_with_the_gain_of_a_limit_cycle_neither_decays_nor_grows(name):
    """Two routes: the frequency response, and the eigenvalues of the exact closed loop."""
    trial = CYCLES[name]
    base = trial.base()
    linear = trial._replace(relay=False, deadband=0, limits=np.inf).controller(base)
    for cycle in trial.found(base).cycles:
        values = base.closed_loop(linear.scaled(-1 / cycle.inverse)).modes().eigenvalues
        assert np.abs(values - 2j * np.pi * cycle.frequency_hz).min() < 1e-6


def test_of_several_outputs_each_has_the_gain_at_its_own_amplitude():
    trial = CYCLES["four relays 1.2 mHz, 300 ms"]
    base = trial.base()
    found = trial.found(base)
    assert found.cycles
    for cycle, curve in zip(found.cycles, found.curves, strict=True):
        N = [curve.acts.gain(one.amplitude) for one in cycle.wanted]
        each = control.ss([], [], [], np.diag(N))
        linear = st.Controller.from_control(each, "deviation", "order", rate=60, delay=trial.delay / 60)
        values = base.closed_loop(linear).modes().eigenvalues
        assert np.abs(values - 2j * np.pi * cycle.frequency_hz).min() < 1e-6
        assert cycle.inverse == pytest.approx(-1 / N[np.argmax([one.amplitude for one in cycle.wanted])])


def test_the_third_harmonic_goes_around_the_loop_at_three_times_the_frequency():
    trial = CYCLES["relay 1.2 mHz, 200 ms"]
    found = trial.found(trial.base())
    (loop,) = found.curves
    cycles = [cycle for cycle in found.cycles if 3 * cycle.frequency_hz < loop.hz[-1]]
    assert len(cycles) == 2
    for cycle in cycles:
        once, thrice = np.abs(np.interp(np.array([1, 3]) * cycle.frequency_hz, loop.hz, loop.gain))
        given = loop.acts.third(cycle["controller: order:1@5"].amplitude)
        assert cycle.third_harmonic == pytest.approx(given * thrice / once, rel=1e-3)  # 1e-4: between two points


def test_the_result_prints_itself_and_has_a_table_and_a_figure(cases):
    trial = CYCLES["relay 1.2 mHz, 200 ms"]
    found = trial.found(trial.base())
    assert str(found).splitlines()[0] == "two_area: 4 limit cycles from 0.1 to 10 Hz:"
    assert list(found.df.columns)[:3] == ["frequency_hz", "stable", "third_harmonic"]
    assert len(found.df) == 4
    ax = found.plot()
    assert ax.get_xlabel() == "real part"
    assert found.cycles[0]["deviation:1"].amplitude > 0
