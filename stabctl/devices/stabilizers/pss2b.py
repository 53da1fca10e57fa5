"""PSS2B: power system stabilizer with two inputs, usually speed and power (IEEE type PSS2B; PSS2A is a special case).

input 1, limited -> [sTW1/(1+sTW1)] -> [sTW2/(1+sTW2)] -> [1/(1+sT6)] -> (+) -> [(1+sT8)/(1+sT9)^M]^N -> (+) -> KS1
input 2, limited -> [sTW3/(1+sTW3)] -> [sTW4/(1+sTW4)] -> [KS2/(1+sT7)] -> x KS3 (+)                     (-)
                                                                        -> --------------------------->
-> [(1+sT1)/(1+sT2)] -> [(1+sT3)/(1+sT4)] -> [(1+sT10)/(1+sT11)] -> limited VSTmin..VSTmax -> Vs

A washout with a zero time constant is bypassed. M N is at most 8. Each input is chosen by a code: 1 speed deviation,
3 electrical power on the machine's base, 5 terminal voltage.
Source: IEEE Std 421.5, types PSS2A and PSS2B; PSS/E Model Library, PSS2A and PSS2B.
"""

from collections.abc import Iterator
from typing import Annotated, Any, NamedTuple

from annotated_types import Interval

from stabctl._util.jit import inline
from stabctl._util.schema import NOT_NEGATIVE
from stabctl.devices.blocks import clip, lag, lag_rate, lead_lag, washout

from .signals import Input, Output, measured, supported

NAME = "PSS2B"
ROLE = "stabilizer"
STAGES = 8  # of the ramp-tracking filter
_FIRST = "+code1 +bus1 +code2 +bus2 +M +N TW1 TW2 T6 TW3 TW4 T7 KS2 KS3 T8 T9 KS1 T1 T2 T3 T4"
DYR = {
    "PSS2A": f"{_FIRST} VSTmax VSTmin",
    "PSS2B": f"{_FIRST} T10 T11 VS1max VS1min VS2max VS2min VSTmax VSTmin",
}
__all__ = ["DYR", "NAME", "ROLE", "Input", "Output", "Par", "State", "derivatives", "from_record", "output"]


class Par(NamedTuple):
    """Parameters of one stabilizer."""

    TW1: Annotated[float, "s", "first washout of input 1", NOT_NEGATIVE]
    TW2: Annotated[float, "s", "second washout of input 1", NOT_NEGATIVE]
    T6: Annotated[float, "s", "lag of input 1", NOT_NEGATIVE]
    TW3: Annotated[float, "s", "first washout of input 2", NOT_NEGATIVE]
    TW4: Annotated[float, "s", "second washout of input 2", NOT_NEGATIVE]
    T7: Annotated[float, "s", "lag of input 2", NOT_NEGATIVE]
    KS2: Annotated[float, "pu", "gain of input 2"]
    KS3: Annotated[float, "pu", "share of input 2 in the ramp-tracking filter"]
    T8: Annotated[float, "s", "lead of the ramp-tracking filter", NOT_NEGATIVE]
    T9: Annotated[float, "s", "lag of the ramp-tracking filter", NOT_NEGATIVE]
    KS1: Annotated[float, "pu", "gain"]
    T1: Annotated[float, "s", "first lead"]
    T2: Annotated[float, "s", "first lag", NOT_NEGATIVE]
    T3: Annotated[float, "s", "second lead"]
    T4: Annotated[float, "s", "second lag", NOT_NEGATIVE]
    T10: Annotated[float, "s", "third lead"] = 0.0
    T11: Annotated[float, "s", "third lag", NOT_NEGATIVE] = 0.0
    VS1max: Annotated[float, "pu", "limit of input 1"] = 999.0
    VS1min: Annotated[float, "pu", "limit of input 1"] = -999.0
    VS2max: Annotated[float, "pu", "limit of input 2"] = 999.0
    VS2min: Annotated[float, "pu", "limit of input 2"] = -999.0
    VSTmax: Annotated[float, "pu", "output limit"] = 0.1
    VSTmin: Annotated[float, "pu", "output limit"] = -0.1
    M: Annotated[int, "-", "lags of each stage of the ramp-tracking filter", Interval(ge=0, le=STAGES)] = 5
    N: Annotated[int, "-", "stages of the ramp-tracking filter", Interval(ge=0, le=STAGES)] = 1
    code1: Annotated[int, "-", "input 1: 0 none, 1 speed, 3 power, 5 terminal voltage", Interval(ge=0, le=5)] = 1
    code2: Annotated[int, "-", "input 2: 0 none, 1 speed, 3 power, 5 terminal voltage", Interval(ge=0, le=5)] = 3

    def errors(self) -> Iterator[tuple[str, str]]:
        """Field and message for each parameter that the equations do not allow."""
        if self.M * self.N > STAGES:
            yield "M", f"times N = {self.N} is more than the {STAGES} lags that are supported"


