"""Using the page of `stabctl live`: address, undo, pin, files, keyboard, touch, what is required; and for everybody."""

import csv
import io
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import axe_playwright_python
import pytest
from live_page import START, tab, until

import stabctl as st

pytestmark = pytest.mark.slow
AXE = (Path(axe_playwright_python.__file__).parent / "axe.min.js").read_text(encoding="utf-8")
VIEWS = "time", "modes", "landscape", "theory"


def change(page, **settings):
    page.evaluate("settings => change(settings)", settings)
    until(page, "!running.busy && !running.waiting")


def kept(page):
    """Wait until the address has the state."""
    until(page, "location.hash === address.written()")


def test_the_address_is_the_state(page, chromium):
    """Loaded again and opened elsewhere, it gives the same state, view and verdict."""
    given = {"fault": "7-8@0.25", "clear": 9.5, "percent": 5, "megawatts": {"2": 40}, "law": "feedback", "gain": 0.2}
    change(page, **given, delay=3, level=95, signals=["speed", "storage"], compare=True, required=8)
    page.click("#tab-theory")
    kept(page)
    state, said = page.evaluate("live.state"), page.locator("#verdict").inner_text()
    page.reload()
    until(page, "typeof live === 'object' && !!live.run && !running.busy")
    other = tab(chromium, page.url)
    until(other, "!running.busy")
    for one in (page, other):
        assert one.evaluate("live.state") == state
        assert one.evaluate("live.view") == "theory"
        assert one.locator("#verdict").inner_text() == said
    other.context.close()


def test_an_address_that_was_edited_does_no_harm(chromium, address):
    wrong = "clear=-5&percent=1e9&law=magic&signals=x,speed&megawatts=99:5,1:-3,2:7&level=x&view=none&compare=1&zz=1"
    page = tab(chromium, f"{address}#fault=7-8%400.5&trip=&{wrong}")
    state = page.evaluate("live.state")
    assert (state["clear"], state["percent"], state["law"], state["signals"]) == (0, 20, "bang-bang", ["speed"])
    assert (state["megawatts"], state["level"], state["compare"]) == ({"2": 7}, 100, False)
    assert page.evaluate("live.view") == "time"
    assert page.locator("#verdict").get_attribute("class") in ("good", "bad")
    page.evaluate("location.hash = '#fault=<b>x</b>'")
    until(page, "document.getElementById('verdict').className === 'wrong'")
    assert page.locator("#verdict b").count() == 0
    assert page.logged == []
    page.context.close()


def test_back_undoes_a_change(page):
    for clear in (8, 12):
        change(page, clear=clear)
        kept(page)
    change(page, fault="9")
    kept(page)
    for clear, fault in ((12, "7-8@0.5"), (8, "7-8@0.5"), (6, "7-8@0.5")):
        page.go_back()
        until(page, f"live.state.clear === {clear} && live.state.fault === '{fault}' && !running.busy")
        assert page.evaluate("live.run.head.cleared") == pytest.approx(1 + clear / 60)
    page.go_forward()
    until(page, "live.state.clear === 8")


def test_a_pinned_run_stays_beside_the_next(page):
    said = page.locator("#verdict").inner_text()
    page.click("#pin")
    change(page, clear=12, percent=5)
    text = page.locator("#pinned").inner_text()
    assert text.startswith("Pinned, dashed: 6 cycles, 0 % storage; now 12 cycles, 5 % storage, bang-bang")
    assert text.endswith(f"It said: {said}")
    assert page.evaluate("time.charts[0].plot.data.length") == 1 + 2 * 4
    ghost = "time.charts[0].plot.data[5].filter(v => v !== undefined && v !== null)"
    pinned = page.evaluate(f"[Math.max(...{ghost}), Math.max(...time.pinned.arrays.speed[0])]")
    assert pinned[0] == pinned[1]
    page.click("#pin")
    assert page.locator("#pinned").inner_text() == ""
    assert page.evaluate("time.charts[0].plot.data.length") == 1 + 4


