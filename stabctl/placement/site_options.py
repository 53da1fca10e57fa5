"""Where storage may be built, what it costs there, and how large it may be."""

from collections.abc import Iterable, Sequence
from numbers import Integral
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np

from stabctl._util import validation
from stabctl._util.errors import StudyError, shown
from stabctl._util.schema import NOT_NEGATIVE, POSITIVE, fields
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.io import table
from stabctl.model import fleet
from stabctl.model.case import Case
from stabctl.model.powerflow import PowerFlow

from .sensitivity import Candidate, all_candidates, checked, sensitivity
from .siting_rows import Costs

LARGEST = 1e6  # MW
WHOLE = 1e-6  # of a module


class SiteOption(NamedTuple):
    """A bus where a device may be built: a row of a table of sites. What is left out is that of the whole study.

    Examples
    --------
    >>> places = [st.SiteOption(5, 1, cap=200, module=10)]
    >>> wanted = st.Contingency("7-8@0.4", clear="22cyc")
    >>> st.place(st.load("two_area"), wanted, candidates=places, observe="2s").total_mw
    50.0
    """

    bus: Annotated[int, "-", "bus of the device"]
    machine: Annotated[int | str | None, "-", "machine whose speed controls it; by default the nearest one"] = None
    cap: Annotated[float | None, "MW", "largest size", POSITIVE] = None
    module: Annotated[float | None, "MW", "the size is a multiple of it; by default any size", POSITIVE] = None
    cost_per_mw: Annotated[float | None, "-", "cost of a MW", NOT_NEGATIVE] = None
    cost_per_mwh: Annotated[float | None, "-", "cost of a MWh", NOT_NEGATIVE] = None
    cost_per_site: Annotated[float | None, "-", "cost of the site", NOT_NEGATIVE] = None


SiteOptions = str | Path | Iterable[SiteOption | tuple[int | str, int] | int]


class Prices(NamedTuple):
    """Prices at every candidate (candidates), in any one currency: of megawatts, of the energy they need, of sites."""

    mw: np.ndarray  # per MW
    mwh: np.ndarray  # per MWh
    site: np.ndarray  # per site

    def cost(self, mw: np.ndarray, mwh: np.ndarray) -> float:
        """Cost of a fleet (candidates, MW) with its energy capacities (candidates, MWh)."""
        return float(self.mw @ mw + self.mwh @ mwh + self.site @ (mw > 0))

    def per_mw(self, hours: np.ndarray) -> np.ndarray:
        """Price of a MW (candidates) that needs so many MWh per MW."""
        return self.mw + self.mwh * hours

    @property
    def of_a_mw(self) -> float | None:
        """Price of a MW, if it is the same everywhere and nothing else has a price."""
        alike = (self.mw == self.mw[0]).all() and not self.mwh.any() and not self.site.any()
        return float(self.mw[0]) or None if alike else None

    def affordable(self, mw: np.ndarray, cost: float) -> float:
        """The largest multiple of a fleet (candidates, MW) that costs no more, without its energy."""
        of_sizes, of_sites = float(self.mw @ mw), float(self.site @ (mw > 0))
        return max(cost - of_sites, 0.0) / of_sizes if of_sizes > 0 else np.inf


class Sites(NamedTuple):
    """The candidates (candidates) with their largest sizes, modules and prices."""

    candidates: tuple[Candidate, ...]
    mva: np.ndarray  # base of the machine that each follows
    cap: np.ndarray  # MW
    module: np.ndarray  # MW, 0: any size
    prices: Prices


