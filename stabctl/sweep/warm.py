"""Importing this readies the machine code, compiling it where it is not on disk: a fork server does so for its workers.

It stands alone so that nothing else pays for it.
"""

from stabctl import equilibrium, read
from stabctl.simulate.simulation import Simulation

Simulation(equilibrium.solve(read.load("two_area")))
