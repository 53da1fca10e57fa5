"""Free format of PSS/E files: however its fields are separated, a record is read as the same, or refused."""

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stabctl._util.errors import CaseError
from stabctl.io.psse import dyr, raw

HEAD = "0, 100.0, 33, 0, 1, 60.0 / a system\n\n\n"
BUS = "5,'A, B/C',138.0,1,1,1,1,1.02,-3.5"


def records(folder, text):
    path = folder / "x.dyr"
    path.write_text(text)
    return [(r.place.line, *r[1:]) for r in dyr.read(path)]


def buses(folder, text):
    path = folder / "x.raw"
    path.write_text(HEAD + text)
    return [bus for bus, _ in raw.read(path).of("bus")]


@pytest.mark.parametrize(
    "text",
    [
        "1,'GENCLS',1,3.0,0.0/ 2,'GENCLS',1,4.0,0.0/",
        "1 'GENCLS' 1 3.0 0.0/2 , 'GENCLS',1 4.0, 0.0/ machines, of 2 'areas'",
        "1,GENCLS,1,3.0,0.0/2,GENCLS,,4.0,0.0/ 3 machines at 1 bus",
        "1,'GENCLS',1,3.0,0.0/, '2' 'GENCLS' 1 4.0 0.0/",
        "1,'GENCLS',1,3.0,0.0/2,'GENCLS',1,\n4.0,0.0/ / 3,'GENCLS',1,4.0,0.0/",
    ],
)
def test_all_records_of_a_line_are_read(tmp_path, text):
    """A comment, also an empty one, reaches to the end of its line."""
    expected = [(1, 1, "GENCLS", "1", ("3.0", "0.0")), (1, 2, "GENCLS", "1", ("4.0", "0.0"))]
    assert records(tmp_path, text) == expected


@pytest.mark.parametrize("out", ["/", "//", " / ", "/ left out: "])
def test_a_line_that_begins_with_a_slash_is_a_comment(tmp_path, out):
    """Unless it ends a record that began on a line before."""
    first = "1,'GENCLS',1,3.0\n/ 3,'GENCLS',1,4.0,0.0/"
    assert [r[1] for r in records(tmp_path, f"{first}\n{out}2 'GENCLS' 1 4.0 0.0 /\n")] == [1, 3]


def test_a_comma_at_the_begin_of_a_line_belongs_to_the_field_before(tmp_path):
    expected = [(1, 1, "GENCLS", "1", ("3.0", "", "0.5"))]
    assert records(tmp_path, "1,'GENCLS'\n,1,3.0,\n , 0.5 / ") == expected
    assert records(tmp_path, "1,'GENCLS',\n1\n,3.0\n\n,\n, 0.5\n/ ") == expected


@pytest.mark.parametrize(
    "text",
    [
        "5 'A, B/C' 138.0 1 1 1 1 1.02 -3.5",
        "5 'A, B/C' 138.0, 1,1 ,1 1 , 1.02 -3.5 / 'x', y",
        "5,'A, B/C' 138.0 1,1,1,1,1.02,-3.5",
        '5\t"A, B/C"\t138.0,1,1\t1,1,1.02,-3.5,',
    ],
)
def test_blanks_and_commas_mix_in_a_record(tmp_path, text):
    assert buses(tmp_path, text) == buses(tmp_path, BUS)


@pytest.mark.parametrize("end", ["0", "0 /", "0,", "0 0 0", "0,0, 0 /", "'0',", "0 0 / END OF BUS DATA"])
def test_a_section_ends_at_a_record_of_zeros(tmp_path, end):
    """A transformer of this shape is no end: its impedances may be a line of zeros."""
    load = "5,'1',1,1,1,180.0,40.0\n"
    (tmp_path / "y.raw").write_text(f"{HEAD}{BUS}\n{end}\n{load}{end}\n{end}\n")
    found = raw.read(tmp_path / "y.raw")
    assert [len(found.of(section)) for section in ("bus", "load", "shunt", "generator")] == [1, 1, 0, 0]
    assert found.of("load")[0][0].PL == 180.0