def sites(point: OperatingPoint, given: SiteOptions | None, cap: str, costs: Costs, flow: PowerFlow) -> Sites:
    """The candidates of a study.

    Parameters
    ----------
    point : OperatingPoint
        The first operating point, for the nearest machines.
    given : table, list of sites, or None
        A CSV file, `SiteOption` records, (machine, bus) pairs or bus numbers; by default every machine's storage bus.
    cap : str
        Largest size where the site has none; a percentage refers to the machine that the device follows.
    costs : Costs
        What a site without its own costs has.
    flow : PowerFlow
        For "%dispatch".

    Raises
    ------
    StudyError
        For a site that the case does not have or that is given twice, and for impossible sizes.
    """
    case = point.case
    options = _options(case, given)
    found = checked(case, _followed(point, options))
    cap_mw = most = np.array([_cap(case, option, c, cap, flow) for option, c in zip(options, found, strict=True)])
    if not (cap_mw > 0).any():
        raise StudyError(f"The cap of {cap} is not allowed; give a size above 0.")
    if cap_mw.max() > LARGEST:
        raise StudyError(f"The cap of {cap} is not realistic; give at most {LARGEST:g} MW.")
    module = np.array([option.module or 0.0 for option in options])
    unit = np.where(module > 0, module, 1.0)
    cap_mw = np.where(module > 0, unit * np.floor(cap_mw / unit + WHOLE), cap_mw)
    if not (cap_mw > 0).any():
        option, size = next((o, mw) for o, mw in zip(options, most, strict=True) if o.module and mw > 0)
        raise StudyError(
            f"The module of {option.module:g} MW at bus {option.bus} is larger than its cap of {size:g} MW; raise the "
            "cap or give smaller modules."
        )
    columns = ("cost_per_mw", costs.mw), ("cost_per_mwh", costs.mwh), ("cost_per_site", costs.site)
    prices = Prices(*(np.array([_own(getattr(option, name), cost) for option in options]) for name, cost in columns))
    if (prices.mw + prices.mwh <= 0).any():
        raise StudyError("The costs per MW and per MWh are both 0; make one of them positive at every site.")
    return Sites(found, np.array([case.machine(c.machine).base for c in found]), cap_mw, module, prices)


def _options(case: Case, given: SiteOptions | None) -> tuple[SiteOption, ...]:
    if given is None:
        return tuple(SiteOption(c.bus, c.machine) for c in all_candidates(case))
    if isinstance(given, str | Path):
        return read(given)
    options = tuple(map(_option, given))
    for i, option in enumerate(options, start=1):
        if (wrong := _wrong(option)) is not None:
            raise StudyError(f"Candidate {i}, {wrong}")
    return options


def read(path: str | Path) -> tuple[SiteOption, ...]:
    """The rows of a CSV table of sites; errors name file, row, column and value."""
    rows = table.read(Path(path), fields(SiteOption))
    options = tuple(SiteOption(**row) for row in rows.rows)
    for option, line in zip(options, rows.lines, strict=True):
        if (wrong := _wrong(option)) is not None:
            raise StudyError(f"{path} row {line}, {wrong}")
    if not options:
        raise StudyError(f"{path} has no sites; give a row for each bus where storage may be built.")
    return options


def _option(given: object) -> SiteOption:
    if isinstance(given, SiteOption):
        return given
    if isinstance(given, int) and not isinstance(given, bool):
        return SiteOption(given)
    if isinstance(given, tuple) and len(given) == 2:
        machine, bus = (int(one) if isinstance(one, Integral) else one for one in given)
        return SiteOption(bus, machine)
    raise StudyError(f"{shown(given)} is not a candidate; give a bus, (machine, bus) or a SiteOption.")


def _wrong(option: SiteOption) -> str | None:
    """The first value that is not allowed, in words."""
    for name, f in fields(SiteOption).items():
        value = getattr(option, name)
        expected = None if value is None else validation.fault(f, value)
        if expected is not None:
            return f"{f.column}: {shown(value)} is not allowed; it must be {expected}."
    return None


def _followed(point: OperatingPoint, options: Sequence[SiteOption]) -> tuple[tuple[int | str, int], ...]:
    """Machine and bus of every site; without a machine that at the bus, or the one that a MW there brakes most."""
    rotors = [m for m in point.case.machines if m.machine in point.rotor_numbers]
    nearest = {bus: m.machine for m in reversed(rotors) for bus in (m.bus, m.storage_bus)}
    free = [option.bus for option in options if option.machine is None and option.bus not in nearest]
    if free and not len(point.rotors.real.unit):
        raise StudyError(
            f"{point.case.name} has no synchronous machine that a site without one could follow; give the machine of "
            f"bus {free[0]}."
        )
    if free:
        first = point.rotor_numbers[0]
        found = sensitivity(point, [(first, bus) for bus in dict.fromkeys(free)])
        braked = found.acceleration.T.argmin(axis=1)
        nearest |= {c.bus: found.machines[j] for c, j in zip(found.candidates, braked, strict=True)}
    return tuple((nearest[o.bus] if o.machine is None else o.machine, o.bus) for o in options)


def _cap(case: Case, option: SiteOption, candidate: Candidate, cap: str, flow: PowerFlow) -> float:
    return option.cap or fleet.megawatts(case, case.machine(candidate.machine), cap, flow)


def _own(value: float | None, default: float) -> float:
    return float(default if value is None else value)
