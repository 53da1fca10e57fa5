"""Reference numbers beside ours: none has moved, and one that moves is told."""

import json
import math
from collections import Counter
from functools import partial
from hashlib import sha256
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import numpy as np
import pytest

import stabctl as st
from stabctl.verification import compare, verify
from stabctl.verification.compare import PAIRS, UNITS, published
from stabctl.verification.systems import File, System, folder_of, present, systems

HERE = [name for name, system in systems().items() if not system.files]
QUICK = "kundur_ex12_2_damped"


def test_every_number_has_a_system_a_known_quantity_and_a_tolerance():
    rows = published()
    assert {row.system for row in rows} == {name for name, system in systems().items() if not system.run}
    for row in rows:
        assert row.quantity in UNITS
        assert math.isnan(row.second) == (row.quantity not in PAIRS)
        limit = systems()[row.system].tolerance.get(row.quantity, row.tolerance)
        assert limit > 0
        assert row.reason or math.isnan(row.tolerance)  # an exception says why
    assert not [key for key, n in Counter(row[:5] for row in rows if row.quantity not in PAIRS).items() if n > 1]


def test_there_are_a_thousand_numbers_of_systems_that_come_with_the_program():
    rows = [row for row in published() if row.system in HERE]
    assert sum(2 if row.quantity == "mode" or row.second > 0 else 1 for row in rows) > 1000  # 1109
    assert len(HERE) >= 25  # 26


def test_fifty_clearing_times_of_other_programs_within_an_eighth_of_a_cycle():
    rows = [row for row in published() if row.quantity == "clearing time" and row.system.startswith("clearing_")]
    assert len(rows) >= 50  # 54
    for name in {row.system for row in rows}:
        assert systems()[name].tolerance["clearing time"] < 1 / 8 / 60 + 1e-5
    (row,) = [row for row in rows if row[:3] == ("clearing_wscc9_andes", "clearing time", "7 trip 5-7")]
    (found,) = compare.compare(systems()[row.system], folder_of(None), [row])
    assert found.difference < 0.0005  # s   0.177 s in both
    (moved,) = compare.compare(systems()[row.system], folder_of(None), [row._replace(value=row.value + 0.003)])
    assert not moved.within


@pytest.mark.slow
@pytest.mark.parametrize("name", systems())
def test_no_number_has_moved(name):
    if not present(systems()[name], folder_of(None)):
        pytest.skip("its files have not been downloaded: stabctl verify --download")
    found = verify(name)
    assert found.rows
    assert [(row.object, row.published, row.ours) for row in found.outside] == []


def test_a_number_that_moves_is_outside_and_ends_with_1(monkeypatch, stabctl):
    assert not verify(QUICK).outside
    moved = [row._replace(value=row.value + 0.01) if row.system == QUICK else row for row in published()]
    monkeypatch.setattr(compare, "published", lambda: tuple(moved))
    found = verify(QUICK)
    assert len(found.outside) == 1
    assert "1 beyond their tolerance" in str(found)
    code, out, _ = stabctl("verify", QUICK)
    assert code == 1
    assert "beyond" in out


def test_a_mode_is_an_eigenvalue_of_its_frequency_and_damping():
    row = compare.Published("x", "mode", "swing", 1.2, 0.05, math.nan, "")
    s = compare._value(row)
    assert s.imag / (2 * math.pi) == pytest.approx(1.2)
    assert -s.real / abs(s) == pytest.approx(0.05)
    same = compare.Comparison("x", "mode", "swing", s, s + 2j * math.pi * 0.01, "1/s", 0.1, "", "")
    assert same.hz_and_damping[0] == pytest.approx(0.01)
    assert same.hz_and_damping[1] == pytest.approx(0, abs=1e-3)
    assert same.numbers == 2


def test_each_of_our_eigenvalues_is_compared_once():
    row = compare.Published("x", "eigenvalue", "a", -1.0, 2.0, math.nan, "")
    ours = compare._nearest(np.array([-1 + 2j, -1 - 2j, -1.5 + 2j]), [row, row, row])
    assert sorted(map(str, ours)) == sorted(map(str, [-1 + 2j, -1.5 + 2j, complex("nan")]))
    lost = compare.Comparison("x", "eigenvalue", "a", -1 + 2j, complex("nan"), "1/s", 0.1, "", "")
    assert not lost.within


