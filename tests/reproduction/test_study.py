import json

import pytest

from reproduction import paper, study
from reproduction.comparison import Printed, Verdict
from reproduction.study import Picture, Study, Table
from stabctl._util.errors import StudyError

NUMBER = Printed("Table 9", "angle", "0.6519", "rad")
RECORD = Study(
    "A title",
    "2.1",
    ("Words.", "More."),
    (NUMBER.compare(0.652, "rounded"), Printed("Figure 9", "outcome", "unstable").compare("unstable")),
    (Table("Sizes", ("a", "b"), (("1", "2"), ("3", "4"))),),
    (Picture("a.png", "A picture", "a line", of=("Figure 9",)),),
    {"modes": "modes.html"},
)


@pytest.mark.parametrize(
    ("text", "ours", "verdict"),
    [
        ("0.6519", 0.65194, Verdict.AS_PRINTED),
        ("0.6519", 0.65196, Verdict.CLOSE),
        ("0.6519", 0.6583, Verdict.CLOSE),
        ("0.6519", 0.6585, Verdict.DIFFERS),
        ("0", -1e-9, Verdict.AS_PRINTED),
        ("0", 0.6, Verdict.DIFFERS),
        ("60", 59.6, Verdict.AS_PRINTED),
        ("60", 73.2, Verdict.DIFFERS),
        ("60", float("nan"), Verdict.DIFFERS),
        ("unstable", "unstable", Verdict.AS_PRINTED),
        ("unstable", "stable", Verdict.DIFFERS),
    ],
)
def test_a_result_agrees_in_the_digits_that_are_printed(text, ours, verdict):
    assert Printed("Table 9", "it", text).compare(ours).verdict is verdict


@pytest.mark.parametrize(("ours", "verdict"), [(0.5, Verdict.GIVEN), (0.5000001, Verdict.DIFFERS)])
def test_a_constant_that_is_given_agrees_exactly(ours, verdict):
    assert Printed("Table 9", "power", "0.5", "pu", given=True).compare(ours).verdict is verdict


def test_difference_is_ours_less_the_papers():
    c = NUMBER.compare(0.6619)
    assert c.difference == pytest.approx(0.01, rel=1e-12)
    assert c.relative == pytest.approx(0.01 / 0.6519, rel=1e-12)
    assert Printed("Table 9", "speed", "0").compare(1).relative is None
    assert str(c) == "Table 9, angle: paper 0.6519 rad, ours 0.6619 rad: differs"


def test_records_come_back_from_their_file(tmp_path):
    path = study.path_for(tmp_path / "sims" / "omib.py", tmp_path)
    assert path.name == "sims_omib.json"
    study.write(path, [RECORD, RECORD])
    assert study.read(path) == (RECORD, RECORD)


@pytest.mark.parametrize("text", ["", "[{}]", "{", "[1]", '{"title": 1}'])
def test_a_file_without_records_is_one_sentence(text, tmp_path):
    path = tmp_path / "sims_it.json"
    path.write_text(text)
    with pytest.raises(StudyError, match=r"^sims_it.json does not contain records") as error:
        study.read(path)
    assert "\n" not in str(error.value)


def test_brackets_are_printed_as_they_stand(capsys, tmp_path):
    study.show(Study("a [/b]", tables=(Table("t [bold]", ("h [x]",), (("[/c]",),)),)), tmp_path)
    shown = capsys.readouterr().out
    assert all(text in shown for text in ("a [/b]", "t [bold]", "h [x]", "[/c]"))
    assert "\\" not in shown


def test_every_printed_number_stands_once():
    printed = []
    for value in vars(paper).values():
        group = value.values() if isinstance(value, dict) else [value]
        for entry in group:
            printed += [p for p in (entry if isinstance(entry, tuple) else [entry]) if isinstance(p, Printed)]
    assert len(printed) > 50
    assert len({(p.where, p.what) for p in printed}) == len(printed)
    assert all(p.value is not None or not p.text[0].isdigit() or " " in p.text for p in printed)
    json.dumps(RECORD.to_dict(), allow_nan=False)
