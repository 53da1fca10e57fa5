"""The sensors that controllers add to an operating point, for signals that no device gives."""

import numpy as np

from stabctl.devices.sensors import bus_angle, bus_voltage, line_current, line_power
from stabctl.dynamics import outputs
from stabctl.dynamics.extension import Extension
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import Signal, machines
from stabctl.errors import StudyError

from . import center


class Sensors:
    """Places of signals in an extension of an operating point; each signal gets one sensor at most.

    Parameters
    ----------
    base : OperatingPoint
        The operating point.
    more : Extension
        Its extension, to which sensors are added.
    """

    def __init__(self, base: OperatingPoint, more: Extension) -> None:
        self._base, self._more = base, more
        self._found: dict[Signal, int] = {}

    def place(self, signal: Signal) -> int:
        """Place of a signal; a sensor is added where no device gives it."""
        if signal not in self._found:
            self._found[signal] = self._sensor(signal)
        return self._found[signal]

    def _sensor(self, signal: Signal) -> int:
        """Place of a signal that was not asked for before."""
        base, kind = self._base, signal.kind
        if outputs.given(kind):
            return outputs.place(base, signal)
        if kind == "state":
            return outputs.state(base, signal)
        if kind == "frequency":
            raise StudyError(
                f"A controller cannot read frequency:{signal.place}, the exact rate of a bus angle; let it read "
                f"bus_frequency:{signal.place}, the measured frequency."
            )
        if kind == "speed":
            return int(base.rotors.speed[base.rotor_numbers.index(signal.number)])
        rest = float(outputs.value(base, signal)(base.s))
        if kind in ("angle", "rest_speed", "coi_speed", "deviation", "angle_deviation"):
            return self._center(signal, rest)
        if kind in outputs.OF_LINE:
            ends, par = outputs.line(base, str(signal.place))
            first, second = (int(base.layout.nx + k) for k in ends[[0, 2]])
            table, device = ("line_current", line_current) if kind == "current" else ("line_power", line_power)
            out = self._more.outputs([rest] if kind == "current" else [0.0, 0.0])
            self._more.add(table, device, [0, first, second, -1, out], par, str(signal.place))
            return out + (kind == "flow_q")
        out = self._more.outputs([rest])
        at = base.layout.nx + 2 * base.net.place[signal.number]
        if kind == "voltage":
            self._more.add("bus_voltage", bus_voltage, [0, at, at, -1, out], [], f"bus {signal.place}")
        else:
            mean = self._center(Signal("coi_angle", None, "", ""), 0.0)
            self._more.add("bus_angle", bus_angle, [0, at, at, -1, mean, out], [], f"bus {signal.place}")
        return out

    def _center(self, signal: Signal, rest: float) -> int:
        """A mean of angles or speeds; see `center`."""
        rotors, kind = self._base.rotors, signal.kind
        group: np.ndarray = np.zeros(len(rotors.unit))
        if signal.place is not None:
            group = np.isin(self._base.rotor_numbers, machines(signal)) * 1.0
        own, mean, others = {
            "deviation": (1.0, -1.0, 1), "angle_deviation": (1.0, -1.0, 1), "angle": (1.0, -1.0, 0),
            "rest_speed": (0.0, 1.0, 1),
            "coi_speed": (0.0, 1.0, 0), "coi_angle": (0.0, 1.0, 0),
        }[kind]  # fmt: skip
        unit = int(rotors.unit[np.flatnonzero(group)[0]]) if group.any() else -1
        places = rotors.angle if kind in ("angle", "angle_deviation", "coi_angle") else rotors.speed
        out = self._more.outputs([rest])
        k = [len(group), own, mean, others, *group, *rotors.inertia, *rotors.unit]
        self._more.add("center", center, [0, 0, 0, unit, *map(int, places), out], k, signal.label)
        return out
