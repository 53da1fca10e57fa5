"""What a study found: numbers beside the paper's, tables, pictures, further pages, text."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from stabctl.plotting import style

from .comparison import Comparison, Printed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 130


@dataclass(frozen=True)
class Table:
    """Results for which the paper has no number."""

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Picture:
    """A picture in the folder of the reports."""

    file: str
    title: str
    alt: str  # what the picture shows, for those who cannot see it
    caption: str = ""
    of: tuple[str, ...] = ()  # the paper's figures that show the same


@dataclass(frozen=True)
class Study:
    """What one study found. `section` is the paper's; empty for results beyond the paper."""

    title: str
    section: str = ""
    text: tuple[str, ...] = ()  # paragraphs
    comparisons: tuple[Comparison, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()
    pages: Mapping[str, str] = field(default_factory=dict)  # title -> file

    @property
    def notes(self) -> tuple[str, ...]:
        """The remarks of the comparisons, each once."""
        return tuple(dict.fromkeys(c.remark for c in self.comparisons if c.remark))

    def __str__(self) -> str:
        return "\n".join((self.title, *map(str, self.comparisons)))

    def to_dict(self) -> dict[str, Any]:
        """Return plain lists, dictionaries, numbers and text."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Return the study of which `to_dict` gave the data."""
        compared = (Comparison(Printed(**c["printed"]), c["ours"], c["remark"]) for c in data["comparisons"])
        tables = (Table(t["title"], tuple(t["heads"]), tuple(map(tuple, t["rows"]))) for t in data["tables"])
        pictures = (Picture(**p | {"of": tuple(p["of"])}) for p in data["pictures"])
        parts = tuple(compared), tuple(tables), tuple(pictures)
        return cls(data["title"], data["section"], tuple(data["text"]), *parts, data["pages"])


def draw(drawn: "Figure | Axes", path: Path, title: str, *, alt: str, caption: str = "", of: str = "") -> Picture:
    """Save a figure; `of` names the paper's figures that show the same, as in "17, 18"."""
    style.save(drawn, path, DPI)
    return Picture(
        path.name, title, alt, caption, tuple(f"Figure {number.strip()}" for number in of.split(",") if number)
    )
