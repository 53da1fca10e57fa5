"""Importing this module loads the machine code, compiling it if necessary; a fork server does so for its workers."""

from stabctl import io
from stabctl.dynamics import operating_point
from stabctl.simulation.setup import setup
from stabctl.simulation.simulation import Simulation

Simulation(setup(operating_point.solve(io.load("two_area"))))
