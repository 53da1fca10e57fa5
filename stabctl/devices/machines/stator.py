"""What every machine reads and gives: field voltage and mechanical power in, stator quantities out."""

from typing import Annotated, NamedTuple

from stabctl.devices.ports import PORT


class Input(NamedTuple):
    """Signals at a machine."""

    Efd: Annotated[float, "pu", "field voltage (classical machine: internal voltage E')", PORT]
    Pm: Annotated[float, "pu", "mechanical power, machine base", PORT]


class Output(NamedTuple):
    """Stator quantities, per unit on the machine base."""

    id: Annotated[float, "pu", "stator current, d axis"]
    iq: Annotated[float, "pu", "stator current, q axis"]
    Te: Annotated[float, "pu", "electrical torque (classical machine: air-gap power)"]
    P: Annotated[float, "pu", "active power at the terminals"]
    Q: Annotated[float, "pu", "reactive power at the terminals"]
    vt: Annotated[float, "pu", "terminal voltage"]
    ve: Annotated[float, "pu", "terminal voltage less that of the speed deviation, supply of a rectifier exciter"]
    Ifd: Annotated[float, "pu", "field current, Xad Ifd (classical machine: E')"]
    Ilq: Annotated[float, "pu", "q-axis rotor current, Xaq I1q"]
