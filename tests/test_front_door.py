"""The front door: one import, five nouns, verbs on them, and one sentence for whatever makes no sense."""

import ast
import inspect
import runpy
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

import stabctl as st

TOLD = {
    "speeds": "7-8",
    "lead": "damping ratio 0.018",
    "stabilizer": "ratio 0.2780 (1, 2 against 3, 4)",
    "own_law": "critical clearing time 26.625 cycles",
}  # by a script
FAULT = st.Contingency("7-8@0.4", clear="21cyc", trip="7-8")
VOLTAGES = "voltage:5", "voltage:6", "voltage:11", "voltage:10"  # at the storage devices


@pytest.fixture(scope="module")
def case():
    return st.load("two_area")


@pytest.fixture(scope="module")
def base(case):
    return case.initialize()


def test_the_import_is_light():
    code = "import stabctl, sys; print(*sys.modules)"
    modules = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert "stabctl" in modules
    assert not {"numpy", "numba", "scipy", "pandas", "xarray", "matplotlib"} & set(modules)


def test_every_name_is_there_and_known_to_editors():
    tree = ast.parse(Path(st.__file__).read_text())
    block = next(node for node in tree.body if isinstance(node, ast.If))
    seen = {alias.asname or alias.name for line in block.body for alias in line.names}
    assert seen == set(st.__all__) == set(dir(st))
    assert all(getattr(st, name) is not None for name in st.__all__)
    with pytest.raises(AttributeError, match="nothing"):
        st.nothing  # noqa: B018


@pytest.mark.slow
def test_the_session_runs_as_written(tmp_path):
    case = st.load("two_area")
    base = case.initialize()
    fault = st.Contingency("7-8@0.4", clear="21cyc", trip="7-8")
    run = base.simulate(fault, storage="50MW", control=st.BangBang())
    assert isinstance(run.plot(), plt.Axes)
    assert run.df.time_s.iloc[-1] == 10
    assert run.speed.dims == ("time", "machine")
    law = st.BangBang(deadband="100mHz")
    assert base.clearing_time(fault, storage="50MW", control=law).cycles == 26.0
    assert list(base.screen(below="12cyc").df.columns) == ["fault", "trip", "cycles", "status", "machine", "limited_by"]
    modes = base.modes(band="0.1..2Hz")
    assert modes.df.frequency_hz.between(0.1, 2).all()
    assert modes.df.swing.sum() == 3
    model = base.linearize(inputs="vref:2", outputs="speed:2").to_control()
    assert (model.ninputs, model.noutputs, model.nstates) == (1, 1, 56)
    worst = base.screen(below="12cyc")
    assert [(site.bus, site.machine) for site in st.place(case, worst, cap="200MW").sites] == [(11, 3)]
    for result in (run, modes, base.screen(below="9cyc"), base.clearing_time(fault, limit="30cyc")):
        assert result._repr_html_().startswith("<p>two_area")
        assert isinstance(result.plot(), plt.Axes)
    plt.close("all")


@pytest.mark.slow
@pytest.mark.parametrize(("script", "most"), [("speeds", 12), ("lead", 12), ("stabilizer", 12), ("own_law", 10)])
def test_a_task_is_a_short_script(script, most, tmp_path, monkeypatch, capsys):
    """Speeds and screen, a python-control loop, a stabilizer, a law of one's own: what a new user writes."""
    path = Path(st.__file__).parents[1] / "docs" / "examples" / f"{script}.py"
    _, *lines = ast.parse(path.read_text()).body
    written = path.read_text().splitlines()[lines[0].lineno - 1 :]
    assert len([line for line in written if line.strip()]) <= most
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(path))
    assert TOLD[script] in capsys.readouterr().out
    plt.close("all")


@pytest.mark.parametrize("noun", [st.Case, st.OperatingPoint])
@pytest.mark.parametrize(
    "verb", ["power_flow", "simulate", "clearing_time", "screen", "modes", "linearize", "estimate", "place"]
)
def test_a_verb_is_the_function(noun, verb):
    assert getattr(noun, verb) is getattr(st, verb)


def test_a_bound_verb_tells_its_signature(base):
    assert "contingency" in inspect.signature(base.simulate).parameters
    assert "base" not in inspect.signature(base.simulate).parameters
    assert base.simulate.__doc__ == st.simulate.__doc__


def test_a_case_and_its_point_give_the_same_run(case, base):
    runs = [thing.simulate(FAULT, "3s", storage="50MW", control=st.BangBang()) for thing in (case, base)]
    assert np.array_equal(runs[0].rows, runs[1].rows)
    assert runs[0].outcome.stable
    assert not base.simulate(FAULT).outcome.stable


@pytest.mark.parametrize("storage", ["1=50MW,4=20MW", {1: "50MW", 4: 20}, [st.Storage(1, 5, 50), st.Storage(4, 9, 20)]])
def test_storage_is_text_a_mapping_or_rows(base, storage):
    devices = st.simulate(base, until=0.1, storage=storage).point.case.storage
    assert [(d.machine, d.rating) for d in devices] == [(1, 50), (4, 20)]


def test_no_storage_in_place_of_some(base):
    stored = st.initialize(base.case, storage="50MW")
    assert len(stored.case.storage) == 4
    assert not st.simulate(stored, until=0.1, storage="none").point.case.storage


def test_what_happens_may_be_one_or_many(base):
    both = base.simulate([FAULT, "7:+50MW@2s"], "2.5s").rows
    assert np.array_equal(both, base.simulate([FAULT, st.LoadStep(7, 2.0, p=50)], 2.5).rows)
    assert np.array_equal(base.simulate("7-8@1s", 2).rows, base.simulate(st.Open("7-8", 1.0), 2).rows)


