"""Machines of a RAW file: what is printed is their name, never the number within the case, and is read back in."""

import re
from pathlib import Path

import pytest

import stabctl as st
from stabctl._util.errors import StabctlError
from stabctl.dynamics.signals import INPUTS, OUTPUTS, chosen
from stabctl.io.contingencies.con import read_con
from stabctl.model import naming

EXAMPLES = Path(__file__).parents[1] / "docs" / "examples"
FIRST = "102, '1', 110.000, 24.429, 90.0, -60.0, 1.02, 0, 150.0, 0.0, 0.25\n"
UNITS = "1", "A b"  # identifiers at bus 102
FAULT = "102-103@0.4"


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """Two machines at bus 102; the second has a number that no file gives."""
    folder = tmp_path_factory.mktemp("named")
    raw, dyr = ((EXAMPLES / f"three.{ending}").read_text() for ending in ("raw", "dyr"))
    half = FIRST.replace("110.000, 24.429", "55.0, 12.2")
    assert FIRST in raw
    (folder / "named.raw").write_text(raw.replace(FIRST, half + half.replace("'1'", f"'{UNITS[1]}'")))
    own = dyr[dyr.index("102 'GENROU'") :]
    second = re.sub(r"^(102 '\w+') +1 ", rf"\1 '{UNITS[1]}' ", own, flags=re.MULTILINE)
    (folder / "named.dyr").write_text(dyr + second)
    return st.load(folder / "named.raw", dyr=folder / "named.dyr", loads="impedance")


@pytest.fixture(scope="module")
def stored(case):
    return case.with_storage("102/1=5MW,102/A b=10MW", energy=1)


@pytest.fixture(scope="module")
def unprinted(case):
    """Raise if a text has the number of a machine that has a name, or its bus where its name should be."""
    numbers = "|".join(str(m.machine) for m in case.machines if m.machine != m.bus)
    wrong = re.compile(rf"\b({numbers})\b|(machine|unit|ESD|speed:|order:) ?10[12](?!/)\b", re.IGNORECASE)

    def check(text):
        assert not (found := wrong.search(str(text))), (found, text)
        return str(text)

    assert numbers
    assert wrong.search("machine 102 ")
    assert not wrong.search("machine 102/1")
    return check


def test_keys_of_storage_are_names_and_are_read_back(stored, unprinted):
    keys = naming.keys(stored, "storage")
    assert keys == ["102/1@102", "102/A b@102"]
    second = stored.storage[1].machine
    for k, forms in enumerate(((keys[0], "102/1", "102@102"), (keys[1], "102/'A b'@102", "102/a B", f"{second}@102"))):
        assert {naming.row(stored, "storage", form) for form in forms} == {k}
    assert stored.set("storage.102/A b@102.rating", "7MW").storage[1].rating == 7
    assert unprinted(stored.short_circuit_ratio())
    run = stored.simulate(st.Contingency(FAULT, clear="6cyc"), until="2s")
    assert list(run.storage.device.values) == keys
    unprinted(run)
    unprinted(list(run.df().columns) if callable(run.df) else list(run.df.columns))


@pytest.mark.parametrize("kinds", [INPUTS, OUTPUTS], ids=["inputs", "outputs"])
def test_signals_are_read_by_the_name_and_label_that_they_show(stored, kinds, unprinted):
    every = []
    for kind in kinds:
        if kinds[kind].place in ("machine", "group", "device"):
            every += chosen(stored, kind, kinds)
    assert {"102/1", "102/A b", "102/A b@102"} <= {str(s.called) for s in every}
    for signal in every:
        assert (signal,) == chosen(stored, [unprinted(signal.name)], kinds) == chosen(stored, [signal.label], kinds)
        unprinted(signal.label)


def test_a_group_of_named_machines_is_one_of_their_numbers(stored, unprinted):
    """A law with the names of the group has the signals and the run of one with its numbers."""
    numbers = [str(m.machine) for m in stored.machines if m.bus == 102]
    named, numbered = (st.StorageLaw((group,), slope=0.1) for group in ("102/1+102/A b", "+".join(numbers)))
    assert named.numbers(stored) == numbered.numbers(stored)
    assert unprinted(named.controllers(stored)) == str(numbered.controllers(stored))
    run, same = (
        stored.simulate(st.Contingency(FAULT, clear="6cyc"), until="2s", control=law) for law in (named, numbered)
    )
    assert (run.speed == same.speed).all()
    assert {s.place for s in chosen(stored, ["deviation:102/A b+102/1"], OUTPUTS)} == {"+".join(numbers)}


