"""Outputs as scalar functions of a few signals; complex steps give their derivatives."""

import difflib
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from stabctl._util.errors import StudyError, shown
from stabctl.devices.sensors import line_power
from stabctl.model import naming, network
from stabctl.model.location import circuit

from . import storage
from .inputs import sensor
from .layout import unique
from .operating_point import OperatingPoint
from .signals import OF_ROTOR, Signal, machines

STEP = 1e-30
FAR = 0.5  # pu   change of every signal by which a state shows whether it ever moves


class Reading(NamedTuple):
    """An output: the places in s that it reads, and the function that gives its value (scalars, or a row per place)."""

    places: np.ndarray
    value: Callable[[np.ndarray], np.ndarray]

    def slopes(self, s: np.ndarray) -> np.ndarray:
        """Derivatives with respect to the signals at `places`, by complex step."""
        steps = s[self.places][:, None] + 1j * STEP * np.eye(len(self.places))
        return np.asarray(self.value(steps)).imag / STEP


OF_DEVICE = {"absorbed": "P", "absorbed_q": "Q", "charge": "charge", "energy": "energy"}
OF_SENSOR = ("bus_frequency", "rocof")
OF_LINE = ("flow", "flow_q", "current")
OF_UNIT = {"efd": "Efd", "pm": "Pm", "pe": "P", "qe": "Q", "vt": "vt", "ifd": "Ifd", "vs": "Vs"}


def given(kind: str) -> bool:
    """Whether a device gives the signals of this kind: those have a `place`."""
    return kind in OF_UNIT or kind in OF_DEVICE or kind in OF_SENSOR


def place(point: OperatingPoint, signal: Signal) -> int:
    """Place in s of a signal that a device gives. Raises `StudyError` if there is none."""
    if signal.kind in OF_DEVICE:
        row = naming.row(point.case, "storage", str(signal.place))
        return int(getattr(storage.places(point.system, point.case), OF_DEVICE[signal.kind])[row])
    if signal.kind in OF_SENSOR:
        return sensor(point, signal.kind, signal.number)
    unit = [m.machine for m in point.case.machines].index(signal.number)
    found = point.layout.signals.get((unit, OF_UNIT[signal.kind]))
    if found is None:
        raise StudyError(f"Machine {signal.called} of {point.case.name} has no signal {signal.kind}; choose another.")
    return found


def value(point: OperatingPoint, signal: Signal) -> Callable[[np.ndarray], float]:
    """The value of an output from all signals s; of a bus frequency it is the angle, as in `reading`."""
    read = reading(point, signal)
    if read is None:
        at = place(point, signal)
        return lambda s: float(s[at])
    return lambda s: float(read.value(s[read.places]))


def reading(point: OperatingPoint, signal: Signal) -> Reading | None:
    """The output as a function of states, voltages, set-points and speeds; None where a device gives it, at `place`.

    Of a bus frequency it is the angle, whose rate the frequency is: see `angle_rate`.
    """
    if given(signal.kind):
        at = place(point, signal)
        return None if at >= point.layout.first_output else _weighted(np.array([at]), np.ones(1))
    angles, speeds, nx = point.rotors.angle, point.rotors.speed, point.layout.nx
    inertia = _inertia(point, signal)
    weights = inertia / inertia.sum()
    if signal.kind in ("deviation", "angle_deviation"):
        places = speeds if signal.kind == "deviation" else angles
        group = np.isin(point.rotor_numbers, machines(signal))
        here = point.rotor_island[group]
        if len(set(here)) > 1 or (len(here) > 1 and (point.rotor_island == here[0]).sum() == len(here)):
            raise StudyError(f"The machines of {signal.name} are not in one island with others; choose another group.")
        return _weighted(places, against_rest(point, group))
    if signal.kind == "state":
        return _weighted(np.array([state(point, signal)]), np.ones(1))
    if signal.kind in ("speed", "angle", "rest_speed"):
        i = point.rotor_numbers.index(signal.number)
        own = np.arange(len(angles)) == i
        rest = np.where(own, 0.0, inertia)
        share = {"speed": own * 1.0, "angle": own - weights, "rest_speed": rest / (rest.sum() or 1.0)}[signal.kind]
        return _weighted(angles if signal.kind == "angle" else speeds, share)
    if signal.kind == "coi_speed":
        return _weighted(speeds, weights)
    if signal.kind in OF_LINE:
        return _flow(point, signal, nx)
    v = nx + 2 * point.net.place[signal.number] + np.arange(2)
    if signal.kind == "voltage":
        return Reading(v, lambda q: np.sqrt(q[0] * q[0] + q[1] * q[1]))
    return Reading(np.r_[v, angles], lambda q: _angle(q, weights))


def against_rest(point: OperatingPoint, group: np.ndarray) -> np.ndarray:
    """Weights (rotor units) of a mean over a group (mask) less that of the others in its island; 0 without others."""
    inertia = _inertia_with(point, int(group.argmax()))
    own, rest = np.where(group, inertia, 0.0), np.where(group, 0.0, inertia)
    return own / own.sum() - rest / rest.sum() if rest.any() else 0 * own