def test_a_chart_is_saved_as_numbers_drawing_and_picture(page, tmp_path):
    change(page, clear=9)
    files = {}
    for kind in ("CSV", "SVG", "PNG"):
        with page.expect_download() as found:
            page.locator(".tools button", has_text=kind).first.click()
        files[kind] = tmp_path / found.value.suggested_filename
        found.value.save_as(files[kind])
    assert [f.name for f in files.values()] == ["two_area_speed.csv", "two_area_speed.svg", "two_area_speed.png"]
    head, *rows = csv.reader(io.StringIO(files["CSV"].read_text()))
    run = st.load("two_area").simulate(st.Contingency("7-8@0.5", clear="9cyc"), 10.0)
    assert head == ["time (s)", *(f"speed (Hz) {m}" for m in (1, 2, 3, 4))]
    assert len(rows) == len(run.time)
    for row, speeds in zip(rows, 60 * run.arrays.speed, strict=True):
        assert [float(v) for v in row[1:]] == pytest.approx(speeds, abs=1e-4)
    drawing = ET.parse(files["SVG"]).getroot()
    curves = [e for e in drawing.iter() if e.tag.endswith("path") and len(e.get("d", "")) > 5000]
    assert len(curves) == 4
    assert {"time (s)", "speed (Hz)"} <= {e.text for e in drawing.iter() if e.tag.endswith("text")}
    assert files["PNG"].read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_a_run_is_drawn_for_a_second_after_synchronism_is_lost(page):
    change(page, fault="7", clear=20)
    lost = st.load("two_area").simulate(st.Contingency("7", clear="20cyc"), 10.0)
    assert not lost.outcome.stable
    assert page.locator("#verdict").inner_text() == lost.outcome.message
    assert page.evaluate("live.run.arrays.time.at(-1)") == pytest.approx(lost.outcome.time_s + 1, abs=0.01)
    assert page.evaluate("time.charts[0].plot.scales.x.max") == pytest.approx(lost.outcome.time_s + 1, abs=0.01)


def test_ratings_of_single_machines_stay(page):
    change(page, megawatts={"2": 40})
    change(page, percent=5)
    assert page.evaluate("live.state.megawatts") == {"2": 40}
    assert page.locator("#note-own button").inner_text() == "2: 40 MW ×"
    page.click("#note-own button")
    assert page.evaluate("live.state.megawatts") == {}


def test_a_required_clearing_time(page):
    change(page, fault="7", required=5)
    until(page, "critical.answer?.resolution < 0.1")
    assert page.locator("#note-required").inner_text() == "met by this fault"
    change(page, required=30)
    assert page.locator("#note-required").inner_text().startswith("missed by this fault: 13.")
    change(page, required=16)
    page.click("#tab-landscape")
    until(page, "landscape.done", 60)
    short = [p for p in st.screen(st.load("two_area")).pairs if p.cycles is not None and p.cycles < 16]
    assert page.locator("tr.short").count() == len(short) > 0
    assert page.locator("#landscape-required").inner_text() == (
        f"{len(short)} of 4 pairs are shorter than the 16 cycles required."
    )


def test_everything_works_with_the_keyboard(page):
    """Fault by typing, sliders by arrows, views, rows and modes as buttons; the mouse is not used."""
    page.focus("#fault")
    page.keyboard.press("Control+A")
    page.keyboard.type("9")
    page.keyboard.press("Enter")
    until(page, "live.state.fault === '9'")
    page.focus("#clear")
    page.keyboard.press("ArrowRight")
    assert page.evaluate("live.state.clear") == 6.125
    for text, fault in (("8-9@0.3", "8-9@0.3"), ("7-8", "7-8@0.5")):
        page.fill("#fault", text)
        page.keyboard.press("Enter")
        assert page.evaluate("live.state.fault") == fault
    for wrong in ("77", "7-9", "8-9@2", "<b>"):
        page.fill("#fault", wrong)
        page.keyboard.press("Enter")
        assert page.evaluate("live.state.fault") == "7-8@0.5"
        assert f"There is no bus or line {wrong}" in page.locator("#verdict").inner_text()
    answers = page.evaluate("live.answers")
    page.evaluate("change({ clear: 7 }); controls.search('77')")
    until(page, f"live.answers > {answers}")
    assert "There is no bus or line 77" in page.locator("#verdict").inner_text(), "the answer came later"
    page.focus("#tab-modes")
    page.keyboard.press("Enter")
    until(page, "!!modes.found")
    rows = page.locator("#modes button.row")
    rows.nth(1).focus()
    page.keyboard.press("Enter")
    assert page.locator("#modes button.row[aria-pressed=true]").inner_text() == rows.nth(1).inner_text()
    page.focus("#tab-landscape")
    page.keyboard.press("Enter")
    until(page, "landscape.done", 60)
    page.locator("#landscape-list button.row").first.focus()
    page.keyboard.press("Enter")
    assert page.evaluate("[live.state.fault, live.state.trip]") == page.evaluate("landscape.sorted()[0].slice(0, 2)")


