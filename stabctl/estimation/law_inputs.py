"""What a storage law behind an estimator reads at a frame, for every device."""

import numpy as np

from stabctl.controllers import Input, Law
from stabctl.dynamics import outputs, storage
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signal_kinds import OUTPUTS
from stabctl.dynamics.signals import chosen
from stabctl.simulation.simulation import Simulation
from stabctl.simulation.wired import storage_devices

from .coi import Deviations
from .pmu import Pmu
from .rotor_signals import RotorSignals


class LawInputs:
    """Inputs of the devices of a law: of their own machine, or of its group as late as reports of others arrive.

    Parameters
    ----------
    point : OperatingPoint
        The operating point.
    law : Law
        The law.
    inertia : (machines) array, s
        H on one base, as the estimator knows it.
    pmu : Pmu
        The PMUs.
    """

    def __init__(self, point: OperatingPoint, law: Law, inertia: np.ndarray, pmu: Pmu) -> None:
        case, hz = point.case, point.case.frequency_hz
        self.law, self.par = law, [law.par(device) for device in storage_devices(case)]
        row = {m.machine: i for i, m in enumerate(case.machines)}
        self._machine = [row[s.machine] for s in case.storage]
        self._energy = storage.places(point.system, case).energy
        groups = [next((g for g in law.groups if s.machine in g), (s.machine,)) for s in case.storage]
        kinds = ("deviation", "angle_deviation")
        names = [f"{kind}:{'+'.join(map(str, group))}" for group in groups for kind in kinds]
        signals = {name: chosen(case, [name], OUTPUTS)[0] for name in names}
        read = [(signals[name], "+" not in name) for name in names]
        self._rest = np.array([float(outputs.value(point, s)(point.s)) for s, _ in read])
        ages = pmu.own_frames(hz) / pmu.rate, pmu.remote_frames(hz) / pmu.rate
        self._rotors = RotorSignals(point, read, inertia, ages) if law.groups or law.angular else None

    def signals(self, k: int, estimates: Deviations, island: np.ndarray, simulation: Simulation) -> list[Input]:
        """Inputs (devices) in simulation k, with its islands (machines)."""
        s, speed, rate = simulation.s, estimates.speed[k], estimates.acceleration[k]
        energy = s[self._energy]
        deviation, angle = speed[self._machine], np.zeros(len(energy))
        if self._rotors is not None:
            relative = self._rotors(k, estimates, island, self._rest) - self._rest
            deviation, angle = relative[::2], relative[1::2]
        return [Input(deviation[j], rate[i], angle[j], energy[j], simulation.time) for j, i in enumerate(self._machine)]
