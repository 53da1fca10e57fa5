"""Every sentence on the end of a run, with the conditions on which it is said; fields of a real end are changed.

Two islands at 50 Hz: converter 1, machine 2, a grid-following and a grid-forming device; machines 1001 and 1002.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from islands import joined
from systems import FORMING, KINDS, small

import stabctl as st
from stabctl.model.network import BranchState, Switching
from stabctl.model.tables import Load, Storage
from stabctl.simulation import _judgment as judgment
from stabctl.simulation import simulation
from stabctl.simulation.outcome import ControlLoop, Stalled, outcome

LOOP = ControlLoop(20.0, None, None, 1 / 120, True, False, False, ())
CALM = {"min_frequency": 0.94, "max_frequency": 1.04, "frequency_delay_s": 0.0}


def two_islands():
    one = small({"regfm_a1": FORMING._replace(TPf=0.1)})
    devices = (
        Storage(1, 2, 40.0, storage_model="regc_c", converter="Te=0 wmin=-9 wmax=14"),
        Storage(2, 3, 30.0, storage_model="regfm"),
    )
    both = joined(one.with_storage(devices), small(KINDS["sexs, pss, steam"]))
    more = [Load(1002, 3.0, 1.0, p_power=0.5, v_low=low, id=name) for low, name in ((0.6, "a"), (0.8, "b"), (0.7, "c"))]
    return replace(both, loads=(*both.loads, *more), frequency_hz=50.0)


@pytest.fixture(scope="module")
def ended():
    """Point, end and criterion of a short run; the same after a machine was cut off."""
    point, found = two_islands().initialize(), []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulation, "outcome", lambda *given: found.append(given) or outcome(*given))
        point.simulate([st.Open("1002-1003", 0.1)], until=0.3)
        point.simulate([st.Open("1001-1002", 0.1)], until=0.3)
    return found


def extremes(slowest, fastest, lowest, cleared=False):
    return SimpleNamespace(
        slowest=np.array(slowest), fastest=np.array(fastest), lowest=np.array(lowest), cleared=cleared
    )


ON, NAN = [0.99, 1.0, 0.98, 1.0, np.nan, np.nan], np.nan
VOLTS = [0.9, 0.81, 1.0, NAN, 0.95, 1.0]
ALL = "All machines and converters stayed in synchronism until 0.300 s"
FINAL = "; final frequencies 50.05 Hz in the island of converter 1, 49.93 Hz in the island of machine 1001."
FAST = np.array([1.011, 1.0, 0.98, 1.0, 1.0, 1.0])  # 50.05 and 49.926 Hz with 20, 200, 16, 200 s
SLIPPED, FREQUENCY = judgment.SLIPPED, judgment.FREQUENCY
EMPTY, FULL = judgment.EMPTY, judgment.FULL_STORE
GONE = Switching(branches=((0, BranchState(0.4, 1.0)), (4, BranchState(from_closed=False))), faults=((2, 1 + 0j),))

SENTENCES = {  # fields of the end, of the criterion -> what is said
    "nothing": ({"seen": None}, {}, f"{ALL}{FINAL}"),
    "the slowest and the fastest": (
        {"seen": extremes(ON, [1.02, 1.0, 1.01, 1.03, NAN, NAN], VOLTS)}, {},
        f"{ALL}; frequency 49.00 (machine 1001) to 51.50 Hz (machine 1002), lowest voltage 0.81 pu at bus 2{FINAL}",
    ),
    "of storage, after clearing": (
        {"seen": extremes([NAN, NAN, NAN, NAN, NAN, 0.99], [NAN, NAN, NAN, NAN, NAN, 1.0], VOLTS, True)}, {},
        f"{ALL}; frequency 49.50 (storage device ESD 2@3) to 50.00 Hz (storage device ESD 2@3), lowest voltage after "
        f"clearing 0.81 pu at bus 2{FINAL}",
    ),
    "one frequency, no voltage": (
        {"seen": extremes([1.0] * 6, [1.0] * 6, [NAN] * 6)}, {}, f"{ALL}; frequency 50.00 Hz{FINAL}"
    ),
    "nobody was seen": ({"seen": extremes([NAN] * 6, [NAN] * 6, VOLTS)}, {}, f"{ALL}{FINAL}"),
    "outside for a while": (
        {"seen": None, "outside_s": 0.123}, CALM | {"frequency_delay_s": 1.0},
        f"{ALL}, outside 47 to 52 Hz for 0.12 s at most{FINAL}",
    ),
    "outside, not timed": ({"seen": None, "outside_s": 0.123}, CALM, f"{ALL}{FINAL}"),
    "converter": (
        {"verdict": SLIPPED, "machine": 0}, {"max_angle": np.pi},
        "Converter 1 (REGFM_A1) lost synchronism at 0.300 s: its virtual angle moved 180 degrees relative to "
        "the center "
        "of inertia of its island.",
    ),
    "machine": (
        {"verdict": SLIPPED, "machine": 3}, {},
        "Machine 1002 lost synchronism at 0.300 s: its angle moved 201 degrees relative to the center of "
        "inertia of its "
        "island.",
    ),
    "loop": (
        {"verdict": judgment.UNLOCKED, "machine": 4}, {},
        "Storage device ESD 1@2 lost synchronism at 0.300 s: the angle of its phase-locked loop moved 201 degrees "
        "relative to the center of inertia of its island.",
    ),
    "loop at its limit": (
        {"verdict": judgment.UNLOCKED, "machine": 4, "speed": np.r_[FAST[:4], 1 + 14 / (100 * np.pi), 1.0]}, {},
        "Storage device ESD 1@2 lost synchronism at 0.300 s: the angle of its phase-locked loop moved 201 degrees "
        "relative to the center of inertia of its island, its frequency at a limit of its range from 48.57 "
        "to 52.23 Hz.",
    ),
    "virtual angle": (
        {"verdict": judgment.UNLOCKED, "machine": 5}, {},
        "Storage device ESD 2@3 lost synchronism at 0.300 s: its virtual angle moved 201 degrees relative to "
        "the center "
        "of inertia of its island.",
    ),
    "runaway": (
        {"verdict": judgment.RUNAWAY, "machine": 0}, {"slowest": 0.85, "fastest": 1.25},
        "The speed of converter 1 (REGFM_A1) left the range 0.85 to 1.25 pu at 0.300 s.",
    ),
    "frequency of one of two": (
        {"verdict": FREQUENCY, "machine": 3}, {**CALM, "frequency_delay_s": 0.7},
        "The frequency of the island of machines 1001, 1002 was outside 47 to 52 Hz for 0.7 s at 0.300 s: it is 49.93 "
        "Hz.",
    ),
    "frequency of all": (
        {"verdict": FREQUENCY, "machine": 1, "island": np.array([0, 0, -1, -1, -1, -1])},
        {**CALM, "frequency_delay_s": 0.7},
        "The frequency was outside 47 to 52 Hz for 0.7 s at 0.300 s: it is 50.05 Hz.",
    ),
    "frequency that storage makes": (
        {
            "verdict": FREQUENCY, "machine": 5, "island": np.array([0, 0, -1, -1, -1, 1]),
            "weight": np.array([20.0, 200, 16, 200, 0, 0.15]), "speed": np.r_[FAST[:5], 0.9],
        },
        {**CALM, "frequency_delay_s": 0.7},
        "The frequency of the island of storage device ESD 2@3 was outside 47 to 52 Hz for 0.7 s at 0.300 s: it is "
        "45.00 Hz.",
    ),
    "no voltage": (
        {"verdict": judgment.NO_VOLTAGE, "bus": 4}, {},
        "Voltage collapse at bus 1002 at 0.300 s: the network equations have no solution.",
    ),
    "low voltage": (
        {"verdict": judgment.LOW_VOLTAGE, "bus": 4}, {"low_voltage_s": 0.4},
        "Voltage collapse at bus 1002 at 0.300 s: its voltage stayed below the limit of its load for 0.4 s without a "
        "fault.",
    ),
    "empty": (
        {"verdict": EMPTY, "machine": 5, "bus": 2}, {},
        "Storage device ESD 2@3 is empty at 0.300 s, and its island, which has no machine, needs its power: "
        "it is lost.",
    ),
    "full": (
        {"verdict": FULL, "machine": 5, "bus": 2}, {},
        "Storage device ESD 2@3 is full at 0.300 s, and its island, which has no machine, has more power "
        "than it needs: "
        "it is lost.",
    ),
    "no rotor": (
        {"weight": np.zeros(6)}, {},
        "Every island kept its voltage until 0.300 s; without a rotor, synchronism is not judged.",
    ),
    "alone": (
        {"taken_off": {0: "Machine 1 ran away."}, "seen": None, "outside_s": 0.2}, {},
        "Machine 1 ran away. Every island stayed in synchronism until 0.300 s, outside 47.5 to 51.67 Hz for 0.2 s at "
        f"most{FINAL}",
    ),
    "unstable beside one alone": (
        {"taken_off": {0: "Machine 1 ran away."}, "verdict": judgment.NO_VOLTAGE, "bus": 0}, {},
        "Voltage collapse at bus 1 at 0.300 s: the network equations have no solution. Machine 1 ran away.",
    ),
    "swings, stalled, cycling, loop": (
        {
            "seen": None, "swings": "They grow.", "cycling": {"1@2": 1.234, "2@3": 2.5}, "relay": True,
            "stalled": Stalled((2, 1002), (0.311, 0.944)), "loop": LOOP._replace(growing=2.0 + 0j),
        }, {},
        f"{ALL}{FINAL} They grow. The motor loads at buses 2, 1002 have stalled, with a slip of 31 to 94 %. Storage "
        "devices 1@2, 2@3 still reverse between full charging and full discharging, up to 2.5 times per "
        "second: a limit "
        "cycle of the control; widen its deadband. Where the control acts, the closed loop is unstable at rest: a "
        "deviation grows by 2 1/s; reduce the gain.",
    ),
    "one of each": (
        {
            "seen": None, "cycling": {"1@2": 1.234}, "stalled": Stalled((2,), (0.311,)),
            "loop": LOOP._replace(growing=0.5 + 2j * np.pi, alone=0.25 - 4j * np.pi),
        }, {},
        f"{ALL}{FINAL} The motor load at bus 2 has stalled, with a slip of 31 %. Storage device 1@2 still reverses "
        "between full charging and full discharging, up to 1.2 times per second: a limit cycle of the control; reduce "
        "its gain or delay, or widen its deadband. Where the control acts, the closed loop is unstable at rest: an "
        "oscillation at 1 Hz grows by 0.5 1/s; without the control, an oscillation at 2 Hz grows by 0.25 1/s.",
    ),
    "a loop that is too fast": (
        {"seen": None, "loop": ControlLoop(1234.5, None, None, 1 / 120, False, True, True, ("A.", "B."))},
        {},
        f"{ALL}{FINAL} The control closes a loop with an eigenvalue near 1.23e+03 1/s, too fast for the step "
        "of 8.33 ms: "
        "its orders may chatter, and the run cannot be trusted; reduce its gain, or give a shorter step. The "
        "orders did "
        "not agree with the accelerations that they cause, and the run cannot be trusted; reduce the "
        "acceleration gain. "
        "The orders jumped in step after step, and when they jump depends on the step of the run; widen the "
        "deadband of "
        "the law, or reduce its gain. A. B.",
    ),
    "faults": (
        {"seen": None, "switching": GONE}, {},
        f"{ALL}{FINAL} The faults at bus 3 and on circuit 1-2 are still on: they are not cleared before the end of the "
        "run.",
    ),
    "a fault": (
        {"seen": None, "switching": GONE._replace(faults=())}, {},
        f"{ALL}{FINAL} The fault on circuit 1-2 is still on: it is not cleared before the end of the run.",
    ),
}  # fmt: skip
KINDS_OF = {
    "converter": ("lost_synchronism", 1, None), "loop": ("lost_synchronism", "ESD 1@2", None),
    "machine": ("lost_synchronism", 1002, None), "runaway": ("lost_synchronism", 1, None),
    "loop at its limit": ("lost_synchronism", "ESD 1@2", None),
    "virtual angle": ("lost_synchronism", "ESD 2@3", None), "no voltage": ("voltage_collapse", None, 1002),
    "low voltage": ("voltage_collapse", None, 1002), "empty": ("voltage_collapse", None, 3),
    "full": ("voltage_collapse", None, 3), "alone": ("islanded", None, None),
    "frequency of one of two": ("frequency_instability", None, None),
    "frequency of all": ("frequency_instability", None, None),
    "frequency that storage makes": ("frequency_instability", None, None),
    "unstable beside one alone": ("voltage_collapse", None, 1),
}  # fmt: skip
OFF = {"frequency of one of two": (1001, 1002), "frequency that storage makes": ("ESD 2@3",)}


@pytest.mark.parametrize("name", SENTENCES)
def test_a_sentence(ended, name):
    fields, limits, said = SENTENCES[name]
    point, end, criterion = ended[0]
    plain = {"speed": FAST, "switching": Switching(), "swings": None, "loop": LOOP._replace(fastest=0.0)}
    found = outcome(point, end._replace(**{**plain, **fields}), criterion._replace(**limits))
    assert str(found) == said
    assert (found.kind, found.machine, found.bus) == KINDS_OF.get(name, ("stable", None, None))
    assert found.stable is (found.kind in ("stable", "islanded"))
    assert found.off_frequency == OFF.get(name, ())
    assert found.stalled == fields.get("stalled", ((),))[0]
    assert found.cycling == tuple(fields.get("cycling", ()))
    assert (found.time_s, found.cut_off) == (0.3, "")
    assert found.swings == fields.get("swings")


def test_what_is_cut_off_is_said_first_of_a_stable_run_and_last_of_another(ended):
    point, end, criterion = ended[1]
    cut = "The switching cut off bus 1001 with machine 1001."
    stable = outcome(point, end, criterion)
    assert str(stable).startswith(f"{cut} Every island stayed in synchronism until 0.300 s; frequency ")
    assert (stable.kind, stable.cut_off, stable.stable) == ("islanded", cut, True)
    lost = outcome(point, end._replace(verdict=SLIPPED, machine=1), criterion)
    assert str(lost).endswith(f" relative to the center of inertia of its island. {cut}")
    nothing = SimpleNamespace(
        net=SimpleNamespace(islands=0, island=end.stage.net.island, alive=end.stage.net.alive),
        island_of_bus=end.stage.island_of_bus,
    )
    dark = outcome(point, end._replace(stage=nothing), criterion)
    assert str(dark) == f"The system is blacked out at 0.300 s: no machine or grid-forming converter is left. {cut}"
    assert (dark.kind, dark.machine, dark.bus) == ("voltage_collapse", None, None)


def test_angles_of_storage_know_their_limits_their_store_and_their_weight(ended):
    """H = TPf/(2 mp) times the rating over the base; a store of MWh in pu seconds; limits of the loop in rad/s."""
    (point, *_) = ended[0]
    follows, forms = point.system.unweighted.rows
    assert (follows.name, follows.unit, follows.virtual, follows.inertia) == ("ESD 1@2", -1, False, 0.0)
    assert [follows.least, follows.most] == pytest.approx([1 - 9 / (100 * np.pi), 1 + 14 / (100 * np.pi)])
    assert (follows.floor, follows.capacity) == (-np.inf, np.inf)
    assert (forms.name, forms.virtual, forms.least, forms.most) == ("ESD 2@3", True, -np.inf, np.inf)
    assert [point.case.buses[row.bus].bus for row in (follows, forms)] == [2, 3]
    (table,) = [f for f in point.system.families if "ESD 2@3" in f.keys]
    par = dict(zip(table.device.Par._fields, table.k[0], strict=True))
    assert forms.inertia == pytest.approx(float(table.device.inertia(table.device.Par(*table.k[0]))) * par["mva"])
    stored = replace(
        point.case,
        storage=(point.case.storage[0], point.case.storage[1]._replace(energy=0.4, charge=0.3, efficiency=0.81)),
    ).initialize()
    row = stored.system.unweighted.rows[1]
    start = stored.s[row.energy]
    assert row.capacity - row.floor == pytest.approx(0.4 * 3600 / stored.case.base_mva)
    assert (start - row.floor) / (row.capacity - row.floor) == pytest.approx(0.3)
    assert stored.layout.states[row.energy].name == "energy"
    assert stored.layout.states[row.place].name == "delta"
