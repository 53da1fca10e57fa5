"""Inputs and output of every governor."""

from typing import Annotated, NamedTuple

from stabctl.devices.ports import PORT


class Input(NamedTuple):
    """Signals at a governor with a load reference."""

    Pref: Annotated[float, "pu", "load reference", PORT]
    omega: Annotated[float, "pu", "speed"]


class Metered(NamedTuple):
    """Signals at a governor with a load reference that measures the electrical power."""

    Pref: Annotated[float, "pu", "load reference", PORT]
    omega: Annotated[float, "pu", "speed"]
    P: Annotated[float, "pu", "electrical power, machine base"]


class Output(NamedTuple):
    """Signal of a governor."""

    Pm: Annotated[float, "pu", "mechanical power, machine base"]
