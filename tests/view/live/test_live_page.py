"""The page of `stabctl live` in a real browser."""

import re
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from live_page import START, served, tab, until

import stabctl as st

pytestmark = pytest.mark.slow
FINE = 0.125  # cycles between the stops of the slider
IMPORTED = Path(__file__).parents[2] / "reference" / "import" / "matpower"


def move(page, slider, value):
    act = f"e => {{ e.value = {value}; e.dispatchEvent(new Event('input')) }}"
    page.evaluate(f"({act})(document.getElementById('{slider}'))")


def settled(page):
    until(page, "!running.busy && !running.waiting")


def click_on(page, place):
    """Click on a place of the diagram, in its units."""
    box = page.locator("#diagram").bounding_box()
    x, y = page.evaluate(f"diagram.at({place})")
    page.mouse.click(box["x"] + x, box["y"] + y)


def test_the_verdict_flips_at_the_critical_clearing_time(page):
    """Click a line, drag the slider: stable at the answer of `clearing_time`, unstable one stop beyond."""
    row = page.evaluate("live.case.branches.findIndex(b => b[0] === '7-8')")
    ends = page.evaluate(f"live.case.diagram.ends[{row}]")
    click_on(page, [a + 0.4 * (b - a) for a, b in zip(*ends, strict=True)])
    fault = page.evaluate("live.state.fault")
    assert re.fullmatch(r"7-8@0\.(39|40|41)", fault)
    found = st.clearing_time(st.load("two_area"), fault).cycles
    for cycles, kind in ((found, "good"), (found + FINE, "bad"), (found - FINE, "good")):
        move(page, "clear", cycles)
        settled(page)
        assert page.locator("#verdict").get_attribute("class") == kind, cycles
    until(page, "critical.answer && critical.answer.resolution < 0.1")
    assert found <= page.evaluate("critical.answer.cycles") < found + FINE
    assert "leaves first" in page.locator("#note-clear").inner_text()
    assert page.locator("#mark-clear").is_visible()


def test_the_delay_slider_gives_the_answer_of_clearing_time(page):
    """Storage of 5 % whose law acts on signals that are 0, 15 and 30 cycles old: each critical time, and the flip."""
    page.evaluate("controls.fault('7-8@0.4')")
    move(page, "percent", 5)
    point, times = st.load("two_area").with_storage("5%mva").initialize(), []
    for delay in (0, 15, 30):
        move(page, "delay", delay)
        settled(page)
        law = st.BangBang(0.1).sampled(60, delay / 60) if delay else st.BangBang(0.1)
        times.append(st.clearing_time(point, "7-8@0.4", control=law).cycles)
        for cycles, kind in ((times[-1], "good"), (times[-1] + FINE, "bad")):
            move(page, "clear", cycles)
            settled(page)
            assert page.locator("#verdict").get_attribute("class") == kind, (delay, cycles)
        until(page, "critical.answer && critical.answer.resolution < 0.1", 60)
        assert times[-1] <= page.evaluate("critical.answer.cycles") < times[-1] + FINE
    assert len(set(times)) == 3  # 25.5, 23.375, 22
    assert page.locator("#value-delay").inner_text() == "30 cycles, 500 ms"


def test_a_click_on_a_bus_places_the_fault_and_offers_its_lines(page):
    bus = page.evaluate("live.case.buses.findIndex(b => b[0] === 9)")
    click_on(page, page.evaluate(f"live.case.diagram.buses[{bus}]"))
    assert page.evaluate("live.state.fault") == "9"
    assert "9-10" in page.locator("#trip option").all_inner_texts()
    page.select_option("#trip", "9-10")
    settled(page)
    assert page.evaluate("live.run.head.opened") == ["9-10"]


def test_hovering_says_what_is_there(page):
    box = page.locator("#diagram").bounding_box()
    x, y = page.evaluate("diagram.at(live.case.diagram.machines[2])")
    page.mouse.move(box["x"] + x, box["y"] + y)
    assert page.locator("#hover").inner_text().startswith("machine 3, 900 MVA")


def test_tabs_are_independent(chromium, address):
    first, second = (tab(chromium, address + START) for _ in range(2))
    before = second.evaluate("[live.state.clear, live.answers]")
    move(first, "clear", 20)
    settled(first)
    assert first.evaluate("live.run.head.cleared") == pytest.approx(1 + 20 / 60)
    assert second.evaluate("[live.state.clear, live.answers]") == before
    for one in (first, second):
        one.context.close()


