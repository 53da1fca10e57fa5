"""The page of the modes: in a browser, and every number on it read back."""

import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest

from stabctl.dynamics import operating_point
from stabctl.smallsignal import analyze, areas, linearize
from stabctl.view.pages import modes_page


@pytest.mark.slow
def test_in_a_browser(points, tmp_path, browse):
    modes = analyze(linearize(points("two_area")))
    page = modes_page.write(tmp_path, modes, areas(modes), (0.1, 2.5))
    for dark in (False, True):
        found = browse(page, 390, dark)
        assert found["title"] == "Modes of two_area"
        assert found["scroll"] == found["width"] <= 390
        wrong = "beyond", "overlapping", "broken", "dead", "fetched", "console"
        assert {key: found[key] for key in wrong} == {key: [] for key in wrong}


def test_text_of_a_case_is_text_on_the_page(points):
    case = replace(points("two_area").case, title="<script>alert(1)</script>", source="A & B")
    page = modes_page.page(analyze(linearize(operating_point.solve(case))), None, (0.1, 2.5)).html()
    assert page.count("<script") == 1
    assert "&lt;script&gt;" in page
    assert "Data: A &amp; B" in page


def test_no_name_of_a_case_leads_out_of_the_folder(points, tmp_path):
    case = replace(points("two_area").case, name="../../x")
    modes = analyze(linearize(operating_point.solve(case)))
    path = modes_page.write(tmp_path / "reports", modes, None, (0.1, 2.5))
    assert path == tmp_path / "reports" / "x_modes.html"
    assert [p.name for p in tmp_path.iterdir()] == ["reports"]


def test_the_page_says_what_the_modes_are(points):
    """Frequencies in Hz, damping ratios in percent, eigenvalues, participation in percent of the sum."""
    modes = analyze(linearize(points("two_area")))
    page = modes_page.page(modes, areas(modes), (0.1, 2.5)).html()
    table = re.search(r"<h2>Oscillatory modes from 0.1 to 2.5 Hz</h2>.*?<tbody>(.*?)</tbody>", page, re.DOTALL)[1]
    rows = [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in re.findall(r"<tr.*?</tr>", table)]
    inside = [modes.mode(k) for k in modes.within(0.1, 2.5)]
    assert len(rows) == len(inside) > 3
    for (label, hz, damping, real, imag, state), m in zip(rows, inside, strict=True):
        s = m.eigenvalue
        assert (unescape(label), unescape(state)) == (m.label, m.participation[0].state)
        assert float(hz) == pytest.approx(s.imag / 6.283185307, abs=6e-4)
        assert float(damping) == pytest.approx(-100 * s.real / abs(s), abs=6e-3)
        assert (float(real), float(imag)) == pytest.approx((s.real, s.imag), abs=6e-5)
    cards = re.findall(r'<section class="card"><h3>(?!Area)(.*?)</section>', page, re.DOTALL)
    swings = [m for m in inside if m.electromechanical]
    assert len(cards) == len(swings)
    for card, m in zip(cards, swings, strict=True):
        hz, damping = map(float, re.search(r"([\d.]+) Hz, damping ratio (-?[\d.]+) %", card).groups())
        assert (hz, damping) == pytest.approx((m.frequency_hz, 100 * m.damping_ratio), abs=6e-3)
        bars = re.findall(r'width:([\d.]+)%"></i><b>([\d.]+)<', card)
        shares = [p.share for p in m.participation[:5]]
        assert [float(percent) for _, percent in bars] == pytest.approx([100 * p for p in shares], abs=0.06)
        assert [float(width) for width, _ in bars] == pytest.approx([100 * p / shares[0] for p in shares], abs=0.06)
        assert shares[0] == max(p.share for p in m.participation)


@pytest.mark.parametrize(("real", "kind"), [(1e-3, "unstable"), (-1e-3, "swing")])
def test_an_unstable_mode_is_marked(points, real, kind):
    modes = analyze(linearize(points("two_area")))
    swing = modes.swings()[0]
    shifted = modes.eigenvalues.copy()
    shifted[swing] = complex(real, shifted[swing].imag)
    page = modes_page.page(replace(modes, eigenvalues=shifted), None, (0.1, 2.5)).html()
    row = next(row for row in re.findall(r"<tr.*?</tr>", page) if f">{real:.4f}<" in row)
    assert row.startswith(f'<tr class="{kind}">')


@pytest.mark.parametrize(("K", "band"), [(1.0, (0.1, 2.5)), (1.0, (0.8, 2.5)), (10.0, (0.1, 2.5)), (10.0, (0.1, 6.0))])
def test_headline_cards_table_and_figure_agree_on_the_least_damped_mode(cases, K, band):
    """Also where it is a mode of the stabilizers, or lies outside the band."""
    case = cases("two_area")
    found = case.set({f"pss.{m}.K": K * p.K for m, p in case.devices["pss"].items()}).modes()
    moving = np.flatnonzero(found.eigenvalues.imag > 0)
    least = found.mode(int(moving[found.damping_ratio[moving].argmin()]))
    assert least.electromechanical == (K == 1)
    page = unescape(modes_page.page(found, None, band).html())
    said = f"{least.frequency_hz:.3f} Hz, damping ratio {least.damping_ratio:.4f} ({least.label})"
    assert f"least damped: {said}" in str(found)
    assert f"least damped: {said}" in page
    assert re.search(r'<section class="card"><h3>(.*?)</h3>', page)[1] == least.label  # the first card
    assert least.label in page[page.index("<h2>Oscillatory modes") :]
    assert f"{least.label}: {least.frequency_hz:.3f} Hz, damping ratio {100 * least.damping_ratio:.2f} %" in page  # dot
