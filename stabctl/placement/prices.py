"""What a fleet costs: its megawatts, the energy that they need, and its sites."""

from typing import NamedTuple

import numpy as np


class Prices(NamedTuple):
    """Prices at every candidate (candidates), in any one currency."""

    mw: np.ndarray  # per MW
    mwh: np.ndarray  # per MWh
    site: np.ndarray  # per site

    def cost(self, mw: np.ndarray, mwh: np.ndarray) -> float:
        """Cost of a fleet (candidates, MW) with its energy capacities (candidates, MWh)."""
        return float(self.mw @ mw + self.mwh @ mwh + self.site @ (mw > 0))

    def per_mw(self, hours: np.ndarray) -> np.ndarray:
        """Price of a MW (candidates) that needs so many MWh per MW."""
        return self.mw + self.mwh * hours

    def affordable(self, mw: np.ndarray, cost: float) -> float:
        """The largest multiple of a fleet (candidates, MW) that costs no more, without its energy."""
        of_sizes, of_sites = float(self.mw @ mw), float(self.site @ (mw > 0))
        return max(cost - of_sites, 0.0) / of_sizes if of_sizes > 0 else np.inf
