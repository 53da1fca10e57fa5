"""A power system as immutable tables, in the units of its files; a case is checked when it is created.

Per-unit values of the network are on the case's `base_mva`, those of machines and controls on the machine's own `base`.
"""

from dataclasses import dataclass, fields
from typing import Any

from stabctl._util.errors import StudyError, shown
from stabctl._util.verbs import verb

from . import checks, naming
from .tables import TABLES, Machine, Tables


@dataclass(frozen=True, repr=False)
class Case(Tables):
    """A power system. Cases do not change: every method that edits one returns a new, checked case.

    Parameters
    ----------
    name : str
        Name of the case.
    buses, branches, machines : iterable of Bus, Branch, Machine
        The tables.
    devices : mapping of str to mapping
        For each model (`genrou`, `pss` ...) a mapping from key to parameters. The key is the machine number, or the bus
        number for load models; the second device of a model at machine 2 has the key "2#2".
    loads, links, storage, out_of_service : iterable of Load, Link, Storage, OutOfService
        More tables, which may be empty.
    base_mva : float, MVA
        System base.
    frequency_hz : float, Hz
        Rated frequency.
    title, source : str
        What the system is, and where its data come from.
    notes : tuple of str
        What the reader of its files corrected or left out, one sentence each.

    Raises
    ------
    CaseError
        For the first error, with table, row, column, value and what is allowed.

    Examples
    --------
    >>> case = st.load("two_area")
    >>> [row.machine for row in case.machines], case.loads[0].p, case.devices["sexs"][1].KA
    ([1, 2, 3, 4], 967.0, 200.0)
    """

    def __post_init__(self) -> None:
        for table, record in TABLES.items():
            object.__setattr__(self, table, checks.values(table, record, getattr(self, table)))
        own = tuple(m if m.storage_bus else m._replace(storage_bus=m.bus) for m in self.machines)
        object.__setattr__(self, "machines", own)
        object.__setattr__(self, "devices", checks.device_values(self.devices))
        checks.check(self)

    def __reduce__(self) -> tuple[Any, ...]:
        plain = {f.name: getattr(self, f.name) for f in fields(self)}
        return _made, (plain | {"devices": {model: dict(rows) for model, rows in self.devices.items()}},)

    def machine(self, number: int | str) -> Machine:
        """The row of a machine.

        Parameters
        ----------
        number : int or str
            Its number, or its name such as 30/1.

        Returns
        -------
        Machine

        Raises
        ------
        StudyError
            If there is no such machine.

        Examples
        --------
        >>> st.load("two_area").machine(2).p
        700.0
        """
        found = naming.machine_number(self, number) if isinstance(number, str) else number
        for m in self.machines:
            if m.machine == found:
                return m
        numbers = ", ".join(str(m.called) for m in self.machines)
        wanted = number.strip() if isinstance(number, str) else shown(number)
        if said := naming.idle(self, "machine", id=wanted):
            raise StudyError(f"{said}; its machines are {numbers}.")
        raise StudyError(f"There is no machine {wanted} in {self.name}; its machines are {numbers}.")

    check = verb("stabctl.model.unusual:check")
    set = verb("stabctl.model.edit:set_value")
    with_load = verb("stabctl.model.edit:with_load")
    with_load_level = verb("stabctl.model.loads:with_load_level")
    with_motors = verb("stabctl.model.loads:with_motors")
    with_loads = verb("stabctl.model.loads:with_loads")
    with_conventions = verb("stabctl.model.conventions:with_conventions")
    with_storage = verb("stabctl.model.fleet:with_storage")
    with_device = verb("stabctl.model.edit:with_device")
    without_device = verb("stabctl.model.edit:without_device")
    with_typical_machines = verb("stabctl.model.typical:with_typical_machines")
    trip_machine = verb("stabctl.model.edit:trip_machine")
    classical = verb("stabctl.model.edit:classical")

    initialize = verb("stabctl.dynamics.operating_point:initialize")
    power_flow = verb("stabctl.model.powerflow:solve")
    simulate = verb("stabctl.simulation.simulate:simulate")
    clearing_time = verb("stabctl.clearing:clearing_time")
    screen = verb("stabctl.clearing:screen")
    study = verb("stabctl.assessment:study")
    modes = verb("stabctl.smallsignal.analysis:modes")
    linearize = verb("stabctl.smallsignal:linearize")
    closed_loop = verb("stabctl.smallsignal.closed_loop:closed_loop")
    margins = verb("stabctl.smallsignal.margins:margins")
    weak_grid = verb("stabctl.smallsignal.weak_grid:weak_grid")
    limit_cycles = verb("stabctl.smallsignal.limit_cycles:limit_cycles")
    estimate = verb("stabctl.estimation.estimate:estimate")
    place = verb("stabctl.placement.place:place")
    short_circuit = verb("stabctl.model.short_circuit:short_circuit")
    short_circuit_ratio = verb("stabctl.model.short_circuit:short_circuit_ratio")
    one_line = verb("stabctl.view.diagram:one_line")
    plot = verb("stabctl.view.figures.one_line:plot")

    def __str__(self) -> str:
        shape = f"{len(self.machines)} machines, {len(self.buses)} buses, {len(self.branches)} branches"
        return f"{self.name}: {self.title} ({shape}, {len(self.loads)} loads, {len(self.links)} HVDC links)"

    __repr__ = __str__


def as_case(base: Any) -> Case:
    """The case, or that of an operating point. Raises `StudyError` for anything else."""
    found = base if isinstance(base, Case) else getattr(base, "case", None)
    if not isinstance(found, Case):
        raise not_a_system(base)
    return found


def not_a_system(given: object) -> StudyError:
    """The error where something else was given than a system."""
    return StudyError(
        f"{shown(given)} is not a system; give a Case, such as st.load('two_area'), or its OperatingPoint."
    )


def _made(parts: dict[str, Any]) -> Case:
    """A case from its parts (how it is copied between processes)."""
    return Case(**parts)
