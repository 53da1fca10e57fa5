"""What the runs of a system under one control share: everything but their events.

An operating point with its control is connected for the stepper once, and so is each network that events lead to.
"""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.program import Program
from stabctl.model.network import Switching

from . import loop_eigenvalues, steps
from ._places import Places
from .attached import Attached, attached, check_ramps
from .control import Acting, Control, acting
from .criterion import DEFAULT, Criterion, numbers, with_frequency
from .stages import constants
from .topology import Stage, stage
from .wired import Wired, wired


class Connected(NamedTuple):
    """The system on one network, for the stepper."""

    network: Stage
    program: Program
    places: Places


@dataclass(frozen=True, eq=False)
class Setup:
    """An operating point with its control, the step and the criterion of its runs; made by `setup`."""

    point: OperatingPoint  # with sensors and states of the controllers
    parts: Acting  # of the control
    attached: Attached
    wired: Wired
    closed: loop_eigenvalues.Eigenvalues  # of the loop that the control closes
    step: float  # s   largest time step
    criterion: Criterion
    rules: Any  # the criterion as numbers
    places: Places
    _on: dict[Switching, Connected] = field(default_factory=dict, repr=False)

    def on(self, switching: Switching) -> Connected:
        """The system on the network after some events."""
        if switching not in self._on:
            network, program, places = stage(self.point, switching), self.wired.program, self.places
            if network.constants:
                program = program._replace(k=constants(self.wired, network, program.k))
            net, rotors = network.net, self.point.rotors
            if self.criterion.coi == "machines":
                places = places._replace(weight=rotors.of_machines(net.island))
            turned = np.isin(net.island_at[places.other_bus], net.island[rotors.unit])  # by rotors
            alone = np.where(turned, 0.0, self.point.system.unweighted.column("inertia", float))
            other = np.array([one.other for one in self.point.system.watched], np.int64)
            low = np.where(net.alive[other], places.watch_low, 0.0)
            self._on[switching] = Connected(network, program, places._replace(other_weight=alone, watch_low=low))
        return self._on[switching]


def setup(
    point: OperatingPoint, control: Control = None, *, step: float | None = None, criterion: Criterion = DEFAULT
) -> Setup:
    """An operating point with its control, connected for the stepper.

    Parameters
    ----------
    point : OperatingPoint
        Where runs start.
    control : control law, Controller, list of them, or None
        Control of the storage devices, and controllers; without a law, orders are set in `Simulation.orders`.
    step : float, s, optional
        Largest time step; by default what the fastest eigenvalue allows.
    criterion : Criterion
        When a run counts as unstable and ends.

    Raises
    ------
    StudyError
        If the control or the step is not possible.
    """
    parts = acting(control)
    given = attached(point, parts.controllers, parts.measured)
    check_ramps(given)
    system = wired(given.point, parts.law, given.rates, given.gates)
    loop = loop_eigenvalues.eigenvalues(point, parts, given, system)
    longest = parts.law.step if parts.law else steps.STEP
    own = steps.checked(given.point, step, loop.fastest, longest)
    judged = np.asarray(with_frequency(criterion, given.point.system))
    places = system.places._replace(judged=judged)
    return Setup(given.point, parts, given, system, loop, own, criterion, numbers(criterion), places)
