"""The Python and command lines that reproduce what a page shows."""

import shlex
from typing import NamedTuple

from stabctl.model.case import Case

from .state import State


class Source(NamedTuple):
    """How the case was loaded: in Python, and as words of the command line."""

    python: str
    words: tuple[str, ...]


def lines(load: Source, case: Case, state: State) -> dict[str, str]:
    """The lines of a run by kind; the command line is left out if it has no option for a setting."""
    beyond = state.level != 100 or (state.plain and (state.law == "feedback" or state.delay))
    return {"python": _python(load, case, state)} | ({} if beyond else {"shell": _shell(load, case, state)})


def fleet(case: Case, state: State) -> str | dict[int, str]:
    """The storage devices as `with_storage` takes them."""
    if not state.megawatts:
        return f"{state.percent:g}%mva"
    sizes = {m.machine: state.megawatts.get(m.machine) for m in case.machines}
    listed = {m: f"{state.percent:g}%mva" if mw is None else f"{mw:g}MW" for m, mw in sizes.items()}
    return {m: text for m, text in listed.items() if not text.startswith("0")}


def _python(load: Source, case: Case, state: State) -> str:
    trip = f", trip={state.trip!r}" if state.trip else ""
    level = f".with_load_level({state.level / 100:g})" if state.level != 100 else ""
    text, control = f"{load.python}{level}", ""
    if state.stored:
        rate = round(case.frequency_hz)
        text += f".with_storage({fleet(case, state)!r})"
        sampled = f".sampled({rate}, {state.delay:g} / {rate})" if state.delay else ""
        control = f", control=st.{state.plain!r}{sampled}" if state.plain else ""
    return f"{text}.simulate(st.Contingency({state.fault!r}, clear='{state.clear:g}cyc'{trip}){control})"


def _shell(load: Source, case: Case, state: State) -> str:
    words = ["stabctl", "simulate", *load.words, "--fault", state.fault, "--clear", f"{state.clear:g}cyc"]
    words += ["--trip", state.trip] if state.trip else []
    if state.stored:
        sizes = fleet(case, state)
        at = isinstance(sizes, dict) and ",".join(f"{m}={size}" for m, size in sizes.items())
        words += ["--storage-at", at] if at else ["--storage", str(sizes)]
        words += ["--control", "none"] if state.law == "idle" else ["--deadband", f"{state.deadband / 1e3:g}"]
    return shlex.join(words)
