"""The laws that run inside the compiled loop. A new law is one file and one line here."""

from stabctl._util.jit import inline

from . import bang_bang, feedback

OUTSIDE = 0.0  # kind of a device whose orders are set from outside and held


@inline
def order(seen, p, held):
    """Order of one device in ratings (absorbing positive); `held` is the one it has."""
    if p.kind == bang_bang.KIND:
        return bang_bang.order(seen, p)
    if p.kind == feedback.LINEAR or p.kind == feedback.BRAKING:
        return feedback.order(seen, p)
    return held