@pytest.mark.parametrize("text", ["0", "0 / END", "0 / END OF DATA", "0 / end of section"])
def test_the_same_comment_may_be_behind_every_end_record(tmp_path, text):
    """Also where sections are empty, one after the other."""
    shunt = "5,1,0,1,1.05,0.95,0,100.0,' ',40.0,1,40.0"
    (tmp_path / "y.raw").write_text(f"{HEAD}{BUS}\n" + f"{text}\n" * 16 + f"{shunt}\n{text}\n")
    found = raw.read(tmp_path / "y.raw")
    assert [(s.I, s.BINIT) for s, _ in found.of("switched_shunt")] == [(5, 40.0)]


def test_a_second_record_that_begins_the_same_section_is_passed_over(tmp_path):
    begin = "0 / END OF BUS DATA, BEGIN LOAD DATA\n"
    (tmp_path / "y.raw").write_text(f"{HEAD}{BUS}\n{begin}{begin}5,'1',1,1,1,180.0,40.0\n0\n")
    assert len(raw.read(tmp_path / "y.raw").of("load")) == 1


def test_a_line_of_zeros_within_a_record_belongs_to_it(tmp_path):
    sections = f"{HEAD}{BUS}\n6,'B',138.0,1\n" + "0\n" * 5
    windings = "5,6,0,'1',1,1,1,0,0,2,'T',1\n0,0,0\n1.0\n1.0\n0,\n"
    (tmp_path / "z.raw").write_text(sections + windings)
    ((transformer, _),) = raw.read(tmp_path / "z.raw").of("transformer")
    assert transformer.z.X12 == 0


@pytest.mark.parametrize("second", ["2,'GENCLS',1,4.0,0.0/", "  2 gencls 1 4.0 0.0 /"])
def test_a_record_without_a_slash_does_not_swallow_the_next(tmp_path, second):
    first = "1,'GENCLS',1,\n3.0,0.0"
    says = r"x\.dyr line 2: the record has no slash at its end, and line {line} begins another\."
    with pytest.raises(CaseError, match=says.format(line=4)):
        records(tmp_path, f"/ a comment\n{first}\n{second}")
    assert len(records(tmp_path, f"{first} /\n{second}")) == 2
    broken = "1,'USRMDL'\n1,'MODEL',1,1,0,2,0,0,3.0,\n4 5 / "  # no other record begins on its second line
    assert [r[2] for r in records(tmp_path, broken)] == ["MODEL"]


DOUBTFUL = "may be one field or two; put quotes around texts, or a comma between them."


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("5,BUS ONE ,138.0,1", f", field NAME: 'BUS ONE' {DOUBTFUL}"),
        ("5,BUS 138.0,1,1", f", field NAME: 'BUS 138.0' {DOUBTFUL}"),
        ("5,7 MILE,138.0,1", f", field NAME: '7 MILE' {DOUBTFUL}"),
        ("5,'A' 'B' ,138.0,1", ", field BASKV: 'B' is not a number."),
        ("5,'A ,138.0,1, 'B' ,1", ": the quote in "),
        ("5,'A' 138.0 1,'B' c ',1", ": the quote in "),
    ],
)
def test_a_doubtful_name_is_not_guessed(tmp_path, text, says):
    with pytest.raises(CaseError, match=rf"x\.raw line 4{re.escape(says)}"):
        buses(tmp_path, text)


def test_a_name_without_quotes_in_a_field_that_is_not_used_moves_no_other(tmp_path):
    """The name of a branch, in version 34 before its ratings and status."""
    branch = "0\n0\n0\n0\n5,6,'1',0.01,0.1,0.0,{},1,2,3,4,5,6,7,8,9,10,11,12,0,0,0,0,1"
    text = HEAD.replace("33", "34") + "0\n5,'A',138\n6,'B',138\n" + branch
    (tmp_path / "x.raw").write_text(text.format("'LINE 1'"))
    assert len(raw.read(tmp_path / "x.raw").of("branch")) == 1
    (tmp_path / "x.raw").write_text(text.format("LINE 1"))
    with pytest.raises(CaseError, match="field 7: 'LINE 1' may be one field or two"):
        raw.read(tmp_path / "x.raw")


BLANKS = st.text(" \t", max_size=2)
NUMBERS = st.sampled_from(["0", "-1.5", "2.50E-3", ".5D+1", "12"])
TEXTS = st.text("aBZ09 ,/.-", max_size=6)
QUOTED = st.one_of(
    TEXTS.map(lambda t: (f"'{t}'", t.strip())),
    st.text("a '/,", max_size=6).map(lambda t: (f'"{t}"', t.strip())),
    TEXTS.map(lambda t: (f"'{t.replace('/', '')}O'H'", f"{t.replace('/', '')}O'H".strip())),
)
PLAIN = st.one_of(NUMBERS, st.sampled_from(["A1", "O'HARE", "M"])).map(lambda t: (t, t))
COMMENTS = (
    "",
    " peak load",
    " it's 3, 4",
    " 101 'X",
    ' an "old", value',
    "a/b, 'c/d'",
    ", , ,",
    " 3 units, 100 MW / old",
)


