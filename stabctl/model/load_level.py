"""Cases at another load level."""

from dataclasses import replace

from stabctl.errors import StudyError

from .case import Case

HIGHEST = 10.0


def with_load_level(case: Case, level: float) -> Case:
    """The case with every load and the dispatch of every machine multiplied by a level.

    The swing machine covers what the losses change; voltages, shunts and HVDC links stay as they are.

    Parameters
    ----------
    case : Case
        The system.
    level : float
        Share of the present load: 0.9 for 90 %.

    Raises
    ------
    StudyError
        For a level that is not above 0, or above 10.
    """
    if isinstance(level, bool) or not isinstance(level, int | float) or not 0 < level <= HIGHEST:
        raise StudyError(f"The load level {level!r} is not allowed; give a number above 0, such as 0.9 for 90 %.")
    loads = tuple(load._replace(p=level * load.p, q=level * load.q) for load in case.loads)
    machines = tuple(m._replace(p=level * m.p) for m in case.machines)
    return replace(case, loads=loads, machines=machines)
