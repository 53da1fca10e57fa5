"""What would help an insecure system: retuned stabilizers, storage, another dispatch; each verified by the same study.

Stabilizers are retuned by `design.tune`, storage is sited and sized by `place`, and power is shifted by `redispatch`,
all for what the study has found. With the change, the whole study is repeated. Contingencies that are lost then are
added to those that must be survived, and the search is repeated, up to three times.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from stabctl._util.errors import StabctlError, StudyError, shown
from stabctl._util.wording import counted, listed
from stabctl.design.tuning import stabilizers, tune
from stabctl.design.tuning.blocks import MODELS
from stabctl.design.tuning.case_values import Device
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.model import naming, tables
from stabctl.model.case import Case
from stabctl.placement.place import acting_in, place
from stabctl.placement.siting import Costs
from stabctl.simulation.contingency import Contingency
from stabctl.simulation.control import Control

from .prices import Prices
from .redispatch import redispatch
from .remedy import Change, Remedy, State
from .result import Margin, Study

KINDS = "stabilizers", "storage", "redispatch"
ROUNDS = 3  # searches of one remedy, at most
TUNING: Mapping[str, Any] = {"outages": "none", "levels": (1.0,), "check_levels": (), "checks": 0, "starts": 1}
USUAL_GAIN = 20.0  # pu   largest gain of a stabilizer, if it has no larger one

Find = Callable[[Sequence[Contingency]], Change]


class Asked(NamedTuple):
    """What is to be remedied, and how."""

    study: Study
    prices: Prices
    again: Callable[[OperatingPoint, Control], Study]  # the same study of a changed system
    running: Mapping[str, Any]  # workers, store and scheduler


def kinds(text: str) -> tuple[str, ...]:
    """The remedies that are asked for: "stabilizers, storage, redispatch", "all", or "none".

    Raises `StudyError` for any other word.
    """
    given = [word for word in naming.listed(text) if word] if isinstance(text, str) else [text]
    words = [] if given == ["none"] else [*KINDS] if given == ["all"] else given
    for word in words:
        if word not in KINDS:
            what = "goes with no other word" if word in ("all", "none") else "is not a remedy"
            raise StudyError(f"{shown(word)} {what}; choose from {', '.join(KINDS)}, or write all or none alone.")
    return tuple(dict.fromkeys(words))


def applicable(study: Study, asked: Sequence[str]) -> tuple[str, ...]:
    """Those that may help: stabilizers against poor damping, or if nothing else is asked; the others if any is lost."""
    for_damping = study.poorly_damped or list(asked) == ["stabilizers"]
    return tuple(one for one in asked if (for_damping if one == "stabilizers" else study.insecure))


def remedy(kind: str, asked: Asked) -> Remedy:
    """The remedy of a kind, with what a study finds with it."""
    find: Find = {"stabilizers": _retuned, "storage": _stored, "redispatch": _shifted}[kind](asked)
    before, best, why = state(asked.study), None, ""
    try:
        for change, after in _rounds(asked, find, ROUNDS if kind != "stabilizers" else 1):
            if best is None or len(after.insecure) < len(best[1].insecure):
                best = change, after
    except StabctlError as error:
        why = str(error)
    if best is None:
        return Remedy(kind, before, prices=asked.prices, remark=why)
    change, after = best
    return Remedy(kind, before, state(after), change, asked.prices, _remark(change, after, why))


def _remark(change: Change, after: Study, why: str) -> str:
    """What a study finds wrong with a change, in sentences; `why` nothing was found for what is lost, too."""
    lost = dict.fromkeys(m.found.contingency.label for m in after.insecure)
    unsolved, others = ([one for one in lost if (one in change.unsolved) == of] for of in (True, False))
    said = (
        f"With it, {after.unstable}." * bool(after.unstable),
        f"Nothing was found for {listed(unsolved)}." if unsolved else "",
        f"Lost with it: {listed(others)}." if others else "",
        f"For what is lost then, too, nothing was found: {why}" if why else "",
        "" if all(one.kept for one in after.judged) else after.compliance,
        "Oscillations are not judged." if after.no_modes else "",
    )
    return " ".join(filter(None, said))


def state(study: Study) -> State:
    """What a study says of its system."""
    worst = study.oscillations[:1]
    damping = float(study.modes.damping_ratio[worst[0]]) if study.modes and worst else None
    margin, cycles = (study.margins[0].shown, study.margins[0].known_cycles) if study.margins else ("", None)
    violating = sum(not one.kept for one in study.judged) if study.judged else None
    numbers = len(study.margins), len(study.insecure), margin, cycles, damping, violating, len(study.low_or_high)
    return State(study.secure, *numbers)


def _rounds(asked: Asked, find: Find, most: int) -> Iterator[tuple[Change, Study]]:
    """Changes, and the study with each, while contingencies are lost that the last one was not made for."""
    wanted: list[Contingency] = []
    lost, change = asked.study.insecure, None
    for _ in range(most):
        left = [m for m in lost if change is None or m.found.contingency.label not in change.unsolved]
        new = [one for one in (_required(m, wanted) for m in left) if one not in wanted]
        if not new and change:
            return
        wanted += new
        change = find(wanted)
        after = asked.again(change.point, change.control)
        lost = after.insecure
        yield change, after


def _required(m: Margin, wanted: Sequence[Contingency]) -> Contingency:
    """A contingency with its guaranteed clearing time, at or above it on the grid of the search.

    If that is already wanted, stability is not monotone, and a shorter fault is lost: the shortest one found.
    """
    found, search = m.found, m.found.search
    point = math.ceil(m.required / search.resolution_cycles - 1e-6) * search.resolution_cycles
    one = found.contingency.with_clear(f"{point!r}cyc")
    if one in wanted and found.lowest_unstable:
        return found.contingency.with_clear(f"{found.lowest_unstable!r}cyc")
    return one


def _retuned(asked: Asked) -> Find:
    """Stabilizers of the case, retuned for the damping wanted, or as much as possible if that is there."""

    def find(_: Sequence[Contingency]) -> Change:
        study = asked.study
        case, control = study.point.case, study.how.control
        machines = {model: _with_one(case, model) for model in MODELS}
        devices = [_devices(case, model, numbers) for model, numbers in machines.items() if numbers]
        if not devices:
            raise StudyError(f"{case.name} has no stabilizers that can be retuned ({', '.join(MODELS)}).")
        given = {name: asked.running[name] for name in ("workers", "store")}
        damping = study.wanted.damping if study.poorly_damped else None
        tuned = tune(case, devices, damping=damping, **TUNING, **given).case
        assert tuned is not None
        values, told = dict[str, float](), list[str]()
        for model, n in ((model, n) for model, numbers in machines.items() for n in numbers):
            old, new = (one.devices[model][n]._asdict() for one in (case, tuned))
            values |= {f"{model}.{n}.{name}": float(x) for name, x in new.items() if x != old[name]}
            gain = MODELS[model].gain
            told.append(f"{old[gain]:.3g} to {new[gain]:.3g} at machine {case.machine(n).called}")
        words = f"{counted(len(told), 'stabilizer')} retuned, gains {listed(told)}"
        point = operating_point(case.set(values))
        return Change(words, point, control, f"set({values})", None, _times(asked.prices.stabilizer, len(told)))

    return find


def _with_one(case: Case, model: str) -> list[int]:
    """Machines whose only stabilizer is of this model."""
    every = Counter(naming.number(key) for one in tables.of_role("stabilizer") for key in case.devices.get(one, ()))
    return [n for n in map(naming.number, case.devices.get(model, ())) if every[n] == 1]


def _devices(case: Case, model: str, numbers: Sequence[int]) -> Device:
    """What is tuned: the stabilizers of a model at these machines, with gains as large as those that they have."""
    largest = max(abs(getattr(case.devices[model][n], MODELS[model].gain)) for n in numbers)
    return stabilizers(numbers, model=model, gain=max(USUAL_GAIN, largest))


def _stored(asked: Asked) -> Find:
    """The cheapest storage with which contingencies are survived, bang-bang unless the study has a law."""

    def find(wanted: Sequence[Contingency]) -> Change:
        study, costs = asked.study, asked.prices.costs
        assert study.screen is not None
        point, control, how = study.point, acting_in(study.how.control), study.screen.search
        fleet = place(
            point,
            wanted,
            costs=costs or Costs(),
            control=control,
            observe=how.observed_s,
            longest=how.longest_s,
            step=how.step,
            criterion=how.criterion,
            criteria=how.criteria,
            **asked.running,
        )
        devices = *point.case.storage, *fleet.storage()
        sizes = [f"{s.size} MW at bus {s.bus} for machine {s.machine}" for s in fleet.sites]
        return Change(
            listed(sizes) if sizes else "no storage",
            operating_point(point, devices),
            control,
            f"with_storage([{', '.join(f'st.{device!r}' for device in devices)}])",
            fleet.total_mw,
            fleet.cost if costs else None,
            tuple(one.contingency.label for one in fleet.infeasible),
        )

    return find


def _shifted(asked: Asked) -> Find:
    """The smallest shift of power with which contingencies are survived."""
    tried: list[OperatingPoint] = []

    def find(wanted: Sequence[Contingency]) -> Change:
        study = asked.study
        assert study.screen is not None
        found = redispatch(study.point, wanted, study.screen.search, control=study.how.control, tried=tried)
        tried.append(found.point)
        cost = _times(asked.prices.redispatch_mwh, found.mw * asked.prices.hours)
        law = study.how.control
        return Change(found.words, found.point, law, f"set({found.values})", found.mw, cost, found.unsolved)

    return find


def _times(price: float | None, amount: float) -> float | None:
    """The cost of an amount; None without a price."""
    return None if price is None else price * amount
