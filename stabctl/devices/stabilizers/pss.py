"""PSS: power system stabilizer with speed input.

omega - 1 -> [K] -> [sTw/(1+sTw)] -> [(1+sT1)/(1+sT2)] -> [(1+sT3)/(1+sT4)] -> limited Vmin..Vmax -> Vs

With Vmin = -Vmax it is the STAB1 of PSS/E, whose constants are K (K/T there), Tw, T1/T2, T2, T3/T4, T4 and Vmax.
Source: Kundur, Power System Stability and Control, section 12.5; IEEE Std 421.5, type PSS1A without its A1, A2 filter;
PSS/E Model Library, STAB1.
"""

from typing import Annotated, NamedTuple

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE
from stabctl.devices.blocks import SHORT, clip, lag_rate, lead_lag

NAME = "PSS"
ROLE = "stabilizer"
DYR = {"STAB1": "K Tw T1_over_T2 T2 T3_over_T4 T4 Vmax"}


class Par(NamedTuple):
    """Parameters of one stabilizer."""

    K: Annotated[float, "pu", "gain, signal over speed deviation"]
    Tw: Annotated[float, "s", "washout", NOT_NEGATIVE]
    T1: Annotated[float, "s", "first lead", NOT_NEGATIVE]
    T2: Annotated[float, "s", "first lag", NOT_NEGATIVE]
    T3: Annotated[float, "s", "second lead", NOT_NEGATIVE]
    T4: Annotated[float, "s", "second lag", NOT_NEGATIVE]
    Vmax: Annotated[float, "pu", "output limit"] = 0.1
    Vmin: Annotated[float, "pu", "output limit"] = -0.1


class State(NamedTuple):
    """Washout and two lead-lags."""

    washout: Annotated[float, "pu", "slow part of the speed"]
    lag1: Annotated[float, "pu", "lagged signal of the first lead-lag"]
    lag2: Annotated[float, "pu", "lagged signal of the second lead-lag"]


class Input(NamedTuple):
    """Signals at a stabilizer."""

    omega: Annotated[float, "pu", "speed"]


class Output(NamedTuple):
    """Signal of a stabilizer."""

    Vs: Annotated[float, "pu", "stabilizing signal"]


@inline
def equations(x, u, p):
    """Stabilizing signal (pu), and state derivatives (1/s)."""
    fast = p.K * (u.omega - (x.washout if p.Tw >= SHORT else 1.0))
    first, d_lag1 = lead_lag(p.T1, p.T2, fast, x.lag1)
    second, d_lag2 = lead_lag(p.T3, p.T4, first, x.lag2)
    d_washout = lag_rate(p.Tw, u.omega, x.washout)
    return Output(clip(second, p.Vmin, p.Vmax)), State(washout=d_washout, lag1=d_lag1, lag2=d_lag2)


def from_record(kind: str, values: dict[str, float]) -> tuple[Par, list[str]]:
    """Parameters of a PSS/E record, and what was corrected: nothing."""
    Tw, T2, T4, limit = (values[name] for name in ("Tw", "T2", "T4", "Vmax"))
    T1, T3 = values["T1_over_T2"] * T2, values["T3_over_T4"] * T4
    return Par(values["K"], Tw, T1, T2, T3, T4, limit, -limit), []