@st.composite
def separated(draw, fields, breaks=0):
    """Fields as text with any separators; from the separator `breaks` on, lines may end in it."""
    text = fields[0][0]
    for i in range(1, len(fields)):
        after, before = draw(BLANKS), draw(BLANKS)
        comma = "," if "" in (fields[i][0], fields[i - 1][0]) or draw(st.booleans()) else ""
        if breaks and i >= breaks and draw(st.integers(0, 3)) == 0:
            after, before = draw(st.sampled_from([(after + "\n", before), (after, "\n" + before)]))
        text += (after + comma + before or " ") + fields[i][0]
    return text


@st.composite
def files(draw):
    """A DYR file, and its records with their lines."""
    text, found, follows = "", [], False
    for bus in range(1, draw(st.integers(1, 5)) + 1):
        kind = draw(st.sampled_from(["'GENCLS'", "GENCLS", '"gencls"', "'USER, 1/2'"]))
        name = draw(st.one_of(QUOTED, PLAIN, st.just(("", ""))))
        constants = draw(st.lists(st.one_of(QUOTED, PLAIN, st.just(("", ""))), max_size=8))
        fields = [(str(bus), ""), (kind, ""), name, *constants, draw(st.one_of(QUOTED, PLAIN))]
        breaks = 1
        if follows and kind == "GENCLS":  # on one line, without slashes in quotes
            fields = [(str(bus), ""), (kind, ""), name, draw(PLAIN), draw(PLAIN)]
            name, breaks = (name if name[0] and "/" not in name[0] else ("B", "B")), 0
            fields[2] = name
        elif follows:
            breaks = 3 if name[0] else 4
        begin = draw(BLANKS) if not follows else draw(st.sampled_from(["", " ", "\t, "]))
        line = text.count("\n") + 1
        text += begin + draw(separated(fields, breaks)) + draw(BLANKS) + "/"
        own = kind.strip("'\"").upper()
        found.append((line, bus, own, name[1] or "1", tuple(value for _, value in fields[3:])))
        follows = draw(st.booleans())
        if not follows:
            text += draw(st.sampled_from(COMMENTS)) + "\n"
    return text, found


@pytest.mark.slow
@given(files())
@settings(max_examples=300)
def test_a_dyr_file_in_any_free_format_has_the_same_records(tmp_path_factory, made):
    text, found = made
    assert records(tmp_path_factory.getbasetemp(), text) == found


@pytest.mark.slow
@given(st.data(), st.lists(st.one_of(QUOTED, st.just(("A1", "A1"))), min_size=1, max_size=4))
@settings(max_examples=200)
def test_a_raw_file_in_any_free_format_has_the_same_records_or_is_refused(tmp_path_factory, data, names):
    rest = [(text, text) for text in ("138.0", "2", "3", "4", "5", "1.02", "-3.5")]
    rows = [data.draw(separated([(str(i), ""), name, *rest])) for i, name in enumerate(names, 1)]
    ends = [data.draw(BLANKS) + data.draw(st.sampled_from(["", *("/" + c for c in COMMENTS)])) for _ in names]
    text = "\n".join(row + end for row, end in zip(rows, ends, strict=True))
    doubtful = any(
        "," in row and re.search(r"A1\s+138", row) for row, (name, _) in zip(rows, names, strict=True) if name == "A1"
    )
    if doubtful:
        with pytest.raises(CaseError, match=re.escape(f"field NAME: 'A1 138.0' {DOUBTFUL}")):
            buses(tmp_path_factory.getbasetemp(), text)
        return
    found = buses(tmp_path_factory.getbasetemp(), text)
    default = raw.Bus(I=0)
    assert [(b.I, b.NAME) for b in found] == [(i, name or default.NAME) for i, (_, name) in enumerate(names, 1)]
    assert {(b.BASKV, b.IDE, b.AREA, b.ZONE, b.OWNER, b.VM, b.VA) for b in found} == {(138.0, 2, 3, 4, 5, 1.02, -3.5)}