def test_what_trips_is_named_in_a_screen_and_read_back(case, unprinted, tmp_path):
    number = case.machine("102/A b").machine
    found = case.screen(faults="P1", resolution="4cyc", longest="0s", observe="2s")
    unprinted(found)
    unprinted(found.df.to_string())
    tripped = [one for pair in found.pairs for one in pair.trip if "machine" in one]
    assert set(tripped) == {"machine 101/1", "machine 102/1", "machine 102/A b"}
    for text in tripped:
        (one,) = st.Contingency("103", clear="6cyc", after=f"{text}@0s").placed(case).after
        assert f"machine {one.machine}" == text
    (tmp_path / "x.con").write_text("CONTINGENCY 'x'\nREMOVE MACHINE 'A b' FROM BUS 102\nEND\nEND\n")
    (read,) = read_con(tmp_path / "x.con", case)
    same = st.Contingency("102", clear="6cyc", after=f"{number}@0s").placed(case)
    assert read.after == same.after
    assert unprinted(same.label) == "102 trip machine 102/A b"


def test_modes_and_their_parameters_have_names(case, unprinted):
    unprinted(case.modes().df.to_string())
    unprinted(case.modes().contributions())
    found = case.modes().sensitivity("all").df
    of_second = found[found.place == "102/A b"]
    assert {"genrou", "ieeet1"} <= set(of_second.model)
    for model, place in zip(found.model, found.place, strict=True):
        key = list(case.devices[model])[naming.row(case, model, place)]
        assert naming.called(case, model, key) == place


def test_places_of_storage_are_given_and_shown_by_name(case, unprinted, tmp_path):
    wanted = [st.Contingency(FAULT, clear="40cyc")]
    (tmp_path / "sites.csv").write_text("bus,machine\n102,102/A b\n")
    by_table, by_name, by_number = (
        st.place(case, wanted, candidates=places, observe="2s")
        for places in (tmp_path / "sites.csv", [("102/A b", 102)], [(case.machine("102/A b").machine, 102)])
    )
    assert by_table.sites == by_name.sites == by_number.sites
    assert [c.machine for c in by_table.candidates] == ["102/A b"]
    for text in (by_name, by_name.df.to_string(), by_name.evidence):
        unprinted(text)


@pytest.mark.parametrize(
    ("ask", "says"),
    [
        (lambda c: c.linearize("field:102/A b", "speed"), "Machine 102/A b of named has an exciter; use vref:102/A b."),
        (lambda c: c.linearize("vref:101/1", "speed"), "Machine 101/1 of named has no exciter; use field:101/1."),
        (lambda c: c.linearize("ipcmd:102/A b", "speed"), "Unit 102/A b of named is not a converter"),
        (lambda c: c.with_storage("102/1=5MW,102/1@102=6MW"), "Machine 102/1 has two storage devices at bus 102"),
        (lambda c: c.without_device("ieeet1", "102/A b"), "no ieeet1 at 102/A b: .* machine 102/A b has no exciter"),
        (lambda c: c.simulate(["102/A b@1s", "102/a B@1.5s"], until="2s"), "Machine 102/A b is tripped twice"),
        (lambda c: c.set("genrou.102/Z.H", 3), "no genrou at 102/Z; did you mean 102/"),
        (lambda c: c.trip_machine("101/1"), "Machine 101/1 of named is the only one at the swing bus"),
        (
            lambda c: st.design.pss(c, ["101/1"]),
            "Machine 101/1 of named.* has no exciter, so it can have no stabilizer",
        ),
        (
            lambda c: st.place(c, [st.Contingency("103", clear="6cyc")], candidates=[("102/A b", 102)] * 2),
            "The candidate 102/A b@102 is listed twice",
        ),
        (
            lambda c: c.with_storage("102/1=5MW", energy=1, charge=1).linearize("order", "speed"),
            "The storage device 102/1@102 of named is full",
        ),
        (
            lambda c: c.with_device("regc_a", "102/A b").estimate("102/1@1s", "2s"),
            "The speed of machine 102/A b of named cannot be estimated",
        ),
    ],
)
def test_messages_name_machines(case, ask, says, unprinted):
    with pytest.raises(StabctlError, match=says) as error:
        ask(case)
    unprinted(error.value)


def test_an_alarm_and_its_pmu_have_the_name(cases):
    """A PMU is chosen by a name as by the number."""
    plain = cases("two_area")
    named = st.load("two_area").set({f"machines.{m.machine}.name": f"{m.bus}/A b" for m in plain.machines})
    of = [named.machines[2].called, 3]
    alarms = [
        c.estimate(
            st.Contingency("7", clear="6cyc"), "2s", storage="50MW",
            control=st.EstimatorControl(pmu=st.Pmu(bad=(st.BadPmu(m, "0.5s", jump="5deg"),)), check_pmus=True),
        ).alarms
        for c, m in zip((named, plain), of, strict=True)
    ]  # fmt: skip
    assert [a.machine for a in alarms[0]] == [of[0]]
    assert [a._replace(machine=3) for a in alarms[0]] == [*alarms[1]]
