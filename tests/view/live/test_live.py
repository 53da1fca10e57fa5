"""The answers of the server of `stabctl live`: those of the library, to its own page only."""

import json
import shlex
from dataclasses import replace

import numpy as np
import pytest
from asgi import ask
from packed import unpacked

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.cli.groups import CaseOptions
from stabctl.cli.live import source
from stabctl.io.control_files import save_law
from stabctl.theory.phase_plane import separatrix
from stabctl.theory.two_machine import equivalent
from stabctl.view.live import answers, commands, page
from stabctl.view.live.answers import critical, landscape, pack
from stabctl.view.live.app import app
from stabctl.view.live.page import recording
from stabctl.view.live.state import Points, State, read

TOKEN = "a-token-of-the-test"
LOAD = commands.Source("st.load('two_area')", ("two_area",))
FAULT = State("7-8@0.4", clear=21)


@pytest.fixture(scope="module")
def points(cases):
    return Points(cases("two_area"))


@pytest.fixture(scope="module")
def pages(cases):
    return app(Points(cases("two_area")), LOAD, TOKEN, 8000)


def test_a_curve_that_the_page_does_not_have_is_named():
    run = st.load("two_area").simulate("7-8@1s", "1.5s")
    with pytest.raises(StudyError, match="'voltag' is not a curve of the page"):
        answers._arrays(run, ("speed", "voltag"))


def test_packed_curves_are_read_back():
    rng = np.random.default_rng(7)
    curves = rng.normal(60, 0.1, (101, 5))
    curves[40:, 2] = np.nan
    constant, none = np.full((101, 2), 3.25), np.zeros((101, 0))
    t = np.linspace(0, 10, 101)
    _, found = unpacked(pack({}, {"t": t, "curves": curves, "constant": constant, "none": none}))
    assert found["t"] == pytest.approx(t)
    assert np.array_equal(np.isnan(found["curves"]), np.isnan(curves))
    assert np.nanmax(np.abs(found["curves"] - curves)) < 1e-5  # 6e-6 Hz: half a step of 16 bits
    assert found["constant"] == pytest.approx(constant)


def test_a_run_is_that_of_simulate(points):
    state = replace(FAULT, signals=("speed", "angle", "voltage", "storage"), percent=5.0, compare=True)
    head, arrays = unpacked(answers.run_answer(points, state, LOAD))
    case = points.case.with_storage("5%mva")
    run = st.simulate(case, st.Contingency("7-8@0.4", clear="21cyc"), control=st.BangBang())
    assert head["runs"][""]["message"] == run.outcome.message
    assert arrays["time"] == pytest.approx(run.time)
    assert arrays["speed"] == pytest.approx(run.speed.to_numpy() * 60, abs=1e-4)
    assert arrays["storage"] == pytest.approx(run.storage.to_numpy(), abs=0.01)
    bare = st.simulate(points.case, st.Contingency("7-8@0.4", clear="21cyc"))
    assert head["runs"]["bare."]["stable"] == bare.outcome.stable
    assert head["cleared"] == pytest.approx(1 + 21 / 60)
    frames = np.searchsorted(run.time, arrays["frame"].astype(float) - 1e-6)
    assert arrays["frame.voltage"] == pytest.approx(run.voltage.to_numpy()[frames], abs=1e-4)


def test_ratings_of_single_machines(points):
    state = replace(FAULT, percent=2.0, megawatts={1: 40.0})
    ratings = [s.rating for s in points.of(state).case.storage]
    assert ratings == pytest.approx([40.0, *(0.02 * m.base for m in points.case.machines[1:])])
    assert points.of(replace(FAULT, megawatts={1: 0.0})) is points.bare(FAULT)


def test_the_critical_time_is_that_of_clearing_time(points):
    told = []
    critical(points, FAULT, LOAD, told.append)
    answers = [part for part in told if "text" in part]
    assert [a["resolution"] for a in answers] == [0.125, 0.015625]
    assert answers[0]["text"] == str(st.clearing_time(points.case, "7-8@0.4"))
    assert answers[0]["cycles"] <= answers[1]["cycles"] < answers[0]["cycles"] + 0.125
    intervals = [(p["low"], p["high"]) for p in told if "low" in p and p["high"]]
    assert all(low <= high for low, high in intervals)


