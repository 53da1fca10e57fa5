"""Orders that reach the electrical control of a converter without a plant controller.

share    -> -rated share    -> Pref
reactive -> -rated reactive -> Qext, or V0 + order_v with QFlag = 1 and VFlag = 0, where Qext is the voltage reference

`rated` is the power rating over the MVA of the converter; per unit on this MVA.
"""

from stabctl._util.jit import inline
from stabctl.devices.converters import electrical
from stabctl.devices.device import Empty

from . import joined

NAME = ""
DEADBANDS = ()
Par = State = Empty
Input = joined.Input


def kit(of):
    """The published models of a device, as they are."""
    return of


def guess(V, p):
    """There are no states."""
    return State()


@inline
def references(x, u, shares, vt, P, Q, p):
    """What REEC_C reads, and the derivatives of no states."""
    active, reactive = shares
    ordered = p.V0 + u.order_v if p.QFlag > 0.5 and p.VFlag < 0.5 else -p.rated * reactive
    return electrical.Input(-p.rated * active, ordered, 0 * vt, vt, P, Q), ()