class State(NamedTuple):
    """Washouts and lags of the inputs, the ramp-tracking filter, and the lead-lags."""

    slow1: Annotated[float, "pu", "slow part of input 1"]
    slow2: Annotated[float, "pu", "slow part of its first washout"]
    in1: Annotated[float, "pu", "lagged input 1"]
    slow3: Annotated[float, "pu", "slow part of input 2"]
    slow4: Annotated[float, "pu", "slow part of its first washout"]
    in2: Annotated[float, "pu", "lagged input 2"]
    r1: Annotated[float, "pu", "ramp-tracking filter, lag 1"]
    r2: Annotated[float, "pu", "ramp-tracking filter, lag 2"]
    r3: Annotated[float, "pu", "ramp-tracking filter, lag 3"]
    r4: Annotated[float, "pu", "ramp-tracking filter, lag 4"]
    r5: Annotated[float, "pu", "ramp-tracking filter, lag 5"]
    r6: Annotated[float, "pu", "ramp-tracking filter, lag 6"]
    r7: Annotated[float, "pu", "ramp-tracking filter, lag 7"]
    r8: Annotated[float, "pu", "ramp-tracking filter, lag 8"]
    lag1: Annotated[float, "pu", "lagged signal of the first lead-lag"]
    lag2: Annotated[float, "pu", "lagged signal of the second lead-lag"]
    lag3: Annotated[float, "pu", "lagged signal of the third lead-lag"]


class Inner(NamedTuple):
    """Signals between the blocks."""

    s1: float
    w1: float
    w2: float
    s2: float
    w3: float
    w4: float
    ramp: float  # input of the ramp-tracking filter
    direct: float  # input 2, subtracted after it


@inline
def inputs(x, u, p):
    """Signals of the two inputs up to the ramp-tracking filter (pu)."""
    s1 = clip(measured(u, p.code1), p.VS1min, p.VS1max)
    w1 = washout(p.TW1, s1, x.slow1)
    w2 = washout(p.TW2, w1, x.slow2)
    s2 = clip(measured(u, p.code2), p.VS2min, p.VS2max)
    w3 = washout(p.TW3, s2, x.slow3)
    w4 = p.KS2 * washout(p.TW4, w3, x.slow4)
    direct = lag(p.T7, w4, x.in2)
    return Inner(s1, w1, w2, s2, w3, w4, lag(p.T6, w2, x.in1) + p.KS3 * direct, direct)


@inline
def stage(k, p, u, x):
    """Lag k of the ramp-tracking filter, with the lead where one of its N stages begins."""
    if k >= p.M * p.N:
        return u
    return lead_lag(p.T8, p.T9, u, x) if k % p.M == 0 else lag(p.T9, u, x)


@inline
def stage_rate(k, p, u, x):
    """State derivative (1/s) of `stage`."""
    return lag_rate(p.T9, u, x) if k < p.M * p.N else 0 * x


@inline
def tracked(x, p, ramp):
    """Signals after each lag of the ramp-tracking filter (pu)."""
    a = stage(0, p, ramp, x.r1)
    b = stage(1, p, a, x.r2)
    c = stage(2, p, b, x.r3)
    d = stage(3, p, c, x.r4)
    e = stage(4, p, d, x.r5)
    f = stage(5, p, e, x.r6)
    g = stage(6, p, f, x.r7)
    return a, b, c, d, e, f, g, stage(7, p, g, x.r8)


@inline
def leads(x, p, signal):
    """Signals after each lead-lag (pu)."""
    first = lead_lag(p.T1, p.T2, signal, x.lag1)
    second = lead_lag(p.T3, p.T4, first, x.lag2)
    return first, second, lead_lag(p.T10, p.T11, second, x.lag3)


@inline
def output(x, u, p):
    """Stabilizing signal (pu)."""
    i = inputs(x, u, p)
    signal = p.KS1 * (tracked(x, p, i.ramp)[7] - i.direct)
    return Output(clip(leads(x, p, signal)[2], p.VSTmin, p.VSTmax))


@inline
def derivatives(x, u, p):
    """State derivatives (1/s)."""
    i = inputs(x, u, p)
    a, b, c, d, e, f, g, last = tracked(x, p, i.ramp)
    signal = p.KS1 * (last - i.direct)
    first, second, _ = leads(x, p, signal)
    return State(
        lag_rate(p.TW1, i.s1, x.slow1),
        lag_rate(p.TW2, i.w1, x.slow2),
        lag_rate(p.T6, i.w2, x.in1),
        lag_rate(p.TW3, i.s2, x.slow3),
        lag_rate(p.TW4, i.w3, x.slow4),
        lag_rate(p.T7, i.w4, x.in2),
        stage_rate(0, p, i.ramp, x.r1),
        stage_rate(1, p, a, x.r2),
        stage_rate(2, p, b, x.r3),
        stage_rate(3, p, c, x.r4),
        stage_rate(4, p, d, x.r5),
        stage_rate(5, p, e, x.r6),
        stage_rate(6, p, f, x.r7),
        stage_rate(7, p, g, x.r8),
        lag_rate(p.T2, signal, x.lag1),
        lag_rate(p.T4, first, x.lag2),
        lag_rate(p.T11, second, x.lag3),
    )


def from_record(kind: str, values: dict[str, Any]) -> tuple[Par, list[str]]:
    """Parameters of a PSS/E record, and what was corrected: nothing."""
    whole = {f"code{k}": supported(values[f"code{k}"], values[f"bus{k}"], f"ICS{k}") for k in (1, 2)}
    whole |= {name: int(values[name]) for name in ("M", "N")}
    return Par(**{name: values[name] for name in Par._fields if name in values and name not in whole}, **whole), []
