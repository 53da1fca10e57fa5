"""IEEEG1: steam turbine and governor with up to four stages.

omega - 1 -> [K (1+sT2)/(1+sT1)] -> (-)
Pref -----------------------------> (+) -> [1/T3], rate held between Umin and Umax -> [1/s], Pmin to Pmax -> valve
                                    (-) <- valve
valve -> [1/(1+sT4)] -> [1/(1+sT5)] -> [1/(1+sT6)] -> [1/(1+sT7)]
Pm = (K1 + K2) and (K3 + K4), (K5 + K6), (K7 + K8) times the outputs of the four stages

A tandem unit: the shares of the low-pressure shaft K2, K4, K6, K8 act on the same shaft. WSIEG1 is the same without
deadbands and with a straight valve curve.
Source: IEEE Committee Report, IEEE Trans. PAS-92 (1973), fig. 7; PSS/E Model Library, IEEEG1.
"""

from typing import Annotated, Any, NamedTuple

from annotated_types import Ge

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE
from stabctl.devices.blocks import clip, lag, lag_rate, lead_lag, rate_limit

from .shared import Input, Output

NAME = "IEEEG1"
ROLE = "governor"
LIMITS = {"valve": ("Pmin", "Pmax")}
_RECORD = "+JBUS _M K T1 T2 T3 Umax Umin Pmax Pmin T4 K1 K2 T5 K3 K4 T6 K5 K6 T7 K7 K8"
_VALVE = "GV1 PGV1 GV2 PGV2 GV3 PGV3 GV4 PGV4 GV5 PGV5"
DYR = {"IEEEG1": _RECORD, "WSIEG1": f"{_RECORD} DB1 _ERR DB2 {_VALVE} +IBLOCK"}
__all__ = ["DYR", "LIMITS", "NAME", "ROLE", "Input", "Output", "Par", "State", "derivatives", "from_record", "output"]


class Par(NamedTuple):
    """Parameters of one governor, on the machine's base."""

    K: Annotated[float, "pu", "inverse droop 1/R (0: no speed control)", NOT_NEGATIVE]
    T1: Annotated[float, "s", "governor lag", NOT_NEGATIVE]
    T2: Annotated[float, "s", "governor lead", NOT_NEGATIVE]
    T3: Annotated[float, "s", "valve positioner", Ge(1e-3)]
    T4: Annotated[float, "s", "inlet piping and steam bowl", NOT_NEGATIVE]
    K1: Annotated[float, "pu", "share of the first stage"]
    K2: Annotated[float, "pu", "share of the first stage, low-pressure shaft"] = 0.0
    T5: Annotated[float, "s", "second stage (reheater)", NOT_NEGATIVE] = 0.0
    K3: Annotated[float, "pu", "share of the second stage"] = 0.0
    K4: Annotated[float, "pu", "share of the second stage, low-pressure shaft"] = 0.0
    T6: Annotated[float, "s", "third stage (crossover)", NOT_NEGATIVE] = 0.0
    K5: Annotated[float, "pu", "share of the third stage"] = 0.0
    K6: Annotated[float, "pu", "share of the third stage, low-pressure shaft"] = 0.0
    T7: Annotated[float, "s", "fourth stage", NOT_NEGATIVE] = 0.0
    K7: Annotated[float, "pu", "share of the fourth stage"] = 0.0
    K8: Annotated[float, "pu", "share of the fourth stage, low-pressure shaft"] = 0.0
    Umax: Annotated[float, "pu/s", "largest opening rate Uo"] = 0.1
    Umin: Annotated[float, "pu/s", "largest closing rate Uc, negative"] = -0.1
    Pmax: Annotated[float, "pu", "valve limit"] = 1.0
    Pmin: Annotated[float, "pu", "valve limit"] = 0.0


class State(NamedTuple):
    """Governor, valve and stages."""

    governor: Annotated[float, "pu", "lagged speed signal"]
    valve: Annotated[float, "pu", "valve position"]
    one: Annotated[float, "pu", "output of the first stage"]
    two: Annotated[float, "pu", "output of the second stage"]
    three: Annotated[float, "pu", "output of the third stage"]
    four: Annotated[float, "pu", "output of the fourth stage"]


def from_record(kind: str, values: dict[str, Any]) -> tuple[Par, list[str]]:
    """Parameters of a PSS/E record and what was corrected.

    Raises `ValueError` for a cross-compound unit, and for the deadbands, valve curve and blocking of WSIEG1.
    """
    given = dict(values)
    if given.pop("JBUS", 0):
        raise ValueError("a cross-compound unit (JBUS is not 0) is not supported")
    for name, what in (("DB1", "deadband"), ("DB2", "deadband"), ("IBLOCK", "blocking of the valve")):
        if given.pop(name, 0):
            raise ValueError(f"a {what} ({name} is not 0) is not supported")
    if any(given.pop(f"GV{n}", 0) != given.pop(f"PGV{n}", 0) for n in range(1, 6)):
        raise ValueError("a valve curve other than GV = PGV is not supported")
    par = Par(**given)
    total = sum(getattr(par, f"K{n}") for n in range(1, 9))
    if abs(total - 1) <= 0.01:
        return par, []
    return par, [f"K1 to K8 of {kind} sum to {total:g}, not 1; used as given"]


@inline
def stages(x, p):
    """Outputs of the four stages (pu), and the derivatives (1/s) of all but the first."""
    one, _ = lag(p.T4, clip(x.valve, p.Pmin, p.Pmax), x.one)
    two, d_two = lag(p.T5, one, x.two)
    three, d_three = lag(p.T6, two, x.three)
    four, d_four = lag(p.T7, three, x.four)
    return (one, two, three, four), (d_two, d_three, d_four)


@inline
def output(x, p):
    """Mechanical power (pu machine)."""
    (one, two, three, four), _ = stages(x, p)
    return Output((p.K1 + p.K2) * one + (p.K3 + p.K4) * two + (p.K5 + p.K6) * three + (p.K7 + p.K8) * four)


@inline
def derivatives(x, u, p):
    """State derivatives (1/s)."""
    signal, d_governor = lead_lag(p.T2, p.T1, u.omega - 1, x.governor)
    d_valve = rate_limit((u.Pref - p.K * signal - x.valve) / p.T3, p.Umin, p.Umax)
    _, (d_two, d_three, d_four) = stages(x, p)
    d_one = lag_rate(p.T4, x.valve, x.one)
    return State(governor=d_governor, valve=d_valve, one=d_one, two=d_two, three=d_three, four=d_four)
