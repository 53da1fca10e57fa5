"""The errors a user can cause; each message is one sentence with the object, the value and the remedy."""

LONGEST = 400  # characters of a word in a message


class StabctlError(Exception):
    """Base of every error a user can cause; its text is one sentence."""


class CaseError(StabctlError):
    """An error in the data of a case: file, row, column, value and what is allowed."""


class PowerFlowError(StabctlError):
    """The power flow has no solution, or none was found; names the bus with the largest mismatch."""


class EquilibriumError(StabctlError):
    """A device has no equilibrium at its power-flow solution; names the device and the limit."""


class LinearizationError(StabctlError):
    """An operating point cannot be linearized: it is not an equilibrium, or exactly at a limit; names which."""


class StudyError(StabctlError):
    """A study has an invalid argument, or names something that the case does not have."""


def sentence(error: Exception) -> str:
    """The message of an error on one line; that of an operating system error with the file."""
    text = str(error)
    if isinstance(error, OSError) and error.strerror:
        text = f"{error.strerror}: {error.filename}" if error.filename else error.strerror
    return one_line(text)


def bug(error: Exception) -> str:
    """The message of an error that only a mistake in stabctl can cause."""
    return one_line(f"{type(error).__name__}: {error}. This is a bug in stabctl; please report it.")


def one_line(text: str) -> str:
    """The text on one line, long words shortened, control characters as escapes: a terminal would obey them."""
    words = " ".join(word if len(word) <= LONGEST else f"{word[:LONGEST]}..." for word in text.split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in words)


def is_line(text: object) -> bool:
    """Whether it is a line of text without control characters, as names must be: they reach terminals and workbooks."""
    return isinstance(text, str) and text.isprintable()


def check_line(name: str, text: object) -> None:
    """Raise `StudyError` if an argument of this name is no line of text."""
    if not is_line(text):
        raise StudyError(f"{name} = {shown(text)} is not allowed; give one line of text.")


def shown(value: object, most: int = 40) -> str:
    """A value as shown in messages: its repr, shortened if it is long."""
    try:
        text = repr(value)
    except ValueError:  # Python does not write integers of more than 4300 digits
        return "a number of many digits"
    return text if len(text) <= most else text[: most - 4] + "..."
