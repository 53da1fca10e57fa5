"""Names of modes of converters: the control loop whose states take part most, "PLL of REGC_C 5"."""

from collections import defaultdict

import numpy as np

from stabctl import devices
from stabctl.dynamics.loops import loops

from .model import Linear

CONVERTER = 0.5  # participation of converters and their controls from which a mode is theirs
NAMED = 0.5  # participation, relative to the largest, from which a converter is named
LEAST = 1e-3  # participation that counts
MOST = 4  # largest number of converters named


def loop(linear: Linear, share: np.ndarray) -> str | None:
    """Name of a mode by the control loop of converters that takes part most; None if it is not a mode of converters.

    Parameters
    ----------
    linear
        The linear model.
    share
        Participation (states), with a sum of 1.
    """
    found: dict[tuple[str, str], dict[int, float]] = defaultdict(lambda: defaultdict(float))
    for place, part in zip(linear.places, share.tolist(), strict=True):
        device = devices.every().get(place.table) if part > LEAST else None
        if device is not None and device.role in ("converter", *devices.OF_CONVERTER):
            name = loops(linear.point, place.table, place.unit).get(place.name)
            if name is not None:
                found[device.name, name][place.unit] += part
    total = {key: sum(units.values()) for key, units in found.items()}
    if sum(total.values()) < CONVERTER:
        return None
    (device_name, name), units = max(found.items(), key=lambda item: total[item[0]])
    largest = max(units.values())
    strong = sorted(unit for unit, part in units.items() if part >= NAMED * largest)
    case = linear.point.case
    called = ", ".join(str(case.machines[unit].called) for unit in strong[:MOST])
    more = f" and {len(strong) - MOST} more" if len(strong) > MOST else ""
    return f"{name} of {device_name} {called}{more}"
