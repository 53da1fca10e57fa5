"""Errors in the reports of bad PMUs."""

from collections.abc import Sequence
from math import pi

import numpy as np

from .bad_pmu import BadPmu
from .instrument import Frame


class BadReports:
    """Makes the reports of bad PMUs wrong; `rows` are the rows of their machines."""

    def __init__(self, bad: Sequence[BadPmu], rows: Sequence[int], frequency_hz: float) -> None:
        self._bad, self._wb = tuple(zip(bad, rows, strict=True)), 2 * pi * frequency_hz
        self._last: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def __call__(self, at: float, frame: Frame) -> Frame:
        """The frame at an instant (s), as it is reported."""
        if not self._bad:
            return frame
        V, I = frame.V.copy(), frame.I.copy()
        for k, (bad, row) in enumerate(self._bad):
            since = at - bad.at
            if since < -1e-9:
                self._last[k] = V[:, row].copy(), I[:, row].copy()
            if since < -1e-9 or at > bad.until - 1e-9:
                continue
            if bad.frozen and k in self._last:
                V[:, row], I[:, row] = self._last[k]
            turned = np.exp(1j * (bad.jump + (bad.ramp + self._wb * bad.drift) * since))
            V[:, row], I[:, row] = V[:, row] * turned, I[:, row] * turned
        return frame._replace(V=V, I=I)