def test_the_delay_is_that_of_the_signals_of_the_law(points):
    """Orders begin later by the delay, to a frame, and act at once; the devices have no lag."""
    began = []
    for delay in (0.0, 6.0, 12.0):
        state = replace(FAULT, percent=5.0, signals=("storage",), delay=delay)
        _, arrays = unpacked(answers.run_answer(points, state, LOAD))
        power = np.abs(arrays["storage"]).max(axis=1)
        began.append(float(arrays["time"][np.flatnonzero(power > 0.5)[0]]))
    assert (began[1] - began[0]) * 60 == pytest.approx(6, abs=1)  # cycles
    assert (began[2] - began[1]) * 60 == pytest.approx(6, abs=0.01)


@pytest.mark.slow
def test_the_landscape_is_the_screen(cases):
    told = []
    landscape(Points(cases("wscc9")), State("7"), LOAD, told.append)
    pairs = sorted(tuple(row) for part in told for row in part.get("pairs", ()))
    whole = st.screen(cases("wscc9"))
    assert pairs == sorted((p.fault, p.trip[0], p.cycles, p.status, p.machine) for p in whole.pairs)
    assert told[-1]["remarks"][1:] == whole.remarks()[1:]


def test_modes_with_a_gain(cases):
    case = cases("two_area")
    gain = answers.gains(case)[-1]
    found, more = (answers.modes_answer(case, gain, factor) for factor in (1.0, 2.0))
    own = case.modes()
    assert found["text"] == str(own)
    swings = [m for m in found["modes"] if m[3]]
    assert [m[1] for m in swings] == pytest.approx(sorted(own.frequency_hz[own.swings()]))
    assert more["modes"] != found["modes"]
    assert sorted(i for group in found["areas"] for i in group) == [0, 1, 2, 3]
    with pytest.raises(StudyError, match=r"has no gain 'H\.H'"):
        answers.modes_answer(case, "H.H", 2.0)


def test_equal_areas_agree_with_the_phase_plane(cases):
    critical = answers.equal_area_answer(cases("two_area"), 1, 1.0)["critical"]
    for cycles, stable in ((critical - 0.1, True), (critical + 0.1, False)):
        assert answers.equal_area_answer(cases("two_area"), 1, cycles)["stable"] is stable


def test_the_theory_is_shown_in_degrees_and_hertz(cases):
    found, pair = answers.equal_area_answer(cases("two_area"), 1, 6.0), equivalent(cases("two_area"), 1)
    area, edge = pair.equal_area(6.0), separatrix(pair.omib, 121)
    assert np.deg2rad(found["marks"]) == pytest.approx([area.start, area.clearing, area.stop], rel=1e-12)
    assert np.deg2rad(found["separatrix"][0]) == pytest.approx(edge.angle, rel=1e-12)
    assert 2 * np.pi * np.array(found["separatrix"][1]) == pytest.approx(edge.speed, rel=1e-12)
    assert found["text"] == str(area)
    assert "degrees" in found["text"]


def test_equal_areas_begin_with_a_machine_that_has_them(cases):
    found = answers.equal_area_answer(cases("ieee39"), None, 6.0)
    assert found == answers.equal_area_answer(cases("ieee39"), found["machine"], 6.0)
    assert found["machine"] != 1
    with pytest.raises(StudyError, match="Machine 1 of ieee39 slows down against the others"):
        answers.equal_area_answer(cases("ieee39"), 1, 6.0)


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"percent": 5.0, "deadband": 50.0},
        {"percent": 1.0, "megawatts": {1: 30.0, 2: 0.0}, "delay": 6.0},
        {"percent": 5.0, "law": "feedback", "level": 95.0},
        {"percent": 5.0, "law": "idle"},
        {"percent": 0.5, "megawatts": {3: 30.0}},
        {"percent": 5.0, "store": "regc"},
    ],
)
def test_copied_lines_give_the_run_of_the_page(points, settings, capsys, monkeypatch):
    state = replace(FAULT, **settings)
    head, _ = unpacked(answers.run_answer(points, state, LOAD))
    copy = head["copy"]
    run = eval(copy["python"], {"st": st})
    assert run.outcome.message == head["runs"][""]["message"]
    if "shell" not in copy:
        assert state.level != 100 or state.law == "feedback" or state.delay
        return
    from stabctl.cli import main

    monkeypatch.setattr("sys.argv", [*shlex.split(copy["shell"]), "--json"])
    with pytest.raises(SystemExit):
        main()
    assert json.loads(capsys.readouterr().out)["message"] == head["runs"][""]["message"]


