"""Battery: gives and takes its rated power until it is empty or full.

With unlimited capacity it is the store of the ideal device of the 2022 paper on distributed storage control, section 5.
"""

from stabctl._util.jit import inline
from stabctl.devices.device import Empty

NAME = "ESD"
FINITE = False
Par = Empty
automatic = None


@inline
def most(x, p):
    """Largest power that it takes and gives, over the rating."""
    return 1.0, 1.0


@inline
def rate(x, P, p):
    """Derivative of its energy (pu)."""
    return P
