"""Storage at bus 2 of the small system: cases, runs with orders set from outside, and the signals of a device."""

import numpy as np
from systems import KINDS, small

from stabctl.dynamics import family, operating_point, storage
from stabctl.model.tables import Storage
from stabctl.simulation.criterion import Criterion
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation

KEEP_ON = Criterion(max_angle=np.inf)
FAST = "repc_Kpg=0.5 repc_Kig=8 repc_Tp=0.02 repc_Tg=0.02 repc_Ddn=0 repc_Dup=0 "  # a plant controller of 0.1 s


def with_esd(*rows, **options):
    """The small system with storage at bus 2: 40 MW and 50 MVA behind a converter, or these rows."""
    default = {"storage_model": "regc", "mva": 50.0}
    if options.get("storage_model", "").endswith("_repc"):
        options["converter"] = FAST + options.get("converter", "")
    return small(KINDS["sexs, pss, steam"]).with_storage(rows or [Storage(1, 2, 40.0, **{**default, **options})])


def driven(case, orders, events=(), until=1.5, step=1 / 240):
    """A run with orders of the devices set from outside: {time: orders}."""
    sim = Simulation(setup(operating_point.solve(case), step=step, criterion=KEEP_ON), list(events))
    for t, values in orders.items():
        assert sim.advance(t)
        sim.orders[:] = values
    assert sim.advance(until), sim.outcome
    return sim.finish()


def signal(run, name, row=0):
    """An output or state of a device at every instant."""
    f, j = storage.members(run.point.system, run.point.case)[row]
    for record, first in (("State", f.w[j, family.STATE]), ("Output", f.w[j, -1])):
        if name in (names := f.device.fields(record)):
            return run.rows[:, first + names.index(name)]
    raise KeyError(name)
