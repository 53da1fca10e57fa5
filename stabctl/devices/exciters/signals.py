"""What every exciter sees."""

from typing import Annotated, NamedTuple


class Input(NamedTuple):
    """Signals at an exciter."""

    vref: Annotated[float, "pu", "voltage reference (set-point)"]
    vs: Annotated[float, "pu", "stabilizing signal"]
    vt: Annotated[float, "pu", "terminal voltage"]
    ve: Annotated[float, "pu", "supply voltage of the rectifier"]
