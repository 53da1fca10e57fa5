"""What is done before the page opens: everything compiled, the diagram laid out, errors of the case found."""

from stabctl.model.case import Case
from stabctl.simulation.simulate import simulate

from . import page
from .points import Points
from .state import AT, State

ENDS = AT + 0.5  # s   of the first simulations


def warm(case: Case) -> Points:
    """The operating points of a case after its first simulations. `StudyError` if it cannot be simulated."""
    points = Points(case)
    fault = page.about(points)["fault"]
    for state in (State(fault), State(fault, percent=1.0), State(fault, percent=1.0, law="feedback")):
        simulate(points.of(state), state.contingency, ENDS, control=state.control(case.frequency_hz))
    return points
