"""Tooltips: names of the parts of a figure, which a page shows under the pointer."""

from collections.abc import Iterable
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

if TYPE_CHECKING:
    from matplotlib.artist import Artist

_texts: "WeakKeyDictionary[Artist, tuple[str, ...]]" = WeakKeyDictionary()


def name(artist: "Artist", texts: str | Iterable[str]) -> None:
    """Name an artist, or each of its last markers, lines or segments in the order in which it draws them."""
    _texts[artist] = (texts,) if isinstance(texts, str) else tuple(texts)


def named(artists: "Iterable[Artist]") -> "list[tuple[Artist, tuple[str, ...]]]":
    """Those of the artists that have names, with these."""
    return [(a, _texts[a]) for a in artists if a in _texts]
