"""A system without symmetry: 50 Hz, 137 MVA, no two numbers equal, several machines at a bus, parallel circuits that
differ, a phase shifter, shunts at buses and at ends of branches, loads of several kinds, a link, limited storage.
"""

from functools import cache

from systems import CLASSICAL, PSS, ROUND, SATURATED, SEXS, STEAM

from stabctl.dynamics import operating_point
from stabctl.model.case import Case
from stabctl.model.tables import Branch, Bus, Link, Load, Machine, Storage

HZ, BASE = 50.0, 137.0

STORAGE = (
    Storage(3, 30, 21.0, "power", 0.05, 0.4, 300.0, 0.03, 0.81, 26.0),
    Storage(7, 20, 14.0, "current", 0.02, 0.7, 0.0, 0.0, 0.64),
    Storage(12, 40, 9.0, "conductance", 0.03, 0.6, 200.0, 0.05, 0.9),
)


def uneven(storage=STORAGE):
    """Machines 7 and 3 at bus 20 (pv), 12 at bus 10 (swing), 5 at bus 50 (pq)."""
    flags = dict.fromkeys((12, 5), CLASSICAL._replace(ra=0.004, x1d=0.27))
    flags[5] = flags[5]._replace(H=2.9, D=1.7, x1d=0.36)
    return Case(
        name="uneven",
        buses=(
            Bus(40, "pq", 0.98, -4.0, 6.0, 31.0, rated=110.0),
            Bus(10, "swing", 1.03, 7.0, rated=20.0),
            Bus(20, "pv", 1.015, 3.0, rated=15.0),
            Bus(30, "pq", 1.0, 0.0, 2.5, -12.0, rated=220.0, name="hub"),
            Bus(50, "pq", 1.0, -2.0, rated=10.0),
        ),
        branches=(
            Branch(10, 30, 0.003, 0.051, 0.02, 1.04, 4.0, "", 0.003, 0.018, 0.001, -0.009),
            Branch(30, 10, 0.004, 0.062, 0.03, 0.97, -3.0),
            Branch(20, 30, 0.002, 0.038, 0.011, 1.02),
            Branch(20, 30, 0.006, 0.049, 0.017, 1.0, 0.0, "1", 0.004, 0.013, 0.007, -0.021),
            Branch(40, 30, 0.012, 0.11, 0.23, 1.0, 0.0, "1", 0.002, -0.015, 0.003, 0.024),
            Branch(30, 40, 0.017, 0.14, 0.29),
            Branch(50, 40, 0.005, 0.07, 0.0, 0.99, 1.5),
        ),
        machines=(
            Machine(7, 20, 310.0, 150.0, 20, 12.0),
            Machine(3, 20, 190.0, 61.0, 30, -7.0),
            Machine(12, 10, 830.0, 90.0, 40),
            Machine(5, 50, 120.0, 43.0, 50, 9.0),
        ),
        devices={
            "gencls": flags,
            "genrou": {7: SATURATED, 3: ROUND._replace(H=2.7, D=0.6, xd=1.6, x1d=0.26, ra=0.002)},
            "sexs": {7: SEXS, 3: SEXS._replace(KA=120.0, TA=0.04)},
            "pss": {7: PSS, 3: PSS._replace(K=3.0, Vmax=0.06, Vmin=-0.04)},
            "tgov": {7: STEAM, 3: STEAM._replace(K=16.0, Ts=0.15)},
        },
        loads=(
            Load(40, 171.0, 48.0, 0.3, 0.2, 0.25, 0.45, 0.6, id="a"),
            Load(30, 83.0, 27.0, 0.1, 0.35, 0.4, 0.15, 0.5, 1.04, "b"),
            Load(40, 36.0, -11.0, id="c"),
            Load(50, 24.0, 8.0, 0.5, 0.6, 0.3, 0.1),
        ),
        links=(Link("dc", 10, 40, 29.0, 1.7),),
        storage=storage,
        base_mva=BASE,
        frequency_hz=HZ,
    )


@cache
def uneven_point():
    """Its operating point."""
    return operating_point.solve(uneven())