def test_fast_moves_leave_no_queue(page):
    """Of 200 moves within a second few are simulated, the last one is; memory does not grow."""
    settled(page)
    drag = """async (n) => { for (let i = 0; i < n; i++) {
        const e = document.getElementById('clear'); e.value = 2 + (i % 80) / 8; e.dispatchEvent(new Event('input'));
        await new Promise(r => setTimeout(r, 5)); }
        const e = document.getElementById('clear'); e.value = 7.25; e.dispatchEvent(new Event('input'));
        return performance.now() }"""
    session = page.context.new_cdp_session(page)
    sizes = []
    for _ in range(3):
        before = page.evaluate("live.answers")
        page.evaluate(f"({drag})(200)")
        until(page, "!running.busy && !running.waiting", 5)
        assert page.evaluate("live.run.head.cleared") == pytest.approx(1 + 7.25 / 60)
        assert page.evaluate("live.answers") - before < 190
        session.send("HeapProfiler.collectGarbage")
        sizes.append(page.evaluate("performance.memory.usedJSHeapSize"))
    assert sizes[-1] < 1.3 * sizes[0] + 2e6


def test_storage_beside_no_storage(page):
    move(page, "percent", 5)
    page.click("#compare")
    page.click("#signal-storage")
    settled(page)
    until(page, "document.querySelectorAll('.chart').length === 4 || time.charts.length >= 3")
    assert "Without storage:" in page.locator("#verdict").inner_text()
    assert page.evaluate("live.run.arrays.storage.length") == 4


def test_it_says_whose_storage_there_is(chromium, tmp_path):
    """The law acts on devices of the case until ratings on the sliders replace them."""
    st.write(st.load("two_area").with_storage("1=50MW,4=30MW"), tmp_path / "own")
    with served(str(tmp_path / "own")) as address, tab(chromium, address + START) as page:
        settled(page)
        note = page.locator("#note-percent")
        assert note.inner_text() == "storage is the case's own 2 devices"
        assert page.locator("#law").is_visible()
        assert page.locator("#deadband").is_visible()
        assert not page.locator("#store").is_visible()
        assert page.evaluate("inWords(settings())").startswith("the case's own storage, bang-bang")
        page.click("#signal-storage")
        settled(page)
        assert page.evaluate("live.run.arrays.storage.length") == 4
        move(page, "percent", 2)
        settled(page)
        assert note.inner_text() == "in place of the case's own 2 devices"
        assert page.locator("#store").is_visible()


def test_every_view_shows_something(page):
    page.click("#tab-modes")
    until(page, "!!modes.found")
    before = page.evaluate("modes.found.modes.map(m => m[0])")
    move(page, "gain-factor", 2)
    until(page, "modes.factor === 2")
    assert page.evaluate("modes.found.modes.map(m => m[0])") != before
    assert page.evaluate("modes.trail.length") >= 2
    page.click("#tab-landscape")
    until(page, "landscape.done", 60)
    assert page.evaluate("landscape.pairs.length") == len(st.screen(st.load("two_area")).pairs)
    page.click("#tab-theory")
    until(page, "!!theory.found")
    assert "A1 =" in page.locator("#theory-text").inner_text()
    page.click("#tab-time")
    page.click("#play")
    until(page, "diagram.angle !== null && document.getElementById('clock').textContent > '0.5'")
    page.click("#play")


SETTINGS = "percent: 5", "law: 'idle', percent: 5", "level: 90", "percent: 5, deadband: 50", "megawatts: {1: 40}"


def test_clearing_times_say_for_which_settings_they_hold(page):
    """After each change the view is gray, names its own settings and copies them; screened again, it is not."""
    page.click("#tab-landscape")
    until(page, "landscape.done", 60)
    before = page.evaluate("live.state")
    line = page.evaluate("lines().python")
    for settings in SETTINGS:
        page.evaluate(f"change({{{settings}}})")
        settled(page)
        assert page.locator("#landscape-for").inner_text() == (
            "These are the clearing times for 0 % storage, load level 100 %; screen again."
        )
        assert page.evaluate("landscape.list.classList.contains('stale')")
        assert page.evaluate("lines().python") == line == "st.load('two_area').screen()"
        page.evaluate("before => change(before)", before)
        settled(page)
        assert page.locator("#landscape-for").inner_text() == ""
        assert not page.evaluate("landscape.list.classList.contains('stale')")
    page.evaluate("change({percent: 5})")
    page.click("#screen")
    until(page, "landscape.done", 60)
    assert page.locator("#landscape-for").inner_text() == ""
    assert "5%mva" in page.evaluate("lines().python")
    page.evaluate("change({clear: 12, fault: '9'})")  # of which a screen does not depend
    assert page.locator("#landscape-for").inner_text() == ""