def test_fingers_on_a_phone(chromium, address):
    """One finger scrolls the page, two enlarge the diagram, a tap places the fault; the chart stays in sight."""
    context = chromium.new_context(viewport={"width": 390, "height": 780}, has_touch=True, is_mobile=True)
    page = context.new_page()
    page.goto(address + START)
    until(page, "typeof live === 'object' && !!live.run")
    assert page.evaluate("getComputedStyle(document.getElementById('diagram')).touchAction") == "pan-y"
    session = context.new_cdp_session(page)
    box = page.locator("#diagram").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def touch(kind, *points):
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": a, "y": b} for a, b in points]})

    before = page.evaluate("diagram.view.scale")
    touch("touchStart", (x - 30, y), (x + 30, y))
    for d in (40, 55, 70, 90):
        touch("touchMove", (x - d, y), (x + d, y))
    touch("touchEnd")
    assert page.evaluate("diagram.view.scale") == pytest.approx(before * 90 / 40, rel=0.4)
    page.click("#whole")
    px, py = page.evaluate("diagram.at(live.case.diagram.buses[live.case.buses.findIndex(b => b[0] === 9)])")
    page.touchscreen.tap(box["x"] + px, box["y"] + py)
    until(page, "live.state.fault === '9'")
    page.locator("#box-level").scroll_into_view_if_needed()
    page.evaluate("document.getElementById('box-level').scrollIntoView({block: 'end'})")
    chart = page.locator("#charts").bounding_box()
    assert chart["y"] >= -1
    assert chart["y"] + chart["height"] < page.locator("#box-level").bounding_box()["y"]
    context.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_is_accessible(chromium, address, scheme):
    """No finding of axe-core that is serious or critical, in any view, with results that are stale, too."""
    context = chromium.new_context(viewport={"width": 1280, "height": 900}, color_scheme=scheme, bypass_csp=True)
    page = context.new_page()
    page.goto(address + START)
    until(page, "typeof live === 'object' && !!live.run")
    page.evaluate(AXE)
    found = {}
    for settings in ({"percent": 5, "law": "feedback", "fault": "7", "required": 9}, {"percent": 0}):
        change(page, **settings)
        for view in VIEWS:
            page.click(f"#tab-{view}")
            until(
                page,
                {"landscape": "landscape.done", "modes": "!!modes.found", "theory": "!!theory.found"}.get(view, "true"),
                60,
            )
            wrong = page.evaluate("axe.run(document)")["violations"]
            found |= {(view, v["id"]): v["nodes"][0]["html"] for v in wrong if v["impact"] in ("serious", "critical")}
    assert found == {}
    context.close()


def test_colors_of_clearing_times_are_monotone_in_lightness():
    from stabctl.view.figures.palette import clearing_colors

    def lightness(color):
        r, g, b = ((c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4) for c in color[:3])
        return 0.2126 * r + 0.7152 * g + 0.0722 * b

    found = [lightness(clearing_colors()(k / 64)) for k in range(65)]
    assert found == sorted(found)
    assert found[0] < 0.05 < 0.5 < found[-1] < 0.7


def test_progress_until_the_address_is_printed():
    from stabctl.view.live.serve import PARTS, warm
    from stabctl.view.live.state import Points

    told = []
    warm(Points(st.load("two_area")), lambda done, what: told.append((done, what)))
    assert [done for done, _ in told] == list(range(PARTS))
    assert all(re.fullmatch(r"[a-z ]+", what) for _, what in told)