def law_giving(answer):
    return st.Controller.from_function(lambda seen: answer, "deviation", "order")


@pytest.mark.slow
def test_a_law_written_in_python_approaches_the_compiled_one(base):
    """Its orders are held from frame to frame; those of the compiled law switch in between."""

    def bang_bang(seen):
        w, v = seen["deviation"], seen.actual("voltage")
        return np.where((v < 0.8) | (abs(w) <= 0.1 / 60), 0, np.sign(w))

    def differences(rate):
        options = {"storage": "50MW", "step": 1 / rate}
        law = st.Controller.from_function(bang_bang, ["deviation", *VOLTAGES], "order", rate=rate)
        ours = base.simulate(FAULT, "2.4s", control=law, **options)
        theirs = base.simulate(FAULT, "2.4s", control=st.BangBang(deadband="100mHz"), **options)
        assert np.abs(ours.arrays.order).max() == 1
        other = (ours.arrays.order != theirs.arrays.order).any(1).sum()
        return other, np.abs(ours.arrays.speed - theirs.arrays.speed).max()

    (rows, coarse), (again, fine) = differences(120), differences(1920)
    assert max(rows, again) <= 4  # a frame at some of 12 switches: 2 and 2
    assert coarse < 5e-5  # 2.3e-5 pu
    assert fine < coarse / 8  # 1 / 16


def test_a_law_with_memory_starts_anew_in_every_run(base):
    class Delayed:
        def __init__(self):
            self.past = []

        def __call__(self, seen):
            self.past.append(seen["deviation"])
            return 300 * self.past[-6] if len(self.past) > 5 else 0.0

    law = st.Controller.from_function(Delayed, "deviation", "order")
    one, two = (base.simulate(FAULT, "2s", storage="50MW", control=law) for _ in range(2))
    assert np.array_equal(one.rows, two.rows)


@pytest.mark.parametrize(
    ("nonsense", "says"),
    [
        (lambda b: st.simulate("two_area"), "'two_area' is not a system; give a Case"),
        (lambda b: st.simulate(st.Case), "is not a system"),
        (lambda b: st.power_flow("two_area"), "is not a system"),
        (lambda b: st.replicate(3, 2), "3 is not a system"),
        (lambda b: st.write("two_area", "there"), "is not a system"),
        (lambda b: st.load(3), "There is no case '3'"),
        (lambda b: st.place("two_area", FAULT), "is not a system"),
        (lambda b: b.place(3), "contingencies = 3 is not allowed; give a list"),
        (lambda b: b.estimate(3), "3 is not a contingency"),
        (lambda b: b.modes(3), "is not a band"),
        (lambda b: b.modes("2..1Hz"), "is empty or negative"),
        (lambda b: b.linearize("speed:2"), "'speed' is not an input"),
        (lambda b: b.linearize("vref:9"), "There is no machine 9"),
        (lambda b: b.linearize(3), "3 is not a list of signals"),
        (lambda b: b.screen("x"), "'x' is not a time"),
        (lambda b: b.screen(buses=99), "99"),
        (lambda b: b.screen(workers="2"), "workers"),
        (lambda b: b.clearing_time([FAULT]), "is not a contingency"),
        (lambda b: b.clearing_time("99"), "There is no bus 99"),
        (lambda b: st.initialize(b), "is not a case"),
        (lambda b: b.simulate(FAULT, control=st.BangBang), "BangBang is a class; give an instance, BangBang()"),
        (lambda b: b.simulate(FAULT, control=st.BangBang()), "needs storage devices to control"),
        (lambda b: b.simulate(FAULT, storage="50MW", control="bang"), "is not a control law"),
        (
            lambda b: b.simulate(FAULT, storage="50MW", control=law_giving("x")),
            "The law controller returned 'x' at 0.000",
        ),
        (lambda b: b.simulate(FAULT, storage="50MW", control=law_giving([1, 2])), "it must return 4 outputs"),
        (lambda b: st.Controller.from_function(3, "speed:1", "order"), "3 is not a control law"),
        (lambda b: st.Controller.from_function(abs, "speed:1", "order", rate=0), "rate of 0 frames"),
        (lambda b: b.simulate(FAULT, storage=[50]), "is not a fleet of storage devices"),
        (lambda b: b.simulate(FAULT, storage="50"), "is not a storage size"),
        (lambda b: b.simulate(FAULT, storage={9: "50MW"}), "There is no machine 9"),
        (lambda b: b.simulate("7-8@0.4"), "is not an event"),
        (lambda b: b.simulate(7), "7 is not a contingency"),
        (lambda b: b.simulate(st.Contingency), "is not a contingency"),
        (lambda b: b.simulate([FAULT, 7]), "7 is not a contingency"),
        (lambda b: b.simulate(st.Contingency("7-8")), "is never cleared; give a clearing time"),
        (lambda b: b.simulate(st.Contingency("99", "6cyc")), "There is no bus 99"),
        (lambda b: b.simulate(FAULT, "1s"), "must end after its last event at 1.35 s"),
        (lambda b: b.simulate(FAULT, "5"), "'5' is not a time"),
        (lambda b: b.simulate(FAULT, step="1"), "'1' is not a time"),
        (lambda b: b.simulate(FAULT, criterion=3.5), "is not a stability criterion"),
        (lambda b: st.BangBang(deadband="100"), "'100' is not a frequency"),
        (lambda b: st.BangBang(min_voltage="0.8"), "min_voltage = '0.8'"),
    ],
)
def test_nonsense_is_one_sentence(base, nonsense, says):
    with pytest.raises(st.StabctlError) as caught:
        nonsense(base)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