def test_a_run_that_fails_leaves_nothing_of_the_one_before(page):
    page.evaluate("change({level: 130})")
    settled(page)
    assert "cannot be initialized" in page.locator("#verdict").inner_text()
    assert page.locator(".chart").count() == 0
    for button in ("python", "shell", "save"):
        assert page.locator(f"#{button}").is_disabled()
    page.click("#tab-modes")
    until(page, "!modes.asking.busy")
    assert "cannot be initialized" in page.locator("#modes-text").inner_text()
    page.evaluate("change({level: 100, percent: 5})")
    until(page, "!!modes.found")
    assert "Storage, its law and controllers are left out" in page.locator("#modes-left-out").inner_text()
    page.click("#tab-time")
    settled(page)
    assert page.locator(".chart").count() == 1
    assert page.locator("#python").is_enabled()


def test_the_clock_ends_where_the_run_ended(page):
    move(page, "clear", 30)
    settled(page)
    end = page.evaluate("live.run.arrays.frame.at(-1)")
    assert end < 5
    page.evaluate("diagram.show(9)")
    assert page.locator("#clock").inner_text() == f"{end:.2f} s, end of the run"


def test_theory_says_for_which_fault_it_holds(page):
    page.click("#tab-theory")
    until(page, "!!theory.found")
    page.evaluate("change({clear: 4, level: 95})")
    until(page, "!theory.asking.busy && theory.found.clear === 4")
    said = page.locator("#theory-text").inner_text()
    assert said.startswith("Three-phase fault at the terminal of machine 1, cleared after 4 cycles, load level 95 %.")


def test_a_saved_page_keeps_the_settings_of_its_results(page, chromium, tmp_path):
    """Screened without storage, saved with 5 %: the saved page says so."""
    page.click("#tab-landscape")
    until(page, "landscape.done", 60)
    page.evaluate("change({percent: 5})")
    settled(page)
    with page.expect_download() as found:
        page.click("#save")
    found.value.save_as(tmp_path / "saved.html")
    saved = chromium.new_context(offline=True).new_page()
    saved.goto((tmp_path / "saved.html").as_uri())
    until(saved, "!!live.run")
    saved.click("#tab-landscape")
    assert saved.locator("#landscape-for").inner_text() == (
        "These are the clearing times for 0 % storage, load level 100 %."
    )
    assert saved.evaluate("lines().python") == "st.load('two_area').screen()"
    assert "simulations" in saved.locator("#landscape-text").inner_text()
    saved.context.close()


def test_a_saved_page_works_offline(page, chromium, tmp_path):
    page.click("#tab-theory")
    until(page, "!!theory.found")
    with page.expect_download() as found:
        page.click("#save")
    found.value.save_as(tmp_path / "saved.html")
    context = chromium.new_context(offline=True)
    saved, logged = context.new_page(), []
    saved.logged = logged
    saved.on("console", lambda message: logged.append(message.text))
    saved.on("request", lambda request: request.url.startswith(("file:", "data:")) or logged.append(request.url))
    saved.goto((tmp_path / "saved.html").as_uri())
    until(saved, "!!live.run")
    move(saved, "clear", 8)
    assert saved.evaluate("live.run.head.cleared") == pytest.approx(1 + 8 / 60)
    assert saved.locator("#verdict").inner_text()
    assert logged == []
    context.close()


def test_names_of_a_case_are_text(chromium, tmp_path):
    bad = "<script>document.title='x'</script><img src=x onerror=alert(1)>"
    case = st.load("two_area")
    named = tuple(b._replace(name=f"{bad}{b.bus}"[:60]) for b in case.buses)
    machines = tuple(m._replace(name=f"<b>{m.machine}</b>/1") for m in case.machines)
    st.write(replace(case, buses=named, machines=machines, title=bad), tmp_path / "own")
    with served(str(tmp_path / "own")) as address:
        page = tab(chromium, address)
        page.evaluate("document.getElementById('hover').textContent = diagram.said({bus: 0})")
        assert "<script>" in page.locator("#hover").inner_text()
        page.click("#tab-theory")
        assert "<b>1</b>" in page.locator("#theory-machine").inner_text()
        assert page.evaluate("document.querySelectorAll('img, b').length") == 0
        assert page.logged == []
        page.context.close()


