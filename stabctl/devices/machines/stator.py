"""What every machine shows its neighbors: currents, torque and terminal voltage."""

from typing import Annotated, NamedTuple


class Input(NamedTuple):
    """What a machine is driven by."""

    Efd: Annotated[float, "pu", "field voltage (GENROU) or internal voltage E' (GENCLS)"]
    Pm: Annotated[float, "pu", "mechanical power, machine base"]


class Output(NamedTuple):
    """Stator algebra, evaluated once per sweep and shared by machine and exciter."""

    id: Annotated[float, "pu", "stator current, d axis, machine base"]
    iq: Annotated[float, "pu", "stator current, q axis, machine base"]
    Te: Annotated[float, "pu", "air-gap torque, machine base"]
    Pt: Annotated[float, "pu", "terminal power, system base"]
    vt: Annotated[float, "pu", "terminal voltage"]
    ve: Annotated[float, "pu", "terminal voltage without the speed factor of the source"]
