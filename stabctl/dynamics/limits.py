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
    names: tuple[tuple[str | float, str | float], ...]  # parameters (low, high), or numbers
    stops: np.ndarray  # which of them stop their device at once, so that its power jumps


def limits(families: Iterable[Family], one: int) -> Limits:
    """The states that models list in LIMITS, with those also in STOPS; `one` is the place of the constant 1."""
    state, scale, stops = [], [], []
    low: list[np.ndarray] = []
    high: list[np.ndarray] = []
    names: list[tuple[str | float, str | float]] = []
    for f in families:
        constants, states = f.device.Par._fields, f.device.State._fields
        inputs = f.device.Input._fields
        for name, (least, most, *per) in f.device.limits.items():
            state.append(f.w[:, family.STATE] + states.index(name))
            for values, limit in ((low, least), (high, most)):
                values.append(np.full(len(f.w), limit) if isinstance(limit, float) else f.k[:, constants.index(limit)])
            scale.append(f.w[:, family.INPUTS + inputs.index(per[0])] if per else np.full(len(f.w), one))
            stops.append(np.full(len(f.w), name in f.device.stops))
            names += [(least, most)] * len(f.w)
    none = np.zeros(0, np.int64)
    if not state:
        return Limits(none, np.zeros(0), np.zeros(0), none, (), none)
    places, lows, highs, scales = (np.concatenate(column) for column in (state, low, high, scale))
    return Limits(places, lows, highs, scales, tuple(names), np.flatnonzero(np.concatenate(stops)))
