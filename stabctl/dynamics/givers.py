"""Which devices provide each signal of a unit."""

from collections.abc import Iterator

import numpy as np


class Givers:
    """Places of the signals that the devices of every unit provide; several devices may provide the same signal.

    Parameters
    ----------
    units
        Number of units.
    """

    def __init__(self, units: int) -> None:
        self._units = units
        self._layers: dict[str, list[np.ndarray]] = {}  # signal -> (units) places, -1: none; first giver, second giver

    def add(self, signal: str, units: np.ndarray, places: np.ndarray) -> None:
        """Add a signal that devices of these units provide at these places."""
        layers = self._layers.setdefault(signal, [])
        depth = 0
        while len(units):
            if depth == len(layers):
                layers.append(np.full(self._units, -1))
            rank, earliest = np.arange(len(units)), np.empty(self._units, np.int64)
            earliest[units[::-1]] = rank[::-1]
            first = (earliest[units] == rank) & (layers[depth][units] < 0)
            layers[depth][units[first]] = places[first]
            units, places = units[~first], places[~first]
            depth += 1

    def of(self, signal: str, units: np.ndarray) -> np.ndarray:
        """Places (givers, units) of a signal of these units; -1 if there is no further device."""
        return np.array([layer[units] for layer in self._layers.get(signal, ())], int).reshape(-1, len(units))

    def __iter__(self) -> Iterator[tuple[str, np.ndarray]]:
        """Every signal with its places (givers, units)."""
        return ((signal, np.array(layers)) for signal, layers in self._layers.items())