def test_a_result_is_a_table_and_a_figure(tmp_path):
    found = st.verify(QUICK)
    assert len(found.df) == len(found.rows)
    assert set(found.df["system"]) == {QUICK}
    assert found.save(tmp_path / "figure.png").stat().st_size > 5000
    assert len(found.save(tmp_path / "table.csv").read_text().splitlines()) == 1 + len(found.rows)


@pytest.mark.parametrize(("system", "says"), [(QUICK, "Hz: 1"), ("wscc9_sauer_pai", "Hz: 4 of 7, the others outside")])
def test_the_title_counts_what_is_drawn(system, says):
    ax = st.verify(system).plot().axes[0]
    reference = np.array(ax.lines[0].get_data()).T
    (low, high), (_, top) = ax.get_xlim(), ax.get_ylim()
    inside = sum(low < x < high and y < top for x, y in reference)
    assert ax.get_title().endswith(says)
    assert says.startswith(f"Hz: {inside}")


def test_the_command_lists_systems_and_the_numbers_of_one(stabctl):
    code, out, _ = stabctl("verify", QUICK, "--json")
    assert code == 0
    assert json.loads(out)["rows"][0]["system"] == QUICK
    code, out, err = stabctl("verify", "nowhere")
    assert code == 2
    assert "There are no reference numbers of 'nowhere'" in err
    code, out, err = stabctl("verify", "tf_3mib", "--folder", "/nonexistent")
    assert code == 2
    assert "may not be passed on with this program" in err
    assert "--download" in err


@pytest.fixture
def server(tmp_path):
    """Address of a server for the files in tmp_path/served."""
    (tmp_path / "served").mkdir()

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    running = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=tmp_path / "served"))
    Thread(target=running.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{running.server_address[1]}"
    running.shutdown()
    running.server_close()


def test_a_file_is_downloaded_once_and_only_if_it_is_the_right_one(server, tmp_path, monkeypatch):
    source = compare.HERE / "cases" / "d2aem.m"
    (tmp_path / "served" / "far.m").write_bytes(source.read_bytes())
    known = systems()["pst_d2aem"]
    right = File("here.m", f"{server}/far.m", sha256(source.read_bytes()).hexdigest())
    there = System(**known._asdict() | {"case": "here.m", "files": (right,), "license": "none"})
    monkeypatch.setattr(compare, "systems", lambda: {"pst_d2aem": there})
    kept = tmp_path / "kept"
    assert verify(folder=kept).missing == ("pst_d2aem",)
    assert not verify("pst_d2aem", folder=kept, download_missing=True).outside
    (tmp_path / "served" / "far.m").unlink()
    assert verify(folder=kept, download_missing=True).numbers == 6  # 3 swings
    (kept / "here.m").write_bytes(b"another")
    with pytest.raises(st.StabctlError, match="cannot be downloaded: HTTP Error 404"):
        verify("pst_d2aem", folder=kept, download_missing=True)
    (tmp_path / "served" / "far.m").write_bytes(b"other data")
    with pytest.raises(st.StabctlError, match="is not the file that the numbers of pst_d2aem were compared with"):
        verify("pst_d2aem", folder=kept, download_missing=True)
    assert (kept / "here.m").read_bytes() == b"another"


@pytest.mark.parametrize("change", [{"set": {}}, {"lines": ((3, 101, 0.011, 0.11, 0.1925),)}])
def test_what_the_source_has_otherwise_counts(change):
    known = systems()["pst_d2aem_inertia"]
    ours = [complex(row.ours) for row in verify("pst_d2aem_inertia").rows]
    rows = [row for row in published() if row.system == known.name]
    other = [complex(row.ours) for row in compare.compare(known._replace(**change), folder_of(None), rows)]
    assert max(abs(a - b) for a, b in zip(ours, other, strict=True)) > 0.01
