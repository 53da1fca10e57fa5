"""What cannot be tuned, or not as wanted, is said in a sentence."""

import islands
import pytest
from systems import kind, small

from stabctl._util.errors import StudyError
from stabctl.design import damper, outages, pss, stabilizers, tune, values
from stabctl.design.tuning.networks import networks
from stabctl.design.tuning.parts import Asked, Parts
from stabctl.design.tuning.rounds import Rounds
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.events import Open


def test_a_damping_that_no_controller_can_reach_is_said_before_the_search(cases):
    """Two systems side by side, of which one has no controller; more than its own damping cannot be asked for."""
    both = islands.joined(cases("two_area_thyristor"), cases("two_area"))
    modes = cases("two_area").modes()
    own = float(modes.damping_ratio[modes.frequency_hz > 0.1].min())
    tell = []
    options = {"outages": "none", "levels": (1.0,), "gains": (), "progress": lambda text, share: tell.append(text)}
    with pytest.raises(StudyError, match="cannot be reached: no controller moves the mode"):
        tune(both, stabilizers([1, 2, 3, 4]), damping=own + 0.01, **options)
    assert tell == ["networks"]
    parts = Parts.of(networks(both, [stabilizers([1])], "none", (1.0,), ())[0], [stabilizers([1])])
    assert parts.movable(own - 0.01)[1] == []


@pytest.mark.slow
def test_a_network_that_nothing_stabilizes_is_named(cases):
    """Opened lines leave an unstable part of which the only damper sees nothing: a sentence, or the network's name."""
    point = cases("two_area_thyristor").initialize(storage="3@11=50MW")
    blind = damper("voltage:7", "order:3@11", gain=1e-3, fast=1e-3)
    found = tune(point, blind, outages="none", levels=(1.0,), gains=(), starts=1)
    assert found.damping < 0
    assert "Nothing was found that stabilizes every network" in str(found)


@pytest.mark.slow
def test_a_machine_alone_has_no_ring_down_to_compare(recwarn):
    """The unit behind a converter has no speed, and there is nothing from which the other one may deviate."""
    with kind("reec_b, currents") as models:
        found = tune(small(models), values("reec_b.Kqv"), outages="none", levels=(1.0,), gains=(), starts=1)
    assert not found.ring_down.linear.any()
    assert found.ring_down.difference == 0
    assert not [one for one in recwarn if issubclass(one.category, RuntimeWarning)]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda c: tune(c, []), "There is no parameter to tune"),
        (lambda c: tune(c, values("pss.K")), "pss"),
        (lambda c: tune(c, values("sexs.KX")), "KX"),
        (lambda c: tune(c, 3), "cannot be tuned"),
        (lambda c: tune(c, stabilizers(gain=10, fast=1e-6)), "the gain at high frequencies is at least"),
        (lambda c: tune(c, stabilizers([9])), "no machine 9"),
        (lambda c: pss(c, []), "machines names no machine"),
        (lambda c: pss(c, washout=0), "washout = 0 is not allowed"),
        (lambda c: tune(c, starts=0), "starts = 0"),
        (lambda c: tune(c, levels=()), "no load level"),
        (lambda c: tune(c, outages="some"), "outages = 'some'"),
        (lambda c: tune(c, sensitivity=0.5), "sensitivity = 0.5"),
        (lambda c: tune(c, damping=1.5), "damping = 1.5"),
        (lambda c: tune(c, reserve=1.0), "reserve = 1"),
        (lambda c: tune(c, reserve=0.5), "needs the noise of a signal"),
        (lambda c: tune(c, damping="5MW"), "5MW"),
        (
            lambda c: tune(c, stabilizers(noise=1.0, lead=(0.4, 1), lag=(0.02, 0.05)), reserve=0.5),
            "even with the smallest gains within the bounds",
        ),
        (lambda c: tune(c, damper("speed:1", "vs:1", noise=1e-4), reserve=0.5), "needs limits of its output"),
        (lambda c: tune(c, damper("speed:1", "vs:1", noise=-1)), "noise = -1"),
        (lambda c: tune(c, gains=(0,)), "a factor in gains = 0"),
        (lambda c: stabilizers(model="esst1a"), "model = 'esst1a'"),
        (lambda c: stabilizers(model="pss", stages=3), "2 stages, not 3"),
        (lambda c: stabilizers(model="pss", stages="2"), "stages = '2' is not allowed"),
        (lambda c: stabilizers(model="pss", washout=(3, 4)), "keeps its own washout"),
        (lambda c: stabilizers(lead=(1, 0.1)), "lead = (1, 0.1)"),
        (lambda c: stabilizers(gain=0), "gain = 0"),
        (lambda c: stabilizers(fast=-1), "fast = -1 is not allowed; give a number above 0"),
        (lambda c: damper("speed:1", "vs:1", fast=float("nan")), "fast = nan"),
        (lambda c: damper("", "vs:1"), "input = ''"),
        (lambda c: damper("speed:1", "vs:1", limits="a lot"), "limits = 'a lot'"),
        (lambda c: damper("speed:1", "vs:1", delay=-1), "delay = -1"),
        (lambda c: values("pss"), "'pss'"),
        (lambda c: values("pss.K", within=(2, 3)), "leaves out the value"),
    ],
)
def test_what_cannot_be_tuned_is_said_in_a_sentence(cases, call, message):
    with pytest.raises(StudyError) as error:
        call(cases("two_area_thyristor"))
    assert message in str(error.value)
    assert str(error.value).endswith(".")


