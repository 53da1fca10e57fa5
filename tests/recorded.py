"""What a run recorded of a unit: an output, an input or a state at every instant."""


def signal(of, name, unit=0):
    """An output or input of a unit."""
    return of.rows[:, of.point.layout.signals[unit, name]]


def state(of, name, unit=0):
    """A state of a unit."""
    k = next(k for k, p in enumerate(of.point.layout.states) if (p.name, p.unit) == (name, unit))
    return of.rows[:, k]
