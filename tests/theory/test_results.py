"""Results are tables and figures, print themselves, and are saved as files."""

import numpy as np
import pandas as pd
import pytest
from labels import crowded

from stabctl._util.errors import StudyError
from stabctl.theory.equal_area import equal_area
from stabctl.theory.feedback_laws import compare
from stabctl.theory.minimum_time import by_shooting
from stabctl.theory.omib import OMIB, swing_curve
from stabctl.theory.phase_plane import portrait
from stabctl.theory.two_machine import Equivalent

PAPER = OMIB()
RESULTS = {
    "equal area": lambda: equal_area(PAPER, 1.2, 0.1),
    "swing curve": lambda: swing_curve(PAPER, 0.2, until=1.0),
    "phase portrait": lambda: portrait(PAPER),
    "feedback laws": lambda: compare(PAPER),
    "minimum time": lambda: by_shooting(Equivalent().minimum_time_problem(6)),
}


@pytest.fixture(scope="module", params=RESULTS)
def result(request):
    return RESULTS[request.param]()


def test_it_is_a_table_with_units_and_a_notebook_shows_it(result):
    table = result.df
    assert len(table) > 2
    assert table.notna().to_numpy().all()
    html = result._repr_html_()
    assert all(column in html for column in table.columns)
    assert str(result).splitlines()[0] in html
    assert repr(result) == str(result)


def test_its_figure_is_drawn_and_saved(result, tmp_path):
    assert crowded(result.plot()) == []
    assert result.save(tmp_path / "figure.svg").read_text().startswith("<?xml")


def test_its_table_is_saved(result, tmp_path):
    path = result.save(tmp_path / "table.csv")
    pd.testing.assert_frame_equal(pd.read_csv(path), result.df.reset_index(drop=True))


def test_other_files_are_refused(result, tmp_path):
    with pytest.raises(StudyError, match=r"must end in \.csv, \.png"):
        result.save(tmp_path / "table.xyz")
    with pytest.raises(StudyError, match="There is no folder"):
        result.save(tmp_path / "nowhere" / "table.csv")


def test_the_curves_of_a_table_are_those_of_the_result():
    area = equal_area(PAPER, 1.2, 0.1)
    assert np.array_equal(area.df.pe_with_pc_pu, area.Pe + 0.1)