def test_a_text_is_one_contingency_and_outages_have_their_intact_network(cases):
    case, wanted = cases("two_area_thyristor"), [stabilizers([1])]
    one, several = (networks(case, wanted, "none", (1.0,), given)[0] for given in ("7-8", ["7-8"]))
    assert [n.name for n in one] == [n.name for n in several]
    assert len(one) == 2
    plain = networks(case, wanted, "all", (1.0,), ())[0]
    known = networks(outages(case), wanted, "all", (1.0,), ())[0]
    assert [n.intact for n in known] == [n.intact for n in plain] == [True, *[False] * (len(plain) - 1)]
    levels = [networks(one, wanted, "all", (0.8, 1.0), ())[0] for one in (case, outages(case))]
    alike = [sorted((n.level, n.intact, n.point.case.branches, n.point.case.loads) for n in one) for one in levels]
    assert alike[0] == alike[1]
    assert len(alike[0]) == 2 * len(plain)
    assert tune(case, wanted, damping="5%", outages="none", levels=(1.0,), gains=(), checks=0, starts=1).reached


@pytest.mark.parametrize(
    ("given", "opened"),
    [
        (Contingency("7", trip=["7-8"], events="8-9@2s"), 2),
        (Contingency("7", after="8-7@6cyc"), 1),
        (Contingency(events=[Open("7-8", "1s", end=7), Open("8-7", "1.1s", end=8)]), 1),
        (Contingency(events=[Open("7-8", "1s", end=7), Open("8-9", "1s")]), "not: opening of 7-8 at bus 7"),
        (Contingency("7", trip="7-8", after="2@0s"), "not: trip of machine 2"),
        (Contingency("7", events="2@1s"), "not: trip of machine 2"),
        (Contingency("7", trip="7-8", events="7:+50MW@1s"), "not: load step at bus 7"),
        ("7", "no circuit is open afterwards"),
    ],
    ids=str,
)
def test_a_network_after_a_contingency_has_all_that_opens_and_nothing_else_happens(cases, given, opened):
    """At a tenth of the load, so that there is a power flow with one of two circuits to each side."""
    case = cases("two_area_thyristor")
    every, left_out = networks(case, [stabilizers([1])], "none", (0.1,), [given])
    if isinstance(opened, str):
        assert len(every) == 1
        ((_, why),) = left_out
        assert why.endswith(opened)
    else:
        assert left_out == []
        assert len(every[1].point.case.branches) == len(case.branches) - opened


def test_a_check_level_without_a_power_flow_is_left_out_and_said(cases):
    few = {"outages": "none", "levels": (1.0,), "gains": (), "checks": 0, "starts": 1}
    found = tune(cases("two_area_thyristor"), [stabilizers([1])], check_levels=(0.9, 3.0), **few)
    ((name, why),) = found.left_out
    assert name.endswith("at 300 %")
    assert "power flow" in why
    assert [what.partition(" at ")[2] for what, _ in found.robustness if "not tuned for" in what] == [
        "90 %, not tuned for"
    ]


def test_a_store_tells_apart_what_changes_the_search(cases):
    """The stabilizers that are replaced, whose other parameters stay, and which networks are intact."""

    class Remote:
        remote = True

    def known(bases, which="none"):
        device = stabilizers([1], model="pss")
        parts = Parts.of(networks(bases, [device], which, (1.0,), ())[0], [device])
        return Rounds(Remote, parts, Asked(None, (), None, (), True), [device], print).known

    case = cases("two_area")
    assert known(case) == known(cases("two_area"))
    assert known(case) != known(case.set({"pss.1.Tw": 0.1}))
    every = outages(case)
    assert known(every) == known(case, "all")
    assert known(every) != known(list(every.points))