@pytest.mark.parametrize(
    "settings",
    [{}, {"law": "idle"}, {"law": "feedback", "gain": 0.3}, {"deadband": 400.0}, {"percent": 1.0}, {"compare": True}],
    ids=["bang-bang", "idle", "feedback", "deadband", "replaced", "compared"],
)
def test_the_law_acts_on_storage_of_the_case_as_in_the_commands(cases, stabctl, tmp_path, settings):
    """Until the page gives devices of its own in their place; without storage there are none."""
    folder = str(tmp_path / "own")
    st.write(cases("two_area").with_storage("1=50MW,4=30MW"), folder)
    own, state = Points(st.load(folder)), replace(State("7", "7-8", clear=11), signals=("storage",), **settings)
    load = commands.Source(f"st.load({folder!r})", (folder,))
    head, arrays = unpacked(answers.run_answer(own, state, load))
    run = eval(head["copy"]["python"], {"st": st})
    assert run.outcome.message == head["runs"][""]["message"]
    drawn = run.storage.to_numpy()
    n = min(len(drawn), len(arrays["storage"])) - 1  # a run that is lost is drawn for a second more
    if not state.stored:
        assert np.abs(arrays["storage"][:, 1:3]).max() < 1e-9
        assert arrays["storage"][:n, [0, 3]] == pytest.approx(drawn[:n], abs=0.01)
        assert (np.abs(drawn).max() > 0) == (state.law != "idle")
    if "shell" in head["copy"]:
        _, said, _ = stabctl(*shlex.split(head["copy"]["shell"])[1:], "--json")
        assert json.loads(said)["message"] == run.outcome.message
    if state.compare:
        bare = st.simulate(cases("two_area"), state.contingency, 10.0)
        assert head["runs"]["bare."]["message"] == bare.outcome.message
    assert page.about(own)["storage"] == [1, 4]


def test_the_page_opens_with_the_law_of_the_commands(cases):
    """Bang-bang, that of a file, or none where controllers give the orders."""
    order = st.Controller("deviation:1", "order:1", [], [], [], [[1]])
    case = cases("two_area").with_storage("1=50MW")
    assert [Points(case, given).first.law for given in ([], [st.BangBang()], [order])] == ["bang-bang", "file", "idle"]


def test_every_model_of_storage_that_is_offered_runs(points):
    for store in page.about(points)["stores"]:
        points.of(read({"fault": "7", "percent": 1.0, "store": store}))
    with pytest.raises(StudyError, match="There is no storage model 'supercap'; choose one of ideal, regc, "):
        read({"store": "supercap"})


@pytest.mark.parametrize("law", ["", "bang-bang", "idle", "file"])
def test_files_of_controllers_act_in_every_run(cases, tmp_path, capsys, monkeypatch, law):
    """A damper of the excitation and a storage law, each from a file: the page has the run of the copied lines."""
    damper = st.Controller("deviation:1", "vs:1", [[-1.0]], [[1.0]], [[-10.0]], [[10.0]], name="damper")
    names = [str(tmp_path / "damper.toml"), str(tmp_path / "law.toml")]
    damper.save(names[0])
    save_law(st.BangBang(0.02), names[1])
    points = Points(cases("two_area"), [st.load_controller(name) for name in names])
    load = LOAD._replace(controllers=(names[0],), law=names[1])
    assert points.laws[0] == "file"
    state = replace(FAULT, percent=5.0, law=law) if law else FAULT
    head, arrays = unpacked(answers.run_answer(points, state, load))
    run = eval(head["copy"]["python"], {"st": st})
    assert run.outcome.message == head["runs"][""]["message"]
    n = len(run.time) - 1  # one that is lost is drawn for a second more
    assert arrays["speed"][:n] == pytest.approx(run.speed.to_numpy()[:n] * 60, abs=1e-4)
    alone = unpacked(answers.run_answer(Points(cases("two_area")), replace(state, law="bang-bang"), LOAD))[1]["speed"]
    n = min(len(alone), len(arrays["speed"]), 300)
    assert np.abs(alone[:n] - arrays["speed"][:n]).max() > 1e-3  # the damper acts
    from stabctl.cli import main

    monkeypatch.setattr("sys.argv", [*shlex.split(head["copy"]["shell"]), "--json"])
    with pytest.raises(SystemExit):
        main()
    assert json.loads(capsys.readouterr().out)["message"] == head["runs"][""]["message"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["two_area", "ieee39"])
