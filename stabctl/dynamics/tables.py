"""The devices of one model in a system, as flat tables."""

from typing import NamedTuple

import numpy as np

from stabctl.devices.device import Device


class Family(NamedTuple):
    """The devices of one model in a system."""

    name: str
    device: Device
    w: np.ndarray  # (devices, width) i64   places, see `family`
    k: np.ndarray  # (devices, constants)
    keys: tuple[str, ...]  # name of each, such as "machine 3"
