"""IEEEST: power system stabilizer with one input.

input -> [1/(1 + sA3 + s^2 A4)] -> [(1 + sA5 + s^2 A6)/(1 + sA1 + s^2 A2)] -> [(1+sT1)/(1+sT2)] -> [(1+sT3)/(1+sT4)]
      -> [KS sT5/(1+sT6)] -> limited Lmin..Lmax -> Vs, 0 while Vt is outside VCL..VCU

The input is chosen by a code: 1 speed deviation, 3 electrical power on the machine's base, 5 terminal voltage. A second
order block with a zero leading coefficient is one of first order. VCU = 0 means no upper bound. With T6 = 0 the washout
is a gain.
Source: IEEE Std 421.5, type PSS1A; PSS/E Model Library, IEEEST.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

from annotated_types import Interval

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE
from stabctl.devices.blocks import SHORT, clip, lag_rate, lead_lag, second_order, while_within

from .signals import Input, Output, measured, supported, unknown

NAME = "IEEEST"
ROLE = "stabilizer"
LEVELS = ("VCU", "VCL")
DYR = {"IEEEST": "+code +bus A1 A2 A3 A4 A5 A6 T1 T2 T3 T4 T5 T6 KS Lmax Lmin VCU VCL"}
__all__ = ["DYR", "LEVELS", "NAME", "ROLE", "Input", "Output", "Par", "State", "equations", "from_record"]


class Par(NamedTuple):
    """Parameters of one stabilizer."""

    A1: Annotated[float, "s", "filter, second denominator", NOT_NEGATIVE]
    A2: Annotated[float, "s^2", "filter, second denominator", NOT_NEGATIVE]
    A3: Annotated[float, "s", "filter, first denominator", NOT_NEGATIVE]
    A4: Annotated[float, "s^2", "filter, first denominator", NOT_NEGATIVE]
    A5: Annotated[float, "s", "filter, numerator"]
    A6: Annotated[float, "s^2", "filter, numerator"]
    T1: Annotated[float, "s", "first lead"]
    T2: Annotated[float, "s", "first lag", NOT_NEGATIVE]
    T3: Annotated[float, "s", "second lead"]
    T4: Annotated[float, "s", "second lag", NOT_NEGATIVE]
    T5: Annotated[float, "s", "washout, numerator"]
    T6: Annotated[float, "s", "washout, lag", NOT_NEGATIVE]
    KS: Annotated[float, "pu", "gain"]
    Lmax: Annotated[float, "pu", "output limit"] = 0.1
    Lmin: Annotated[float, "pu", "output limit"] = -0.1
    VCU: Annotated[float, "pu", "terminal voltage above which the output is 0 (0: none)", NOT_NEGATIVE] = 0.0
    VCL: Annotated[float, "pu", "terminal voltage below which the output is 0", NOT_NEGATIVE] = 0.0
    code: Annotated[int, "-", "input: 1 speed, 3 power, 5 terminal voltage", Interval(ge=0, le=5)] = 1

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        yield from unknown(self, "code")


class State(NamedTuple):
    """Two filters, two lead-lags and washout."""

    f1: Annotated[float, "pu", "first filter"]
    df1: Annotated[float, "pu/s", "rate of the first filter"]
    f2: Annotated[float, "pu", "second filter"]
    df2: Annotated[float, "pu/s", "rate of the second filter"]
    lag1: Annotated[float, "pu", "lagged signal of the first lead-lag"]
    lag2: Annotated[float, "pu", "lagged signal of the second lead-lag"]
    washout: Annotated[float, "pu", "slow part of the signal"]


@inline
def equations(x, u, p):
    """Stabilizing signal (pu), and state derivatives (1/s)."""
    signal, d_f1, d_df1 = second_order(0.0, 0.0, p.A3, p.A4, measured(u, p.code), x.f1, x.df1)
    signal, d_f2, d_df2 = second_order(p.A5, p.A6, p.A1, p.A2, signal, x.f2, x.df2)
    signal, d_lag1 = lead_lag(p.T1, p.T2, signal, x.lag1)
    signal, d_lag2 = lead_lag(p.T3, p.T4, signal, x.lag2)
    vs = p.KS * (p.T5 / p.T6 * (signal - x.washout) if p.T6 >= SHORT else signal)
    vs = while_within(clip(vs, p.Lmin, p.Lmax), u.vt, p.VCL, p.VCU)
    d_washout = lag_rate(p.T6, signal, x.washout)
    return Output(vs), State(f1=d_f1, df1=d_df1, f2=d_f2, df2=d_df2, lag1=d_lag1, lag2=d_lag2, washout=d_washout)


def from_record(kind: str, values: dict[str, float]) -> tuple[Par, list[str]]:
    """Parameters of a PSS/E record, and what was corrected: nothing."""
    code = supported(values["code"], values["bus"], "ICS")
    return Par(**{name: values[name] for name in Par._fields if name != "code"}, code=code), []
