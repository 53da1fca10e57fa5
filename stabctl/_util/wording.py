"""Numbers, nouns and lists in sentences."""

from collections.abc import Iterable, Sequence

PLURALS = {"branch": "branches", "bus": "buses", "contingency": "contingencies"}


def named(number: int, noun: str) -> str:
    """The noun after a number: bus, buses."""
    return noun if number == 1 else PLURALS.get(noun, noun + "s")


def counted(number: int, noun: str) -> str:
    """The number with its noun: 1 bus, 2 buses."""
    return f"{number} {named(number, noun)}"


def listed(names: Sequence[str], most: int = 8) -> str:
    """The first names, and the number of the others."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def enumerated(noun: str, names: Iterable[object]) -> str:
    """The noun with the first names: bus 7, buses 7, 8."""
    given = list(map(str, names))
    return f"{named(len(given), noun)} {listed(given)}"


def number(value: float, digits: int) -> str:
    """Format a number with so many decimals; zero has no sign."""
    return f"{round(value, digits) + 0.0:.{digits}f}"
