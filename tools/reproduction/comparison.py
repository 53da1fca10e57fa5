"""A number or statement of the paper beside ours."""

from dataclasses import dataclass
from enum import StrEnum

CLOSE = 0.01  # largest relative difference of a number that is close, though not equal in every printed digit


class Verdict(StrEnum):
    """How our result compares with the paper's."""

    GIVEN = "given"
    AS_PRINTED = "as printed"
    CLOSE = "close"
    DIFFERS = "differs"


@dataclass(frozen=True)
class Printed:
    """A number of the paper, with its digits, or a statement of it in our words."""

    where: str  # table, figure, equation or section
    what: str
    text: str
    unit: str = ""
    given: bool = False  # an input that the study takes from the paper, not a result

    @property
    def value(self) -> float | None:
        """The number; None for a statement."""
        try:
            return float(self.text)
        except ValueError:
            return None

    @property
    def decimals(self) -> int:
        """Digits after the decimal point."""
        return len(self.text.partition(".")[2])

    def compare(self, ours: float | str, remark: str = "") -> "Comparison":
        """Compare with our result.

        Parameters
        ----------
        ours
            A number in the same unit, or a statement in the same words.
        remark
            A sentence on where and why the two differ.
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
        """Our result, with as many decimals as the paper's."""
        if isinstance(self.ours, str):
            return self.ours
        return f"{round(self.ours, self.printed.decimals) + 0.0:.{self.printed.decimals}f}"

    @property
    def difference(self) -> float | None:
        """Ours minus the paper's; None for a statement."""
        value = self.printed.value
        return None if value is None or isinstance(self.ours, str) else self.ours - value

    @property
    def relative(self) -> float | None:
        """The difference divided by the paper's number; None for a statement and for zero."""
        return self.difference / abs(self.printed.value) if self.difference is not None and self.printed.value else None

    @property
    def difference_text(self) -> str:
        """The difference, absolute and in percent; empty where there is none to show."""
        if self.difference is None or self.shown == self.printed.text:
            return ""
        share = f" ({100 * self.relative:+.2g} %)" if self.relative is not None else ""
        return f"{self.difference:+.{self.printed.decimals}f}{share}"

    @property
    def verdict(self) -> Verdict:
        """`GIVEN` for an input that is the same, `AS_PRINTED` for a result with the same digits or words."""
        if self.printed.given:
            return Verdict.GIVEN if self.ours in (self.printed.value, self.printed.text) else Verdict.DIFFERS
        if self.shown == self.printed.text:
            return Verdict.AS_PRINTED
        return Verdict.CLOSE if self.relative is not None and abs(self.relative) <= CLOSE else Verdict.DIFFERS

    def __str__(self) -> str:
        p, unit = self.printed, f" {self.printed.unit}" if self.printed.unit else ""
        return f"{p.where}, {p.what}: paper {p.text}{unit}, ours {self.shown}{unit}: {self.verdict}"
