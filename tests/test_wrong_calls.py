"""Calls that make no sense are answered with a sentence, not with a traceback or a silent result."""

import pytest

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.design.law_measurement import LAW as DESIGNED
from stabctl.jobs import Runner
from stabctl.model.replicate import replicate
from stabctl.simulation.events import event


@pytest.fixture(scope="module")
def base():
    return st.load("two_area").initialize()


@pytest.fixture(scope="module")
def run(base):
    return base.simulate(until="0.1s")


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: st.LoadStep(7, "1MW", p=50), "'1MW' is not a time"),
        (lambda: st.LoadStep(7, None, p=50), "None is not a time"),
        (lambda: st.LoadStep(7, 1.0), "The load step at bus 7 has no power"),
        (lambda: st.LoadStep(7, 1.0, p="50Hz"), "'50Hz' is not a power"),
        (lambda: event("7:50MW@1s", 60.0), "is not an event"),
        (lambda: st.EstimatorControl(3), "control = 3 is not a control law"),
        (lambda: st.EstimatorControl(st.BangBang(), pmu=3), "pmu = 3 does not describe PMUs"),
        (lambda: st.BangBang(deadband=None), "deadband = None"),
        (lambda: st.load("two_area").with_storage("1e9MW"), "not realistic; give at most 1e\\+06 MW"),
        (lambda: replicate(st.load("two_area"), "x"), "'x' copies of two_area are not possible"),
        (lambda: st.load("two_area").set("pss.1.gain", 10), "pss has no column 'gain'; did you mean K"),
        (lambda: st.load("two_area").set("pss.1.zzz", 10), "pss has no column 'zzz'; it has .*Vmin"),
    ],
)
def test_records(call, says):
    with pytest.raises(StudyError, match=says):
        call()


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda b: st.BangBang().sampled(60, 1e308), "delay = 1e\\+308 is too long; give at most 60 s"),
        (lambda b: st.BangBang().sampled(10_000, "1s"), "10000 frames; give at most 2000"),
        (lambda b: st.design.pod(b, "speed:1", "vref:1", delay=1e-308), "delay = 1e-308 is too short"),
        (lambda b: st.BangBang().controllers(None), "None is not a case"),
        (lambda b: st.Controller("speed:1", "vref:1", [], [], [], [[1]], delay=1e308), "is too long"),
        (lambda b: st.Gate(3), "signal = 3 does not name a signal"),
        (lambda b: st.Gate("voltage:7", magnitude="no"), "magnitude = 'no' is not allowed"),
        (lambda b: b.limit_cycles(3), "3 is not a Controller"),
        (
            lambda b: b.simulate(until="0.1s", record=False).arrays.swing,
            "no signals: they were not recorded; leave out",
        ),
        (
            lambda b: b.estimate(control=st.EstimatorControl(), estimator="ideal", pmu=st.Pmu()),
            "EstimatorControl has its own estimator and pmu; give it there",
        ),
        (
            lambda b: b.simulate(control=st.Controller("speed:1", "vs:1", [[-1]], [[1]], [[1]], [[0]], tracking=1)),
            "controller: tracking acts at the limits of the outputs; give limits, such as limits=0.1",
        ),
        (lambda b: b.margins(None), "None is not a Controller"),
        (lambda b: st.design.pairs(b, delay=[]), "delay = \\[\\] is not a time"),
        (lambda b: st.design.pairs(b, availability=3), "availability = 3 is not a dict"),
        (
            lambda b: st.design.pairs(b, availability={"vs": 1.01}),
            "vs = 1.01 is not allowed; give a number from 0 to 1",
        ),
        (lambda b: st.design.lqr(b, "vref", effort="x"), "effort = 'x' is not allowed"),
        (lambda b: st.design.lqg(b, "vref", delay=-1), "delay = -1 is not a time"),
        (lambda b: st.design.lqg(b, "vref", rate="x"), "rate of 'x' frames"),
        (lambda b: st.design.lqg(b, "vref", noise=float("nan")), "noise = nan is not allowed"),
        (lambda b: st.design.lqg(b, "vref", order=[]), "order = \\[\\] is not a number of states"),
        (lambda b: st.design.lqg(b, "vref", disturbance=1e308), "disturbance = 1e\\+308 is not allowed"),
        (lambda b: st.design.pod(b, "speed:1", "vref:1", rate="x"), "rate of 'x' frames"),
        (lambda b: st.design.pod(b, "speed:1", "vref:1", order="x"), "order = 'x' is not allowed"),
        (lambda b: st.design.pod(b, "speed:1", "vref:1", damping=None), "damping = None \\(damping ratio\\) must be"),
        (lambda b: st.design.pss(b, 3), "machines = 3 is not a list of machines"),
        (lambda b: st.design.law(b, "7", limits=3), "limits = 3 is not allowed; give a LawLimits or None"),
        (lambda b: st.design.law(b, "7", seed=-1), "seed = -1 is not allowed; give a whole number from 0 on"),
        (lambda b: st.design.law(b, "7", training="half"), "training = 'half' is not allowed; give a number"),
        (lambda b: st.design.evidence(3), "design = 3 is not allowed; give a Design"),
        (lambda b: st.design.tune(b, levels=None), "levels = None is not allowed; give a list"),
        (lambda b: st.design.tune(b, seed="x"), "seed = 'x' is not allowed; give a whole number"),
        (lambda b: st.design.pod(b, "speed:1", "vref:1", washout=1e308), "washout = 1e\\+308 is not allowed"),
        (lambda b: b.study(clear=1e308), "cycles is not possible; give a time above 0 and below 1e6cyc"),
        (lambda b: b.study(clear="6cyc", worst=True), "worst = True is not allowed; give a whole number"),
        (lambda b: b.place(["7-8@0.4"], candidates=3), "candidates = 3 is not allowed"),
        (lambda b: b.modes().label(99), "There is no mode 99"),
        (lambda b: b.modes().within("0.5", "1Hz"), "'0.5' is not a frequency; write it as 0.5Hz or 100mHz"),
        (lambda b: b.case.with_loads(["power"]), "Loads of kind \\['power'\\] are not known"),
        (lambda b: st.replicate(b, 2, spread=-1), "A spread of -1 is not possible"),
        (lambda b: st.BadPmu("3", at=None), "at = None"),
        (lambda b: Runner(DESIGNED, store=3), "3 is not the name of a file or folder"),
        (lambda b: Runner(DESIGNED, scheduler=3), "3 is not the address of a Dask scheduler"),
    ],
)
def test_controllers_and_designs(base, call, says):
    with pytest.raises(StudyError, match=says):
        call(base)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda run: run.save(None), "None is not the name of a file"),
        (lambda run: run.save("none/such/run.csv"), "There is no folder 'none/such'"),
        (lambda run: run.plot(ax=3), "ax = 3 is not a pair of axes"),
        (lambda run: run.values("speedx"), "There is no quantity 'speedx'; did you mean speed"),
        (lambda run: run.point.constants("genrow"), "There is no model 'genrow'; did you mean genrou"),
        (lambda run: run.point.resized([1, 2, 3, 4, 5, 6]), "give a rating for each"),
        (lambda run: run.table(3), "3 names no quantities; write 'voltage:16,speed'"),
        (lambda run: run.point.simulate(record="rotors"), "record = 'rotors' is not allowed"),
        (lambda run: run.plot("speed", "voltage"), "One plot shows one quantity, but 2 are given"),
        (lambda run: run.point.estimate(st.Contingency("7", clear="3cyc"), until=2, pmu=3), "pmu = 3"),
        (lambda run: run.point.linearize("vref:2", "speed:2").response("x"), "'x' is not a list of frequencies"),
        (lambda run: run.point.linearize("vref:2", "speed:2").save(None), "None is not the name of a file"),
        (
            lambda run: run.point.simulate(st.Contingency("7", clear="3cyc", at="1e99s")),
            "must end after its last event",
        ),
        (lambda run: st.write(run.point.case, None), "None is not the name of a file or folder"),
    ],
)
def test_results(run, call, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(StudyError, match=says):
        call(run)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_created_is_a_sentence(run, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StudyError, match="file/case cannot be created"):
        st.write(run.point.case, tmp_path / "file" / "case")


def test_instants_and_powers_of_records_are_text_too(base):
    text, number = st.LoadStep(7, "60cyc", p="50MW", q="20Mvar"), st.LoadStep(7, 1.0, p=50.0, q=20.0)
    assert (text.p, text.q) == (50.0, 20.0)
    assert base.simulate(text, 1.5).rows.tobytes() == base.simulate(number, 1.5).rows.tobytes()
    assert st.Contingency("7", "3cyc", events=[text]).others(base.case) == (number,)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("modes", "two_area", "--band", "0", "0"), "The band from 0 to 0 Hz is empty"),
        (("modes", "two_area", "--band", "1", "1e308"), "The band from 1 to 1e+308 Hz is too wide"),
        (("modes", "two_area", "--band", "1e-308", "1", "--sparse"), "The band from 1e-308 to 1 Hz is too wide"),
        (("modes", "two_area", "--set", f"pss.{'9' * 5000}.K=1"), f"no pss at {'9' * 36}...; it has 1, 2, 3, 4"),
        (("simulate", "two_area", "--storage-at", f"{'9' * 5000}=5MW"), "9... does not describe a storage device"),
        (("simulate", "two_area", "--trip-machine", "\u0663@1s"), "is not a machine trip"),
        (("simulate", "two_area", "--fault", "\u0667", "--clear", "3cyc"), "is not a location"),
        (
            ("linearize", "two_area", "--inputs", "vref:\u00b2", "--out", "x.npz"),
            "'vref:\u00b2' does not name a machine",
        ),
        (
            ("linearize", "two_area", "--inputs", "vref:\u0662", "--out", "x.npz"),
            "'vref:\u0662' does not name a machine",
        ),
        (("simulate", "two_area", "--control", "none", "--deadband", "5"), "no storage device has the bang-bang law"),
        (("simulate", "two_area", "--min-voltage", "0.7"), "no storage device has the bang-bang law"),
        (("modes", "two_area", "--lag", "100ms"), "for devices given with --storage"),
        (("simulate", "two_area", "--latency-ms", "200"), "are for an estimator"),
        (("simulate", "two_area", "--open", "7-8@1s", "--at", "5s"), "--at needs --fault or --trip"),
        (("simulate", "two_area", "--open", "7-8@1s", "--fault-impedance", "0,0.1"), "--fault-impedance needs --fault"),
        (("design", "tune", "two_area", "--dyr-out", "x.dyr"), "--dyr-out needs --model"),
        (("tables", "nothing"), "There is no table or case 'nothing'"),
    ],
)
def test_commands(stabctl, tmp_path, monkeypatch, words, says):
    monkeypatch.chdir(tmp_path)
    code, out, err = stabctl(*words)
    assert (code, out) == (2, "")
    assert says in err


def test_a_file_that_cannot_be_written_is_said_before_the_work(stabctl, tmp_path, monkeypatch):
    def refuse(_):
        raise OSError(13, "Permission denied")

    def work(*_, **__):
        raise AssertionError("began to simulate")

    monkeypatch.setattr("stabctl._util.files._beside", refuse)
    monkeypatch.setattr("stabctl.simulation.simulate.simulate", work)
    code, _, err = stabctl("simulate", "two_area", "--out", tmp_path / "run.csv")
    assert code == 2
    assert "run.csv cannot be written: Permission denied" in err


def test_tables_of_a_case(stabctl):
    code, out, _ = stabctl("tables", "two_area")
    assert code == 0
    assert "pss.csv" in out
    assert "gensal.csv" not in out
