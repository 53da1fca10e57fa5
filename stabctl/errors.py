"""What can go wrong, each as one sentence that names the object, the value and the remedy."""


class StabctlError(Exception):
    """Base of every error a user can cause; its text is one sentence."""


class CaseError(StabctlError):
    """A mistake in a case: file, row, column, value and what is allowed."""


class PowerFlowError(StabctlError):
    """The power flow has no solution, or none was found; names the bus with the largest mismatch."""


class EquilibriumError(StabctlError):
    """A device cannot be in equilibrium at the power flow; names the device and its limit."""


class LinearizationError(StabctlError):
    """An operating point has no linear model: it moves, or rests on a limit; names the state or the limit."""


class StudyError(StabctlError):
    """A study asks for what the case does not have (fault place, machine, storage, step, time)."""


def sentence(error: Exception) -> str:
    """What a user is told of an error, on one line; of one of the operating system's, with the file."""
    of_file = isinstance(error, OSError) and error.filename
    return " ".join((f"{error.strerror or error}: {error.filename}" if of_file else str(error)).split())


def shown(value: object, most: int = 40) -> str:
    """A value as it stands in a sentence: as Python writes it, cut where it is long."""
    try:
        text = repr(value)
    except ValueError:  # Python does not write integers of more than 4300 digits
        return "a number of many digits"
    return text if len(text) <= most else text[: most - 4] + "..."
