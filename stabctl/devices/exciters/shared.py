"""Inputs, outputs and saturation of every exciter."""

from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

from stabctl.devices.blocks import through
from stabctl.devices.ports import PORT, SUM


class Input(NamedTuple):
    """Signals at an exciter."""

    Vref: Annotated[float, "pu", "voltage reference", PORT]
    Vs: Annotated[float, "pu", "stabilizing signal", SUM]
    vt: Annotated[float, "pu", "terminal voltage"]
    ve: Annotated[float, "pu", "supply voltage of the rectifier"]


class LoadedInput(NamedTuple):
    """Signals at an exciter that reads the field current."""

    Vref: Annotated[float, "pu", "voltage reference", PORT]
    Vs: Annotated[float, "pu", "stabilizing signal", SUM]
    vt: Annotated[float, "pu", "terminal voltage"]
    Ifd: Annotated[float, "pu", "field current"]


class CompoundInput(NamedTuple):
    """Signals at an exciter whose source is fed by terminal voltage and current."""

    Vref: Annotated[float, "pu", "voltage reference", PORT]
    Vs: Annotated[float, "pu", "stabilizing signal", SUM]
    vt: Annotated[float, "pu", "terminal voltage"]
    Ifd: Annotated[float, "pu", "field current"]
    delta: Annotated[float, "rad", "rotor angle"]
    id: Annotated[float, "pu", "current, d axis"]
    iq: Annotated[float, "pu", "current, q axis"]


class Output(NamedTuple):
    """Signal of an exciter."""

    Efd: Annotated[float, "pu", "field voltage"]


def gains(p: Any, *pairs: tuple[str, str]) -> Iterator[tuple[str, str]]:
    """Field and message for each pair of gains, proportional and integral, that are both 0: nothing controls then."""
    for first, second in pairs:
        if getattr(p, first) == 0 and getattr(p, second) == 0:
            yield first, f"must be above 0 where {second} = 0"


# Saturation of an exciter through the points (E1, SE1) and (E2, SE2): SE(E) E = SB (E - SA)^2; SE2 = 0: none.


def errors(p: Any) -> Iterator[tuple[str, str]]:
    """Field and message if no such curve goes through the two points."""
    if p.SE2 > 0 and not (p.E2 > p.E1 and p.SE2 * p.E2 > p.SE1 * p.E1):
        yield "SE2", f"must lie above the first point, SE1 = {p.SE1:g} at E1 = {p.E1:g}"


def prepare(p):
    """The parameters, with those of saturation."""
    SA, SB = through(p.E1, p.SE1, p.E2, p.SE2)
    return p._replace(SA=SA, SB=SB)


def ordered(values: dict[str, float]) -> tuple[dict[str, float], list[str]]:
    """The values of a PSS/E record with the two points in order, and what was corrected."""
    E1, SE1, E2, SE2 = (values[name] for name in ("E1", "SE1", "E2", "SE2"))
    if E1 > E2 and SE1 > 0:
        said = f"E1 = {E1:g} is above E2 = {E2:g}: the two points of saturation are exchanged."
        return values | {"E1": E2, "SE1": SE2, "E2": E1, "SE2": SE1}, [said]
    if SE1 > 0 and SE2 == 0:
        return values | {"SE1": 0.0}, [f"SE(E2) = 0 although SE(E1) = {SE1:g}: saturation is left out."]
    return values, []
