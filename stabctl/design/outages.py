"""Operating points with one branch out of service each, for controllers that must be adequate for all of them."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from stabctl._util.errors import StabctlError, StudyError
from stabctl.dynamics.operating_point import OperatingPoint, operating_point
from stabctl.model import naming, network
from stabctl.model.case import Case
from stabctl.model.fleet import Fleet

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class Outages:
    """The intact system and the systems without one branch, each at its own power flow.

    Attributes
    ----------
    points
        The operating points, first that of the intact system; each is named after what is out.
    names
        Branch that is out of each; "" of the intact system.
    left_out
        Branches without which there is no operating point, and why.

    Examples
    --------
    >>> found = st.design.outages(st.load("wscc9"))
    >>> found.names, found.left_out[0]
    (('', '4-5', '4-6', '5-7', '6-9', '7-8', '8-9'), ('1-4', 'the network would be split'))
    """

    points: tuple[OperatingPoint, ...]
    names: tuple[str, ...]
    left_out: tuple[tuple[str, str], ...]

    def __iter__(self) -> Iterator[OperatingPoint]:
        return iter(self.points)

    def __len__(self) -> int:
        return len(self.points)

    @property
    def df(self) -> "pd.DataFrame":
        """Every branch, and why it is left out; empty if it is not."""
        import pandas as pd

        rows = [(name, "") for name in self.names if name] + list(self.left_out)
        return pd.DataFrame(rows, columns=["outage", "left_out"])

    def __str__(self) -> str:
        text = f"{self.points[0].case.name} and {len(self.points) - 1} outages"
        for why, names in by_reason(self.left_out):
            text += f"; left out because {why}: {', '.join(names)}"
        return f"{text}."

    __repr__ = __str__


def outages(base: Case | OperatingPoint, *, storage: "Fleet | None" = None) -> Outages:
    """The operating points of a system and of all its N-1 branch outages.

    Parameters
    ----------
    base : Case or OperatingPoint
        The system. The power flow is solved again without each of its branches in turn (lines and transformers; equal
        circuits side by side count once).
    storage : str, float, mapping, or iterable of Storage, optional
        Storage devices in place of the case's own, as in `simulate`.

    Returns
    -------
    Outages
        Outages that split the network, or have no operating point, are left out and named.

    Raises
    ------
    StudyError
        If no outage has an operating point.

    Examples
    --------
    >>> print(st.design.outages(st.load("wscc9")))
    wscc9 and 6 outages; left out because the network would be split: 1-4, 2-7, 3-9.
    """
    intact = operating_point(base, storage)
    case = intact.case
    net = network.build(case)
    whole = network.islands(net).max()
    points, names, left_out, seen = [intact], [""], [], set()
    for row, (branch, name) in enumerate(zip(case.branches, map(str, naming.circuits(case.branches)), strict=True)):
        alike = branch._replace(circuit="")
        if alike in seen:
            continue
        seen.add(alike)
        if network.islands(net, network.without([row])).max() > whole:
            left_out.append((name, "the network would be split"))
            continue
        rest = (*case.branches[:row], *case.branches[row + 1 :])
        try:
            points.append(operating_point(replace(case, name=f"{case.name} without {name}", branches=rest)))
            names.append(name)
        except StabctlError as error:
            left_out.append((name, reason(error)))
    if len(points) == 1:
        raise StudyError(f"No outage of {case.name} has an operating point; design for the intact system.")
    return Outages(tuple(points), tuple(names), tuple(left_out))


def reason(error: Exception) -> str:
    """The first part of an error's sentence."""
    return str(error).partition(";")[0].rstrip(".")


def by_reason(left_out: Iterable[tuple[str, str]]) -> list[tuple[str, list[str]]]:
    """Every reason with the names of what is left out because of it."""
    found: dict[str, list[str]] = {}
    for name, why in left_out:
        found.setdefault(why, []).append(name)
    return list(found.items())