def test_another_origin_gets_nothing(chromium, address, tmp_path):
    """A page from elsewhere can neither read nor frame it, and without the token there is nothing."""
    (tmp_path / "evil.html").write_text("<!doctype html><title>evil</title><iframe id=f></iframe>")
    page = chromium.new_context().new_page()
    page.goto((tmp_path / "evil.html").as_uri())
    read = page.evaluate(f"fetch('{address}case').then(a => a.text()).catch(() => 'refused')")
    assert read == "refused"
    root = re.match(r"http://[^/]+/", address)[0]
    for wrong in (Request(root), Request(address, headers={"Host": "evil.example"})):
        with pytest.raises(HTTPError, match="404") as refused:
            urlopen(wrong)
        assert refused.value.read() == b""
    page.context.close()


def test_a_system_of_two_thousand_buses(chromium):
    """The diagram, a move of the slider, a click on a line, its critical clearing time, play-back, other views."""
    with served(str(IMPORTED / "case_ACTIVSg2000.m"), "--machines", "typical") as address:
        page = tab(chromium, address)
        assert page.evaluate("live.case.diagram.buses.length") == 2000
        move(page, "clear", 8)
        until(page, "live.run.head.cleared > 1.13")
        box = page.locator("#diagram").bounding_box()
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        page.mouse.wheel(0, -800)
        until(page, "diagram.labels.length > 500")
        middle = """live.case.diagram.ends.map(([p, q]) => [0, 1].map(i => (p[i] + q[i]) / 2))
            .findIndex((m, k) => { const [x, y] = diagram.at(m), c = document.getElementById('diagram');
                return x > 20 && y > 20 && x < c.clientWidth - 20 && y < c.clientHeight - 20
                    && live.case.lines.includes(live.case.branches[k][0]) && diagram.nearest(x, y)?.row === k; })"""
        row = page.evaluate(middle)
        (a, b), (c, d) = page.evaluate(f"live.case.diagram.ends[{row}]")
        click_on(page, [(a + c) / 2, (b + d) / 2])
        assert page.evaluate("live.state.fault").startswith(page.evaluate(f"live.case.branches[{row}][0]") + "@0.")
        settled(page)
        until(page, "!!critical.answer", 200)
        assert re.search("critical: .* leaves first|stable up to 60", page.locator("#note-clear").inner_text())
        page.click("#play")
        until(page, "diagram.angle !== null && document.getElementById('clock').textContent > '0.5'")
        page.click("#play")
        page.click("#tab-theory")
        until(page, "!!theory.found")
        page.click("#tab-landscape")  # hours: offered, not started
        assert "minutes here" in page.locator("#landscape-text").inner_text()
        assert page.locator("#screen-stop").is_hidden()
        assert page.logged == []
        page.context.close()


@pytest.mark.parametrize("width", [390, 1280, 2560])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_nothing_is_cut_or_overlaps(chromium, address, width, scheme):
    page = tab(chromium, address + START, width, 900, scheme)
    for view in ("time", "modes", "landscape", "theory"):
        page.click(f"#tab-{view}")
        page.wait_for_timeout(300)
        assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0, view
        boxes = page.evaluate("""[...document.querySelectorAll('button, select, input, output')]
            .filter(e => e.offsetParent)
            .map(e => [e.id, ...Object.values(e.getBoundingClientRect().toJSON())])""")
        for k, (name, x, y, w, h, *_) in enumerate(boxes):
            for other, u, v, p, q, *_ in boxes[:k]:
                apart = x >= u + p - 1 or u >= x + w - 1 or y >= v + q - 1 or v >= y + h - 1
                assert apart, (view, name, other)
    assert page.logged == []
    page.context.close()


def test_ctrl_c_ends_it():
    command = [sys.executable, "-m", "stabctl", "live", "two_area", "--no-browser"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert server.stdout.readline().startswith("http://127.0.0.1:")
    server.send_signal(signal.SIGINT)
    out, err = server.communicate(timeout=20)
    assert (err, server.returncode) == ("", 0)
