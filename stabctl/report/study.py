"""What a study found, as one immutable record: numbers beside the paper's, tables, pictures, further pages, words."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from stabctl.plotting import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CLOSE = 0.01  # largest relative difference of a number that is close, though not the same in every printed digit
DPI = 130


class Verdict(StrEnum):
    """How a result stands to the paper's."""

    GIVEN = "given"
    AS_PRINTED = "as printed"
    CLOSE = "close"
    DIFFERS = "differs"


@dataclass(frozen=True)
class Printed:
    """A number of the paper, with its digits, or a statement of it in own words."""

    where: str  # table, figure, equation or section
    what: str
    text: str
    unit: str = ""
    given: bool = False  # a constant that the study starts from, not a result

    @property
    def value(self) -> float | None:
        """The number; None where it is a statement."""
        try:
            return float(self.text)
        except ValueError:
            return None

    @property
    def decimals(self) -> int:
        """Digits after the decimal point."""
        return len(self.text.partition(".")[2])

    def beside(self, ours: float | str, remark: str = "") -> "Comparison":
        """Compared with our result, a number in the same unit or a statement in the same words.

        `remark` is a sentence on where they differ and why.
        """
        return Comparison(self, ours if isinstance(ours, str) else float(ours), remark)


@dataclass(frozen=True)
class Comparison:
    """A number or statement of the paper beside ours."""

    printed: Printed
    ours: float | str
    remark: str = ""

    @property
    def shown(self) -> str:
        """Ours with as many decimals as the paper's."""
        if isinstance(self.ours, str):
            return self.ours
        return f"{round(self.ours, self.printed.decimals) + 0.0:.{self.printed.decimals}f}"

    @property
    def difference(self) -> float | None:
        """Ours less the paper's; None for statements."""
        value = self.printed.value
        return None if value is None or isinstance(self.ours, str) else self.ours - value

    @property
    def relative(self) -> float | None:
        """Difference over the paper's number; None for statements and for zero."""
        return self.difference / abs(self.printed.value) if self.difference is not None and self.printed.value else None

    @property
    def verdict(self) -> Verdict:
        """Given: a constant that is the same; as printed: a result with the same digits, or the same words."""
        if self.printed.given:
            return Verdict.GIVEN if self.ours in (self.printed.value, self.printed.text) else Verdict.DIFFERS
        if self.shown == self.printed.text:
            return Verdict.AS_PRINTED
        return Verdict.CLOSE if self.relative is not None and abs(self.relative) <= CLOSE else Verdict.DIFFERS

    def __str__(self) -> str:
        p, unit = self.printed, f" {self.printed.unit}" if self.printed.unit else ""
        return f"{p.where}, {p.what}: paper {p.text}{unit}, ours {self.shown}{unit}: {self.verdict}"


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
    alt: str  # what is seen, for those who do not see it
    caption: str = ""
    of: tuple[str, ...] = ()  # the paper's figures that show the same


@dataclass(frozen=True)
class Study:
    """What one study found. `section` is the paper's, empty for what goes beyond it."""

    title: str
    section: str = ""
    text: tuple[str, ...] = ()  # paragraphs
    comparisons: tuple[Comparison, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()
    pages: Mapping[str, str] = field(default_factory=dict)  # what it is -> file beside the page

    @property
    def notes(self) -> tuple[str, ...]:
        """The remarks of the comparisons, each once."""
        return tuple(dict.fromkeys(c.remark for c in self.comparisons if c.remark))

    def __str__(self) -> str:
        return "\n".join((self.title, *map(str, self.comparisons)))

    def to_dict(self) -> dict[str, Any]:
        """As plain lists, dictionaries, numbers and words."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """The inverse of `to_dict`."""
        compared = (Comparison(Printed(**c["printed"]), c["ours"], c["remark"]) for c in data["comparisons"])
        tables = (Table(t["title"], tuple(t["heads"]), tuple(map(tuple, t["rows"]))) for t in data["tables"])
        pictures = (Picture(**p | {"of": tuple(p["of"])}) for p in data["pictures"])
        parts = tuple(compared), tuple(tables), tuple(pictures)
        return cls(data["title"], data["section"], tuple(data["text"]), *parts, data["pages"])


def draw(
    figure: "Figure | Axes", folder: Path, file: str, title: str, alt: str, caption: str = "", of: str = ""
) -> Picture:
    """Save a figure into the folder; `of` names the paper's figures, "17, 18"."""
    style.save(figure, folder / file, DPI)
    return Picture(file, title, alt, caption, tuple(f"Figure {number.strip()}" for number in of.split(",") if number))
