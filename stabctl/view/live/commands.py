"""The Python and command lines that reproduce what a page shows."""

import shlex
from typing import NamedTuple

from stabctl.model import naming
from stabctl.model.case import Case

from .state import FILE, State


class Source(NamedTuple):
    """How the case was loaded: in Python, and as words of the command line."""

    python: str
    words: tuple[str, ...]
    controllers: tuple[str, ...] = ()  # files
    law: str = ""  # file of a law
    before: str = ""  # Python that comes first


Lines = dict[str, str]


def lines(load: Source, case: Case, state: State) -> dict[str, Lines]:
    """The lines of a run, its critical clearing time and a screen.

    Each in Python, and for the command line if that has an option for every setting.
    """
    before, clear, trip = load.before, f"'{state.clear:g}cyc'", f", trip={state.trip!r}" if state.trip else ""
    system, control = _system(load, case, state)
    found: dict[str, Lines] = {
        "run": {"python": f"{before}{system}.simulate(st.Contingency({state.fault!r}, clear={clear}{trip}){control})"},
        "critical": {"python": f"{before}{system}.clearing_time(st.Contingency({state.fault!r}{trip}){control})"},
        "screen": {"python": f"{before}{system}.screen({control.removeprefix(', ')})"},
    }
    if state.level == 100 and not (state.equipped(case) and state.plain and (state.law == "feedback" or state.delay)):
        fault = ["--fault", state.fault, *(["--trip", state.trip] if state.trip else [])]
        words = {
            "run": ["simulate", *load.words, *fault, "--clear", f"{state.clear:g}cyc"],
            "critical": ["clearing-time", *load.words, *fault],
            "screen": ["screen", *load.words],
        }
        for kind, given in words.items():
            found[kind]["shell"] = shlex.join(["stabctl", *given, *_options(load, case, state)])
    return found


def of_modes(load: Source, case: Case, level: float, gain: str, factor: float) -> Lines:
    """The lines of the modes with a gain of all machines multiplied."""
    model, _, name = gain.partition(".")
    start = f"{load.python}{_level(level)}"
    if factor == 1 or not gain:
        found = {"python": f"{load.before}{start}.modes()"}
        return found if level != 100 else found | {"shell": shlex.join(["stabctl", "modes", *load.words])}
    changed = f"{{f'{model}.{{m}}.{name}': {factor:g} * p.{name} for m, p in case.devices[{model!r}].items()}}"
    found = {"python": f"{load.before}(case := {start}).set({changed}).modes()"}
    if level != 100:
        return found
    rows = case.devices[model].items()
    options = [
        word
        for m, p in rows
        for word in ("--set", f"{model}.{naming.called(case, model, m)}.{name}={factor * getattr(p, name):.10g}")
    ]
    return found | {"shell": shlex.join(["stabctl", "modes", *load.words, *options])}


def of_theory(load: Source, level: float, machine: int | str, cycles: float) -> Lines:
    """The line of the equal areas of a machine."""
    pair = f"equivalent({load.python}{_level(level)}, {machine!r})"
    area = f"from stabctl.theory.two_machine import equivalent; area = {pair}.equal_area({cycles:g})"
    return {"python": f"{load.before}{area}"}


def fleet(case: Case, state: State) -> str | dict[int | str, str]:
    """The storage devices as `with_storage` takes them."""
    if not state.megawatts:
        return f"{state.percent:g}%mva"
    own = {m.machine: state.megawatts.get(m.machine) for m in case.machines}
    listed = {m: f"{state.percent:g}%mva" if mw is None else f"{mw:g}MW" for m, mw in own.items()}
    return {case.called[m]: text for m, text in listed.items() if (state.percent if own[m] is None else own[m])}


def _level(level: float) -> str:
    return f".with_load_level({level / 100:g})" if level != 100 else ""


def _system(load: Source, case: Case, state: State) -> tuple[str, str]:
    """The case with its storage, and the argument for the law."""
    text, acting = f"{load.python}{_level(state.level)}", [f"st.load_controller({name!r})" for name in load.controllers]
    if state.stored:
        model = "" if state.store == "ideal" else f", storage_model={state.store!r}"
        text += f".with_storage({fleet(case, state)!r}{model})"
    if state.equipped(case):
        rate = round(case.frequency_hz)
        sampled = f".sampled({rate}, {state.delay:g} / {rate})" if state.delay else ""
        law = f"st.load_controller({load.law!r})" if state.law == FILE else f"st.{state.plain!r}{sampled}"
        acting = [law, *acting] if state.plain or state.law == FILE else acting
    if not acting:
        return text, ""
    return text, f", control={acting[0]}" if len(acting) == 1 else f", control=[{', '.join(acting)}]"


def _options(load: Source, case: Case, state: State) -> list[str]:
    """Storage, its law and controllers as words of the command line."""
    words = [word for name in load.controllers for word in ("--controller", name)]
    if not state.equipped(case):
        return words
    if state.stored:
        sizes = fleet(case, state)
        at = isinstance(sizes, dict) and ",".join(f"{m}={size}" for m, size in sizes.items())
        words += ["--storage-at", at] if at else ["--storage", str(sizes)]
        words += [] if state.store == "ideal" else ["--storage-model", state.store]
    if state.law == FILE:
        return [*words, "--controller", load.law]
    if state.law == "idle":
        return [*words, "--control", "none"]
    return [*words, *(["--control", state.law] if load.controllers else []), "--deadband", f"{state.deadband / 1e3:g}"]
