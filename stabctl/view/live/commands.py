"""The Python and command lines that reproduce what a page shows."""

import shlex
from typing import NamedTuple

from stabctl.model.case import Case

from .state import State


class Source(NamedTuple):
    """How the case was loaded: in Python, and as words of the command line."""

    python: str
    words: tuple[str, ...]


Lines = dict[str, str]


def lines(load: Source, case: Case, state: State) -> dict[str, Lines]:
    """The lines of a run, its critical clearing time and a screen.

    Each in Python, and for the command line if that has an option for every setting.
    """
    clear, trip = f"'{state.clear:g}cyc'", f", trip={state.trip!r}" if state.trip else ""
    system, control = _system(load, case, state)
    found: dict[str, Lines] = {
        "run": {"python": f"{system}.simulate(st.Contingency({state.fault!r}, clear={clear}{trip}){control})"},
        "critical": {"python": f"{system}.clearing_time(st.Contingency({state.fault!r}{trip}){control})"},
        "screen": {"python": f"{system}.screen({control.removeprefix(', ')})"},
    }
    if state.level == 100 and not (state.plain and (state.law == "feedback" or state.delay)):
        fault = ["--fault", state.fault, *(["--trip", state.trip] if state.trip else [])]
        words = {
            "run": ["simulate", *load.words, *fault, "--clear", f"{state.clear:g}cyc"],
            "critical": ["clearing-time", *load.words, *fault],
            "screen": ["screen", *load.words],
        }
        for kind, given in words.items():
            found[kind]["shell"] = shlex.join(["stabctl", *given, *_options(case, state)])
    return found


def of_modes(load: Source, case: Case, level: float, gain: str, factor: float) -> Lines:
    """The lines of the modes with a gain of all machines multiplied."""
    model, _, name = gain.partition(".")
    start = f"{load.python}{_level(level)}"
    if factor == 1 or not gain:
        found = {"python": f"{start}.modes()"}
        return found if level != 100 else found | {"shell": shlex.join(["stabctl", "modes", *load.words])}
    changed = f"{{f'{model}.{{m}}.{name}': {factor:g} * p.{name} for m, p in case.devices[{model!r}].items()}}"
    found = {"python": f"(case := {start}).set({changed}).modes()"}
    if level != 100:
        return found
    rows = case.devices[model].items()
    options = [word for m, p in rows for word in ("--set", f"{model}.{m}.{name}={factor * getattr(p, name):.10g}")]
    return found | {"shell": shlex.join(["stabctl", "modes", *load.words, *options])}


def of_theory(load: Source, level: float, machine: int, cycles: float) -> Lines:
    """The line of the equal areas of a machine."""
    pair = f"equivalent({load.python}{_level(level)}, {machine})"
    return {"python": f"from stabctl.theory.two_machine import equivalent; area = {pair}.equal_area({cycles:g})"}


def fleet(case: Case, state: State) -> str | dict[int, str]:
    """The storage devices as `with_storage` takes them."""
    if not state.megawatts:
        return f"{state.percent:g}%mva"
    sizes = {m.machine: state.megawatts.get(m.machine) for m in case.machines}
    listed = {m: f"{state.percent:g}%mva" if mw is None else f"{mw:g}MW" for m, mw in sizes.items()}
    return {m: text for m, text in listed.items() if not text.startswith("0")}


def _level(level: float) -> str:
    return f".with_load_level({level / 100:g})" if level != 100 else ""


def _system(load: Source, case: Case, state: State) -> tuple[str, str]:
    """The case with its storage, and the argument for the law."""
    text, control = f"{load.python}{_level(state.level)}", ""
    if state.stored:
        rate = round(case.frequency_hz)
        text += f".with_storage({fleet(case, state)!r})"
        sampled = f".sampled({rate}, {state.delay:g} / {rate})" if state.delay else ""
        control = f", control=st.{state.plain!r}{sampled}" if state.plain else ""
    return text, control


def _options(case: Case, state: State) -> list[str]:
    """Storage and its law as words of the command line."""
    if not state.stored:
        return []
    sizes = fleet(case, state)
    at = isinstance(sizes, dict) and ",".join(f"{m}={size}" for m, size in sizes.items())
    words = ["--storage-at", at] if at else ["--storage", str(sizes)]
    return words + (["--control", "none"] if state.law == "idle" else ["--deadband", f"{state.deadband / 1e3:g}"])
