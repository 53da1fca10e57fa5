"""Importing this readies the machine code, compiling it where it is not on disk: a fork server does so for its workers.

It stands alone so that nothing else pays for it.
"""

from stabctl import io
from stabctl.dynamics import operating_point
from stabctl.simulation.simulation import Simulation

Simulation(operating_point.solve(io.load("two_area")))
