"""Sizes as they are printed: rounded to two decimals of a MW, or more in systems of a few MW."""

import numpy as np

DECIMALS = 2
LARGE = 10.0  # MW   a cap from which two decimals are enough
SMALL = 1e-6  # of the last decimal, that is rounding of the computer


def decimals(cap: np.ndarray) -> int:
    """Decimals of a size in MW: two, or with caps (candidates, MW) of a few MW as many as give six digits."""
    return DECIMALS if cap.max() >= LARGE else 5 - int(np.floor(np.log10(cap.max())))


def up(values: np.ndarray, digits: int) -> np.ndarray:
    """The values at so many decimals, none smaller."""
    return np.round(np.ceil(values * 10.0**digits - SMALL) / 10.0**digits, digits)


def down(values: np.ndarray, digits: int) -> np.ndarray:
    """The values at so many decimals, none larger."""
    return np.round(np.floor(values * 10.0**digits + SMALL) / 10.0**digits, digits)
