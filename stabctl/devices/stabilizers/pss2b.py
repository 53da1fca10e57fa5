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
from stabctl.devices.blocks import clip, lag, lead_lag, washout

from .signals import Input, Output, measured, supported, unknown

NAME = "PSS2B"
ROLE = "stabilizer"
STAGES = 8  # of the ramp-tracking filter
_FIRST = "+code1 +bus1 +code2 +bus2 +M +N TW1 TW2 T6 TW3 TW4 T7 KS2 KS3 T8 T9 KS1 T1 T2 T3 T4"
DYR = {
    "PSS2A": f"{_FIRST} VSTmax VSTmin",
    "PSS2B": f"{_FIRST} T10 T11 VS1max VS1min VS2max VS2min VSTmax VSTmin",
}
__all__ = ["DYR", "NAME", "ROLE", "Input", "Output", "Par", "State", "equations", "from_record"]


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
        yield from unknown(self, "code1", "code2")
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


@inline
def tracked(k, p, u, x):
    """Lag k of the ramp-tracking filter, with the lead where one of its N stages begins: u -> y, state x."""
    if k >= p.M * p.N:
        return u, 0 * x
    return lead_lag(p.T8, p.T9, u, x) if k % p.M == 0 else lag(p.T9, u, x)


@inline
def equations(x, u, p):
    """Stabilizing signal (pu), and state derivatives (1/s)."""
    one, d_slow1 = washout(p.TW1, clip(measured(u, p.code1), p.VS1min, p.VS1max), x.slow1)
    one, d_slow2 = washout(p.TW2, one, x.slow2)
    one, d_in1 = lag(p.T6, one, x.in1)

    two, d_slow3 = washout(p.TW3, clip(measured(u, p.code2), p.VS2min, p.VS2max), x.slow3)
    two, d_slow4 = washout(p.TW4, two, x.slow4)
    two, d_in2 = lag(p.T7, p.KS2 * two, x.in2)

    ramp, d_r1 = tracked(0, p, one + p.KS3 * two, x.r1)
    ramp, d_r2 = tracked(1, p, ramp, x.r2)
    ramp, d_r3 = tracked(2, p, ramp, x.r3)
    ramp, d_r4 = tracked(3, p, ramp, x.r4)
    ramp, d_r5 = tracked(4, p, ramp, x.r5)
    ramp, d_r6 = tracked(5, p, ramp, x.r6)
    ramp, d_r7 = tracked(6, p, ramp, x.r7)
    ramp, d_r8 = tracked(7, p, ramp, x.r8)

    signal, d_lag1 = lead_lag(p.T1, p.T2, p.KS1 * (ramp - two), x.lag1)
    signal, d_lag2 = lead_lag(p.T3, p.T4, signal, x.lag2)
    signal, d_lag3 = lead_lag(p.T10, p.T11, signal, x.lag3)
    return Output(clip(signal, p.VSTmin, p.VSTmax)), State(
        slow1=d_slow1, slow2=d_slow2, in1=d_in1, slow3=d_slow3, slow4=d_slow4, in2=d_in2,
        r1=d_r1, r2=d_r2, r3=d_r3, r4=d_r4, r5=d_r5, r6=d_r6, r7=d_r7, r8=d_r8,
        lag1=d_lag1, lag2=d_lag2, lag3=d_lag3,
    )  # fmt: skip


def from_record(kind: str, values: dict[str, Any]) -> tuple[Par, list[str]]:
    """Parameters of a PSS/E record, and what was corrected: nothing."""
    whole = {f"code{k}": supported(values[f"code{k}"], values[f"bus{k}"], f"ICS{k}") for k in (1, 2)}
    whole |= {name: int(values[name]) for name in ("M", "N")}
    return Par(**{name: values[name] for name in Par._fields if name in values and name not in whole}, **whole), []
