"""States with non-windup limits."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from . import family
from .tables import Family


class Limits(NamedTuple):
    """States with non-windup limits: low * scale <= state <= high * scale."""

    state: np.ndarray  # places
    low: np.ndarray
    high: np.ndarray
    scale: np.ndarray  # places of the signals that multiply the limits; the constant 1 if there is none
    names: tuple[tuple[str, str], ...]  # parameters (low, high)


def limits(families: Iterable[Family], one: int) -> Limits:
    """The states that models list in LIMITS; `one` is the place of the constant 1."""
    state, low, high, scale = [], [], [], []
    names: list[tuple[str, str]] = []
    for f in families:
        constants, states = family.fields(f.device, "Par"), family.fields(f.device, "State")
        inputs = family.fields(f.device, "Input")
        for name, (least, most, *per) in getattr(f.device, "LIMITS", {}).items():
            state.append(f.w[:, family.STATE] + states.index(name))
            low.append(f.k[:, constants.index(least)])
            high.append(f.k[:, constants.index(most)])
            scale.append(f.w[:, family.INPUTS + inputs.index(per[0])] if per else np.full(len(f.w), one))
            names += [(least, most)] * len(f.w)
    if not state:
        return Limits(np.zeros(0, np.int64), np.zeros(0), np.zeros(0), np.zeros(0, np.int64), ())
    return Limits(np.concatenate(state), np.concatenate(low), np.concatenate(high), np.concatenate(scale), tuple(names))
