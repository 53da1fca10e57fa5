"""What is done before the page opens: everything compiled, the diagram laid out, errors of the case found."""

from stabctl.model.case import Case

from . import page, runs
from .commands import Source
from .points import Points
from .state import State


def warm(case: Case) -> None:
    """Run the first simulations. `StudyError` if the case cannot be simulated."""
    points = Points(case)
    fault = page.about(points)["fault"]
    for state in (State(fault), State(fault, percent=1.0), State(fault, percent=1.0, law="feedback")):
        runs.answer(points, state, Source("", ()))
