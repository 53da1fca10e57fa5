"""Numbers, nouns and lists in sentences."""

import difflib
import re
from collections import Counter
from collections.abc import Iterable, Sequence

PLURALS = {"branch": "branches", "bus": "buses", "contingency": "contingencies"}

ALIKE = 4  # sentences that are told as one


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


def near(wanted: str, known: Iterable[str], there: str = "it has") -> str:
    """End of a sentence: the names most similar to the one wanted, or the first few, after `there`."""
    known = list(known)
    if re.fullmatch(r"[0-9]{1,18}", wanted) and all(name.isdecimal() for name in known):
        known.sort(key=lambda name: abs(int(name) - int(wanted)))
        return f"the nearest numbers are {', '.join(sorted(known[:3], key=int))}."
    similar = difflib.get_close_matches(wanted, known, 3, 0.5)
    if similar:
        return f"did you mean {' or '.join(similar)}?"
    return f"{there} {', '.join(known[:8])}" + (f" and {len(known) - 8} more." if len(known) > 8 else ".")


def numbered(names: Iterable[int | str]) -> list[int | str]:
    """The names made unique: the second of a name gets `#2`."""
    seen: Counter[int | str] = Counter()
    found: list[int | str] = []
    for name in names:
        seen[name] += 1
        found.append(name if seen[name] == 1 else f"{name}#{seen[name]}")
    return found


def capitalized(text: str) -> str:
    """The text with a capital letter first; the others stay as they are."""
    return text[0].upper() + text[1:]


def number(value: float, digits: int) -> str:
    """Format a number with so many decimals; zero has no sign."""
    return f"{value:z.{digits}f}"


def together(sentences: Iterable[str]) -> list[str]:
    """The sentences; those that differ only in numbers and names with digits are one, with what differs in the others.

    Fewer than `ALIKE` of them stay as they are.
    """
    alike: dict[str, list[str]] = {}
    for sentence in sentences:
        alike.setdefault(re.sub(r"\S*\d\S*", "#", sentence), []).append(sentence)
    return [one for group in alike.values() for one in (group if len(group) < ALIKE else [_as_one(group)])]


def _as_one(group: Sequence[str]) -> str:
    """The first of sentences with equally many words, and the words in which each of the others differs from it."""
    first, *others = (sentence.split() for sentence in group)
    told = [
        " ".join(b.strip(",:;.") for a, b in zip(first, one, strict=True) if a != b) or "the same" for one in others
    ]
    return f"{group[0]} Alike, {len(others)} more: {'; '.join(told[:8])}{'; ...' if len(told) > 8 else '.'}"
