"""ST2CUT: power system stabilizer with two inputs, cut off by the terminal voltage.

input 1 -> [K1/(1+sT1)] -> (+) -> [sT3/(1+sT4)] -> [(1+sT5)/(1+sT6)] -> [(1+sT7)/(1+sT8)] -> [(1+sT9)/(1+sT10)]
input 2 -> [K2/(1+sT2)] -> (+)            -> limited Lmin..Lmax -> Vs, 0 while Vt is outside V0 + VCL..V0 + VCU

V0 is the terminal voltage at the start; VCU = VCL = 0 means no cutoff. Each input is chosen by a code: 0 none, 1 speed
deviation, 3 electrical power on the machine's base, 5 terminal voltage.
Source: PSS/E Model Library, ST2CUT.
"""

from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

from annotated_types import Interval

from stabctl._util.jit import inline
from stabctl._util.schema import FROM_CASE, NOT_NEGATIVE
from stabctl.devices.blocks import clip, derivative, lag, lead_lag, while_within

from .signals import Input, Output, measured, supported, unknown

NAME = "ST2CUT"
ROLE = "stabilizer"
LEVELS = ("VCU", "VCL")
DYR = {"ST2CUT": "+code1 +bus1 +code2 +bus2 K1 K2 T1 T2 T3 T4 T5 T6 T7 T8 T9 T10 Lmax Lmin VCU VCL"}
__all__ = [
    "DYR", "LEVELS", "NAME", "ROLE", "Input", "Output", "Par", "State", "automatic", "equations", "from_record",
]  # fmt: skip


class Par(NamedTuple):
    """Parameters of one stabilizer."""

    K1: Annotated[float, "pu", "gain of the first input"]
    K2: Annotated[float, "pu", "gain of the second input"]
    T1: Annotated[float, "s", "lag of the first input", NOT_NEGATIVE]
    T2: Annotated[float, "s", "lag of the second input", NOT_NEGATIVE]
    T3: Annotated[float, "s", "washout, numerator"]
    T4: Annotated[float, "s", "washout, lag (0: no signal)", NOT_NEGATIVE]
    T5: Annotated[float, "s", "first lead"]
    T6: Annotated[float, "s", "first lag", NOT_NEGATIVE]
    T7: Annotated[float, "s", "second lead"]
    T8: Annotated[float, "s", "second lag", NOT_NEGATIVE]
    T9: Annotated[float, "s", "third lead"]
    T10: Annotated[float, "s", "third lag", NOT_NEGATIVE]
    Lmax: Annotated[float, "pu", "output limit"] = 0.1
    Lmin: Annotated[float, "pu", "output limit"] = -0.1
    VCU: Annotated[float, "pu", "rise of the terminal voltage above which the output is 0"] = 0.0
    VCL: Annotated[float, "pu", "change of the terminal voltage below which the output is 0"] = 0.0
    code1: Annotated[int, "-", "first input: 0 none, 1 speed, 3 power, 5 terminal voltage", Interval(ge=0, le=5)] = 1
    code2: Annotated[int, "-", "second input: 0 none, 1 speed, 3 power, 5 terminal voltage", Interval(ge=0, le=5)] = 0
    V0: Annotated[float, "pu", "terminal voltage at the start", FROM_CASE] = 1.0

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        yield from unknown(self, "code1", "code2")


class State(NamedTuple):
    """Two inputs, washout and three lead-lags."""

    in1: Annotated[float, "pu", "first input"]
    in2: Annotated[float, "pu", "second input"]
    washout: Annotated[float, "pu", "slow part of the signal"]
    lag1: Annotated[float, "pu", "lagged signal of the first lead-lag"]
    lag2: Annotated[float, "pu", "lagged signal of the second lead-lag"]
    lag3: Annotated[float, "pu", "lagged signal of the third lead-lag"]


@inline
def equations(x, u, p):
    """Stabilizing signal (pu), and state derivatives (1/s)."""
    one, d_in1 = lag(p.T1, p.K1 * measured(u, p.code1), x.in1)
    two, d_in2 = lag(p.T2, p.K2 * measured(u, p.code2), x.in2)
    fast, d_washout = derivative(p.T3, p.T4, one + two, x.washout)
    first, d_lag1 = lead_lag(p.T5, p.T6, fast, x.lag1)
    second, d_lag2 = lead_lag(p.T7, p.T8, first, x.lag2)
    third, d_lag3 = lead_lag(p.T9, p.T10, second, x.lag3)
    vs = clip(third, p.Lmin, p.Lmax)
    low = p.V0 + p.VCL if p.VCL != 0 else 0.0
    high = p.V0 + p.VCU if p.VCU != 0 else 0.0
    vs = while_within(vs, u.vt, low, high)
    return Output(vs), State(in1=d_in1, in2=d_in2, washout=d_washout, lag1=d_lag1, lag2=d_lag2, lag3=d_lag3)


def automatic(p: Any, u: Any) -> Any:
    """The voltage at the start is that from which the cutoff is measured."""
    return p._replace(V0=u.vt)


def from_record(kind: str, values: dict[str, Any]) -> tuple[Par, list[str]]:
    """Parameters of a PSS/E record, and what was corrected: nothing."""
    codes = {f"code{k}": supported(values[f"code{k}"], values[f"bus{k}"], f"ICS{k}") for k in (1, 2)}
    return Par(**{name: value for name, value in values.items() if name[:3] not in ("cod", "bus")}, **codes), []
