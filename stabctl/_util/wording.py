"""Numbers and nouns in sentences."""

PLURALS = {"branch": "branches", "bus": "buses", "contingency": "contingencies"}


def named(number: int, noun: str) -> str:
    """The noun after a number: bus, buses."""
    return noun if number == 1 else PLURALS.get(noun, noun + "s")


def counted(number: int, noun: str) -> str:
    """The number with its noun: 1 bus, 2 buses."""
    return f"{number} {named(number, noun)}"
