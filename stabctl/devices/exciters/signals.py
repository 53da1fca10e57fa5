"""Inputs and outputs of every exciter."""

from typing import Annotated, NamedTuple

from stabctl.devices.ports import PORT, SUM


class Input(NamedTuple):
    """Signals at an exciter."""

    Vref: Annotated[float, "pu", "voltage reference", PORT]
    Vs: Annotated[float, "pu", "stabilizing signal", SUM]
    vt: Annotated[float, "pu", "terminal voltage"]
    ve: Annotated[float, "pu", "supply voltage of the rectifier"]


class Output(NamedTuple):
    """Signal of an exciter."""

    Efd: Annotated[float, "pu", "field voltage"]