def test_the_page_opens_one_cycle_beyond_the_limit_of_a_bad_fault(cases, name):
    points = Points(cases(name))
    first = answers.opening(points)
    pairs = {(p.fault, str(p.trip[0])): p.cycles for p in st.screen(points.case).pairs if p.cycles}
    assert first.clear == pairs[first.fault, first.trip] + 1
    assert pairs[first.fault, first.trip] <= sorted(pairs.values())[len(pairs) // 10]  # of the shortest tenth
    for clear, stable in ((first.clear, False), (first.clear - 1, True)):
        head, _ = unpacked(answers.run_answer(points, replace(first, clear=clear), LOAD))
        assert head["runs"][""]["stable"] == stable


@pytest.mark.parametrize("settings", [{}, {"percent": 5.0, "deadband": 50.0}])
def test_copied_lines_give_the_clearing_times_of_the_page(points, settings, stabctl):
    state, told = replace(FAULT, **settings), []
    critical(points, state, LOAD, told.append)
    copy = commands.lines(LOAD, points.case, state)
    found = next(t for t in told if "text" in t)
    assert found["copy"] == copy["critical"]
    assert eval(copy["critical"]["python"], {"st": st}).cycles == found["cycles"]
    code, out, _ = stabctl(*shlex.split(copy["critical"]["shell"])[1:], "--json")
    assert (code, json.loads(out)["cycles"]) == (0, found["cycles"])
    assert copy["screen"]["shell"].startswith("stabctl screen two_area")
    compile(copy["screen"]["python"], "line", "eval")


@pytest.mark.parametrize("factor", [1.0, 1.5])
def test_copied_lines_give_the_modes_and_areas_of_the_page(pages, factor, stabctl):
    message = {"level": 100, "gain": "pss.K", "factor": factor}
    found = json.loads(ask(pages, f"/{TOKEN}/modes", message)[1])
    least = found["text"].split("least damped: ")[1].split(" (")[0]
    assert least in str(eval(found["copy"]["python"], {"st": st}))
    code, out, _ = stabctl(*shlex.split(found["copy"]["shell"])[1:])
    assert code == 0
    assert least in " ".join(out.split())
    shown = json.loads(ask(pages, f"/{TOKEN}/theory", {"level": 95, "machine": 1, "clear": 6})[1])
    scope = {"st": st}
    exec(shown["copy"]["python"], scope)
    assert str(scope["area"]) == shown["text"]
    assert "shell" not in shown["copy"]


def test_how_the_case_was_loaded_is_in_the_lines():
    """Options of the command line come back in both lines, and Python gives the same case."""
    options = CaseOptions("two_area", settings=["pss.1.K=3"], classical=True, loads="current", motor_share=0.4)
    found = source(options)
    words = ("two_area", "--loads", "current", "--motor-share", "0.4", "--set", "pss.1.K=3", "--classical")
    python = "st.load('two_area', loads='current').with_motors(0.4).set({'pss.1.K': '3'}).classical()"
    assert found == commands.Source(python, words)
    assert eval(found.python, {"st": st}) == options.load()
    found = source(CaseOptions("two_area", device=["a.py", "b.py"]))
    assert (found.before, found.words[1:]) == (
        "st.register('a.py'); st.register('b.py'); ",
        ("--device", "a.py", "--device", "b.py"),
    )
    lines = [*commands.lines(found, st.load("two_area"), FAULT).values()]
    lines += [commands.of_modes(found, st.load("two_area"), 100, "pss.K", k) for k in (1, 2)]
    lines += [commands.of_theory(found, 100, 1, 6)]
    assert all(line["python"].startswith(found.before) for line in lines)
    found = source(CaseOptions("two_area", conventions="psse"))
    assert found == commands.Source("st.load('two_area', conventions='psse')", ("two_area", "--conventions", "psse"))


def test_only_its_own_page_gets_an_answer(pages):
    """Another token, host or origin gives nothing; every answer forbids to be used elsewhere."""
    own, at = {"origin": "http://127.0.0.1:8000", "sec-fetch-site": "same-origin"}, f"/{TOKEN}/"
    assert ask(pages, at, headers=own)[0] == 200
    assert ask(pages, at, headers={"host": "localhost:8000"})[0] == 200
    for path, headers in (
        ("/", {}),
        ("/another-token/", {}),
        (at[:-2] + "/", {}),
        (at, {"host": "evil.example:8000"}),
        (at, {"host": "127.0.0.1:8001"}),
        (at, {"origin": "http://evil.example"}),
        (at, {"origin": "null"}),
        (at, {"origin": "http://127.0.0.1:8001"}),
        (at, {"sec-fetch-site": "cross-site"}),
    ):
        assert ask(pages, path, headers=headers)[:2] == (404, b""), (path, headers)
    headers = ask(pages, at)[2]
    assert b"script-src 'self'" in headers[b"content-security-policy"]
    assert headers[b"cache-control"] == b"no-store"


def test_every_file_of_the_page_is_served(pages):
    html = ask(pages, f"/{TOKEN}/")[1].decode()
    for name in (*page.SCRIPTS, *page.SHEETS):
        status, content, _ = ask(pages, f"/{TOKEN}/{name}")
        assert status == 200
        assert f'"{name}"' in html
        assert len(content.splitlines()) <= 200
    assert ask(pages, f"/{TOKEN}/page.html")[0] == 404
    about = json.loads(ask(pages, f"/{TOKEN}/case")[1])
    assert [m[0] for m in about["machines"]] == ["1", "2", "3", "4"]


@pytest.mark.parametrize(
    ("path", "message", "status"),
    [
        ("run", [1], 400),
        ("run", {"fault": "no bus"}, 200),
        ("run", {"fault": "7", "clear": -1}, 200),
        ("run", {"fault": "7", "clear": "long"}, 200),
        ("run", {"fault": "7", "unknown": 1}, 200),
        ("run", {"fault": "7", "megawatts": {"x": 1}}, 200),
        ("run", {"fault": "7", "level": 1000}, 200),
        ("run", {"fault": "7", "delay": 0.5}, 200),
        ("theory", {"machine": "x", "clear": 1}, 400),
        ("theory", {"machine": 77, "clear": 1}, 200),
        ("modes", {"gain": "pss.H", "factor": 2}, 200),
        ("clearing", {"fault": 3}, 400),
    ],
)
def test_a_wrong_question_gives_a_sentence(pages, path, message, status):
    found, content, _ = ask(pages, f"/{TOKEN}/{path}", message)
    assert found == status
    if status == 200:
        head = unpacked(content)[0] if path == "run" else json.loads(content)
        assert head["error"].endswith(".")


def test_a_search_comes_in_parts(pages):
    status, content, _ = ask(pages, f"/{TOKEN}/clearing", {"fault": "7-8@0.4"})
    parts = [json.loads(line) for line in content.splitlines()]
    assert status == 200
    assert "low" in parts[0]
    assert parts[-1]["status"] == "found"
    _, content, _ = ask(pages, f"/{TOKEN}/clearing", {"fault": "99"})
    assert json.loads(content)["error"].startswith("There is no bus 99")


def test_a_saved_page_holds_everything_and_no_markup_of_the_case(cases):
    case = replace(cases("two_area"), title="</script><script>alert(1)</script>")
    recorded = recording(Points(case), FAULT, LOAD, {"modes": None})
    html = page.saved(recorded)
    assert "alert(1)" in html
    assert "<script>alert" not in html
    assert 'src="' not in html.split("<script>window.RECORDED")[0]
    assert recorded["runs"][0][0] == 17.0
    assert len(recorded["runs"]) == 17


def test_every_setting_has_a_kind():
    state = read({"fault": "7", "clear": 5, "megawatts": {"2": 3}, "signals": ["angle"], "compare": True})
    assert (state.clear, state.megawatts, state.signals, state.compare) == (5.0, {2: 3.0}, ("angle",), True)


@pytest.mark.parametrize(
    ("given", "says"), [({"required": -3}, "cannot be negative"), ({"level": 0}, "load level must be above 0")]
)
def test_what_a_setting_cannot_be(given, says):
    with pytest.raises(StudyError, match=says):
        read(given)