def _inertia(point: OperatingPoint, signal: Signal) -> np.ndarray:
    """Inertia (rotor units, s), 0 outside the island of the machine or bus that a signal is of."""
    if signal.kind == "bus_angle":
        return np.where(near(point, signal.number), point.inertia, 0.0)
    if signal.kind in OF_ROTOR:
        return _inertia_with(point, int(np.isin(point.rotor_numbers, machines(signal)).argmax()))
    return point.inertia


def _inertia_with(point: OperatingPoint, rotor: int) -> np.ndarray:
    """Inertia (rotor units, s), 0 outside the island of a rotor (row)."""
    return np.where(point.rotor_island == point.rotor_island[rotor], point.inertia, 0.0)


def near(point: OperatingPoint, bus: int) -> np.ndarray:
    """Which rotors (rotor units) are in the island of a bus, before any switching."""
    return point.rotor_island == point.island[point.net.place[bus]]


def angle_rate(point: OperatingPoint, bus: int) -> tuple[np.ndarray, Callable[[np.ndarray], np.ndarray]]:
    """Places of a bus voltage, and the derivatives of its angle with respect to both components, divided by wb."""
    v = point.layout.nx + 2 * point.net.place[bus] + np.arange(2)
    wb = 2 * np.pi * point.case.frequency_hz
    return v, lambda q: np.array([-q[1], q[0]]) / (q[0] * q[0] + q[1] * q[1]) / wb


def _weighted(places: np.ndarray, weights: np.ndarray) -> Reading:
    used = np.flatnonzero(weights)
    return Reading(places[used], lambda q: weights[used] @ q)


def _angle(q: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Angle of q[0] + j q[1] relative to the COI of the angles q[2:]: twice the arctangent of half of it."""
    coi = weights @ q[2:]
    re, im = q[0] * np.cos(coi) + q[1] * np.sin(coi), q[1] * np.cos(coi) - q[0] * np.sin(coi)
    return 2 * np.arctan(im / (np.sqrt(re * re + im * im) + re))


def _flow(point: OperatingPoint, signal: Signal, states: int) -> Reading:
    """Power or current into a circuit from the first bus named."""
    places, par = line(point, signal.place)

    def measured(q: np.ndarray) -> np.ndarray:
        V1, V2 = (q[0], q[1]), (q[2], q[3])
        if signal.kind == "current":
            re, im = line_power.into(V1, V2, par)
            return np.asarray(np.sqrt(re * re + im * im))
        return np.asarray(line_power.output(V1, V2, par)[signal.kind == "flow_q"])

    return Reading(places + states, measured)


def line(
    point: OperatingPoint, name: Any, state: network.BranchState = network.INTACT
) -> tuple[np.ndarray, line_power.Par]:
    """Places (4), from the first voltage on, of the voltages at the ends of a circuit as named, and its admittances."""
    row, forward = circuit(point.case, name)
    net = point.net
    t = net.ratio[row]
    if state.fault_at == 0:  # on the bus's side of the ratio
        state = state._replace(fault_admittance=state.fault_admittance * abs(t) ** 2)
    Y = network.two_port(net.z[row], net.charging[row], state, (net.ends[row, 0] * abs(t) ** 2, net.ends[row, 1]))
    Y = np.array([[Y[0, 0] / abs(t) ** 2, Y[0, 1] / t.conjugate()], [Y[1, 0] / t, Y[1, 1]]])
    ends = [net.frm[row], net.to[row]]
    if not forward:
        Y, ends = Y[::-1, ::-1], ends[::-1]
    at = np.array([2 * ends[0], 2 * ends[0] + 1, 2 * ends[1], 2 * ends[1] + 1])
    return at, line_power.Par(Y[0, 0].real, Y[0, 0].imag, Y[0, 1].real, Y[0, 1].imag)


def state(point: OperatingPoint, signal: Signal) -> int:
    """Place in s of a state, by its label. Raises `StudyError` if there is no such state, or its block is bypassed."""
    places, name = _states(point), str(signal.place)
    if (found := places.get(name)) is not None:
        return found
    if name in places:
        raise StudyError(
            f"The state {name} of {point.case.name} never moves: a time constant of 0, or a flag, bypasses its block. "
            "Leave it out, or give the device that time constant, such as a lag of storage."
        )
    there = [label for label, found in places.items() if found is not None]
    similar = difflib.get_close_matches(name, there, n=3)
    raise StudyError(
        f"{point.case.name} has no state {shown(signal.place)}; " + (f"similar ones are {', '.join(similar)}."
        if similar else f"its first ones are {', '.join(there[:3])}.")
    )  # fmt: skip


def _states(point: OperatingPoint) -> dict[str, int | None]:
    """Label of every state -> its place in s; None if it neither moves nor is read, because its block is bypassed.

    Not even far from the operating point: a state at rest within a deadband, or behind a limit, may move in a run.
    """
    places: dict[str, int | None] = vars(point).setdefault("state_places", {})
    if not places:
        layout, equations, found = point.layout, point.equations, []
        far = np.zeros(layout.size)
        far[: layout.step] = np.random.default_rng(0).normal(scale=FAR, size=layout.step)
        for s in (point.s.copy(), point.s + far, point.s - far):
            slopes, values = equations.entries(s)
            found += [equations.rows[slopes != 0], equations.columns[slopes != 0], np.flatnonzero(values)]
        used = {*np.concatenate(found).tolist()}
        labels = unique(p.label for p in layout.states)
        places |= {label: k if k in used else None for k, label in enumerate(labels)}
    return places
