"""Two systems without symmetry as islands of one: no two numbers of theirs are equal, and of everything there are two.

Machines 1021 and 1022 stand at bus 1001, 1023 at bus 1003 (swing) and 1024 at bus 1004.
Storage has other ratings, energies, ramps, lags and characteristics at each machine.
"""

from dataclasses import replace
from functools import cache

from islands import SHIFT, joined
from systems import CLASSICAL, EXDC2, EXST3, HYDRO, IEEET1, PSS, ROUND, SATURATED, STEAM
from uneven import BASE, HZ, uneven

from stabctl.dynamics import operating_point
from stabctl.model.case import Case
from stabctl.model.tables import Branch, Bus, Load, Machine, Storage


def second():
    """The second island, by itself."""
    return Case(
        name="second",
        buses=(
            Bus(1, "pv", 1.022, 4.0, rated=13.8),
            Bus(2, "pq", 0.99, -3.0, 1.5, 22.0, rated=115.0, name="yard"),
            Bus(3, "swing", 1.011, 2.0, rated=18.0),
            Bus(4, "pv", 1.007, 1.0, rated=11.0),
            Bus(5, "pq", 0.97, -7.0, 0.8, 17.0, rated=115.0),
        ),
        branches=(
            Branch(1, 2, 0.0021, 0.043, 0.013, 1.03, 2.0),
            Branch(2, 3, 0.007, 0.067, 0.12, 1.0, 0.0, "1", 0.001, 0.011, 0.002, -0.007),
            Branch(2, 3, 0.009, 0.081, 0.09, 1.0, 0.0, "2"),
            Branch(4, 5, 0.0034, 0.058, 0.017, 0.985, -2.5),
            Branch(5, 2, 0.014, 0.097, 0.16),
            Branch(3, 5, 0.011, 0.088, 0.14),
        ),
        machines=(
            Machine(21, 1, 270.0, 131.0, 2, 5.0, "north"),
            Machine(22, 1, 140.0, 57.0, 2, -3.0),
            Machine(23, 3, 640.0, 80.0, 2),
            Machine(24, 4, 210.0, 73.0, 5),
        ),
        devices={
            "genrou": {
                21: SATURATED._replace(H=3.3, D=0.4, xd=1.71),
                22: ROUND._replace(H=2.4, D=0.9, T1d=5.9),
                24: SATURATED._replace(H=3.7, D=0.7, xd=1.93, S12=0.35),
            },
            "gencls": {23: CLASSICAL._replace(H=5.2, D=1.3, x1d=0.24)},
            "exst3": {21: EXST3},
            "exdc2": {24: EXDC2},
            "ieeet1": {22: IEEET1},
            "pss": {21: PSS._replace(K=4.0), 24: PSS._replace(K=2.0, T1=0.06)},
            "tgov": {21: STEAM._replace(K=18.0), 24: HYDRO._replace(K=14.0)},
        },
        loads=(
            Load(2, 152.0, 41.0, 0.2, 0.15, 0.35, 0.4, 0.55, id="m"),
            Load(5, 137.0, 33.0, 0.4, 0.3, 0.15, 0.2, 0.62, 1.01),
            Load(3, 59.0, 14.0, id="z"),
        ),
        storage=(
            Storage(21, 2, 17.0, "power", 0.04, 0.55, 240.0, 0.02, 0.86),
            Storage(24, 5, 11.0, "current", 0.03, 0.45, 150.0, 0.04, 0.92, 13.0),
        ),
        base_mva=BASE,
        frequency_hz=HZ,
    )


def mixed():
    """Both islands."""
    return joined(uneven(), second())


@cache
def mixed_point():
    """Their operating point."""
    return operating_point.solve(mixed())


@cache
def without_ramps():
    """The same without ramp limits of storage, which controllers of orders do not keep."""
    case = mixed()
    return operating_point.solve(replace(case, storage=tuple(s._replace(ramp=0.0) for s in case.storage)))


NORTH = 21 + SHIFT
