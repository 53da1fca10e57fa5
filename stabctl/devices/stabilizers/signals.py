"""Inputs and outputs of the stabilizers of PSS/E, and the choice of their input by a code."""

from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

from stabctl._util.jit import inline

CODES = {0: "none", 1: "speed deviation", 3: "electrical power on the machine's base", 5: "terminal voltage"}


class Input(NamedTuple):
    """Signals at a stabilizer."""

    omega: Annotated[float, "pu", "speed"]
    P: Annotated[float, "pu", "electrical power"]
    vt: Annotated[float, "pu", "terminal voltage"]


class Output(NamedTuple):
    """Signal of a stabilizer."""

    Vs: Annotated[float, "pu", "stabilizing signal"]


@inline
def measured(u, code):
    """The signal of an input code (pu)."""
    if code == 1:
        return u.omega - 1.0
    if code == 3:
        return u.P
    if code == 5:
        return u.vt
    return 0 * u.omega


def unknown(par: Any, *names: str) -> Iterator[tuple[str, str]]:
    """Field and message for each input code that is not supported."""
    for name in names:
        if getattr(par, name) not in CODES:
            yield name, f"must be one of {', '.join(map(str, CODES))}"


def supported(code: float, bus: float, what: str) -> int:
    """The input code of a record. Raises `ValueError` if it, or a remote bus, is not supported."""
    if code not in CODES:
        known = ", ".join(f"{c} ({meaning})" for c, meaning in CODES.items())
        raise ValueError(f"{what} = {code:g} is not supported; the supported input codes are {known}.")
    if bus != 0:
        raise ValueError(f"a remote bus ({bus:g}) for {what} is not supported; it must be 0.")
    return int(code)
