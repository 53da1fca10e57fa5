"""Inputs and outputs of every exciter."""

from typing import Annotated, NamedTuple

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
