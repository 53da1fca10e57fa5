"""A power system as frozen tables, in the units of its files; every case that exists is a valid one.

Per-unit values of the network are on the case's `base_mva`, those of machines and controls on the machine's own `base`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

from stabctl._util.verbs import verb
from stabctl.errors import StudyError, shown

from . import catalog, checks, keys
from .tables import TABLES, Branch, Bus, Link, Load, Machine, Storage

if TYPE_CHECKING:
    from .powerflow import PowerFlow


@dataclass(frozen=True, repr=False)
class Case:
    """A power system. Cases do not change: every method that edits one returns a new, checked case.

    Parameters
    ----------
    name : str
        Name of the case.
    buses, branches, machines, loads, links, storage : iterable of Bus, Branch, Machine, Load, Link, Storage
        The tables.
    devices : mapping of str to mapping
        Model name (`genrou`, `pss` ...) to key to parameters. The key is the machine number, for load models the bus
        number; a second device of a model at machine 2 has the key "2#2".
    base_mva : float, MVA
        System base.
    frequency_hz : float, Hz
        Rated frequency.
    title, source : str
        What the system is, and where its data come from.

    Attributes
    ----------
    warnings : tuple of str
        What is unusual but usable in the data, a sentence each.

    Raises
    ------
    CaseError
        For the first mistake, with table, row, column, value and what is allowed.
    """

    name: str
    buses: tuple[Bus, ...]
    branches: tuple[Branch, ...]
    machines: tuple[Machine, ...]
    devices: Mapping[str, Mapping[keys.Key, Any]]
    loads: tuple[Load, ...] = ()
    links: tuple[Link, ...] = ()
    storage: tuple[Storage, ...] = ()
    base_mva: float = 100.0
    frequency_hz: float = 60.0
    title: str = ""
    source: str = ""
    warnings: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        for table, record in TABLES.items():
            object.__setattr__(self, table, checks.values(table, record, getattr(self, table)))
        object.__setattr__(self, "devices", checks.device_values(self.devices))
        object.__setattr__(self, "warnings", tuple(checks.check(self)))

    def __reduce__(self) -> tuple[Any, ...]:
        plain = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "warnings"}
        return _made, (plain | {"devices": {model: dict(rows) for model, rows in self.devices.items()}},)

    def machine(self, number: int) -> Machine:
        """The row of a machine. Raises `StudyError` where there is none of that number."""
        for m in self.machines:
            if m.machine == number:
                return m
        numbers = ", ".join(str(m.machine) for m in self.machines)
        raise StudyError(f"There is no machine {shown(number)} in {self.name}; its machines are {numbers}.")

    def model(self, number: int, role: str) -> str | None:
        """Name of the first model with a role ("machine", "exciter" ...) that a machine has; None where it has none."""
        return next((model for model in catalog.of_role(role) if number in self.devices.get(model, ())), None)

    initialize = verb("stabctl.dynamics.coerce:initialize")
    power_flow = verb("stabctl.model.powerflow:solve")
    simulate = verb("stabctl.simulation.simulate:simulate")
    clearing_time = verb("stabctl.clearing:clearing_time")
    screen = verb("stabctl.clearing:screen")
    modes = verb("stabctl.smallsignal.modes:modes")
    linearize = verb("stabctl.smallsignal:linearize")
    estimate = verb("stabctl.estimation.estimate:estimate")
    place = verb("stabctl.placement.place:place")

    def set(self, path: str | Mapping[str, Any], value: Any = None) -> "Case":
        """The case with one value changed, as if its file had been edited.

        Parameters
        ----------
        path : str or mapping
            `table.key.column`: "pss.1.K", "machines.2.p", "loads.7.p", "branches.7-8#2.x", "storage.14@33.rating"; or
            "frequency_hz", "base_mva", "name", "title", "source". A mapping of paths to values changes all at once.
        value : float, int or str
            In the unit of the column, or text with a unit: "50MW", "100ms".

        Raises
        ------
        StudyError
            If the case has no such table, row or column; it names similar ones.
        CaseError
            If the case with this value is not a valid one.

        Examples
        --------
        >>> case.set("pss.1.K", 10).set("machines.2.p", "0.65GW")
        """
        from . import edit

        return edit.changed(self, {path: value} if isinstance(path, str) else path)

    def with_load(
        self, bus: int, p: str | float | None = None, q: str | float | None = None, **shares: float
    ) -> "Case":
        """The case with the load at a bus changed, or with a new load where the bus has none.

        Parameters
        ----------
        bus : int
            Bus number.
        p, q : float or str
            Active (MW) and reactive (Mvar) power consumed, or text with a unit. A value left out stays as it is; a new
            load has 0.
        **shares : float
            Other columns of the loads table: `p_power`, `q_power`, `p_current`, `q_current`, `v_low`.

        Raises
        ------
        StudyError
            If the bus does not exist or has several loads.
        """
        from . import edit

        return edit.with_load(self, bus, p=p, q=q, **shares)

    def with_storage(
        self,
        sizes: str | float | Mapping[int | str, str | float] | Iterable[Storage],
        flow: "PowerFlow | None" = None,
        **options: Any,
    ) -> "Case":
        """The case with these storage devices in place of its own.

        Parameters
        ----------
        sizes : str, float, mapping or iterable of Storage
            "50MW", "5%mva" or "5%dispatch" (or a number of MW) at every machine's storage bus; at chosen machines
            "14=50MW,13@33=20MW" or {14: "50MW", "13@33": "20MW"} (13@33: of machine 13, at bus 33); or rows.
        flow : PowerFlow, optional
            The power flow that "%dispatch" refers to; solved when it is needed and not given.
        **options : float or str
            Other columns of every device: `characteristic`, `energy`, `charge`, `ramp`, `lag`, `efficiency`.

        Raises
        ------
        StudyError, CaseError
            If a machine, bus, size or option is not allowed.
        """
        from . import fleet

        case = object.__new__(Case)
        rows = fleet.devices(self, sizes, flow, options)
        vars(case).update(vars(self), storage=checks.values("storage", Storage, rows))
        checks.storage(case)  # nothing else has changed
        return case

    def trip_machine(self, number: int) -> "Case":
        """The case with a machine out of service from the start, and with it its controls and storage devices.

        Its bus becomes a pq bus where no other machine is connected.

        Raises
        ------
        StudyError
            If there is no such machine, or it is the only one at the swing bus.
        """
        from . import edit

        return edit.trip_machine(self, number)

    def classical(self) -> "Case":
        """The case with every machine a constant voltage behind x'd, without controls (GENCLS)."""
        from . import edit

        return edit.classical(self)

    def __str__(self) -> str:
        shape = f"{len(self.machines)} machines, {len(self.buses)} buses, {len(self.branches)} branches"
        return f"{self.name}: {self.title} ({shape}, {len(self.loads)} loads, {len(self.links)} HVDC links)"

    __repr__ = __str__


def _made(parts: dict[str, Any]) -> Case:
    """A case from its parts (how it is copied between processes)."""
    return Case(**parts)
