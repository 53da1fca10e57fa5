"""Controllers that act as a storage law does, one for each storage device.

u = (w + k d) / slope, or the surface w + k d itself if a relay follows. Outputs are limited to -1 to 1, and a device is
idle at low voltage.
"""

from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np

from stabctl._util.errors import StudyError, shown
from stabctl._util.wording import numbered

from .bang_bang import BangBang
from .controller import Controller
from .feedback import Feedback
from .law import Law, SampledLaw
from .storage_law import StorageLaw
from .timing import Gate

if TYPE_CHECKING:
    from stabctl.model.case import Case

WITHOUT_COUNTERPART = ("max_acceleration", "arm_at", "return_time")


def controllers(law: Law, case: "Case") -> tuple[Controller, ...]:
    """The controllers; see `Law.controllers`."""
    inner, rate, delay = (law.law, law.rate, law.delay) if isinstance(law, SampledLaw) else (law, None, 0.0)
    if isinstance(inner, BangBang):
        inner = StorageLaw(deadband=inner.deadband, min_voltage=inner.min_voltage)
    if not hasattr(case, "storage") or not hasattr(case, "frequency_hz"):
        raise StudyError(f"{shown(case)} is not a case; give st.load(...), or the case of an operating point.")
    hz, made = case.frequency_hz, []
    names = numbered(f"{case.called[device.machine]}@{device.bus}" for device in case.storage)
    groups = inner.numbers(case)
    for name, device in zip(names, case.storage, strict=True):
        group = next((g for g in groups if device.machine in g), (device.machine,))
        of = "+".join(str(case.called[n]) for n in group)
        inputs, gains, deadband = [f"deviation:{of}"], [1.0], 0.0
        if isinstance(inner, StorageLaw):
            _check_counterpart(inner)
            scale = hz / inner.slope if inner.slope else 1.0
            gains, deadband = [scale], scale * inner.deadband / hz
            if inner.angle_gain:
                inputs.append(f"angle_deviation:{of}")
                gains.append(scale * inner.angle_gain / (2 * pi * hz))
        elif isinstance(inner, Feedback):
            if inner.acceleration_gain or inner.braking or inner.deadband:
                raise StudyError(
                    "Feedback with an acceleration gain, braking or a deadband has no counterpart in a controller; "
                    "set them to 0."
                )
            full = device.rating / case.machine(device.machine).base
            gains = [inner.speed_gain * 2 * pi * hz / full if full else 0.0]
        else:
            raise StudyError(f"{type(inner).__name__} has no counterpart in a controller; use it as a law.")
        gate = Gate(f"voltage:{device.bus}", low=inner.min_voltage) if inner.min_voltage else None
        outputs, D, n = (f"order:{name}",), np.array([gains]), len(inputs)
        no_states = np.zeros((0, 0)), np.zeros((0, n)), np.zeros((1, 0))
        options: dict[str, Any] = {
            "rate": rate,
            "delay": delay,
            "deadband": deadband,
            "relay": inner.relay,
            "gate": gate,
        }
        made.append(
            Controller(tuple(inputs), outputs, *no_states, D, name=f"law {name}", limits=(-1.0, 1.0), **options)
        )
    return tuple(made)


def _check_counterpart(law: StorageLaw) -> None:
    for name in WITHOUT_COUNTERPART:
        if getattr(law, name):
            raise StudyError(f"{name} of a storage law has no counterpart in a controller; set it to 0.")
