"""A case from a MATPOWER file."""

from pathlib import Path
from typing import Literal, NamedTuple

from stabctl.errors import CaseError, StudyError, shown
from stabctl.model.case import Case
from stabctl.model.typical import Known, with_typical_machines
from stabctl.units import quantity

from ..psse.devices import Unsupported
from . import kinds, mpc, network

FREQUENCY = 60.0  # Hz   the file does not hold it
COSTS = ("gencost", "dclinecost", "areas", "gen_name", "branch_name")  # no part of the network


class Import(NamedTuple):
    """What was read from a MATPOWER file.

    Attributes
    ----------
    case : Case
        The system.
    corrections : tuple of str
        What was changed or replaced, one sentence each.
    unsupported : tuple of Unsupported
        Tables that are not modeled.
    known : dict of int to Known
        Kind and rating of every generator, by machine number.
    """

    case: Case
    corrections: tuple[str, ...]
    unsupported: tuple[Unsupported, ...]
    known: dict[int, Known]


def read_matpower(
    path: str | Path, *, frequency: float | str = FREQUENCY, machines: Literal["typical"] | None = None
) -> Case:
    """Read a system from a MATPOWER case file (version 2). The file is read as data: no code in it is run.

    Parameters
    ----------
    path : str or Path
        The file, ending in .m.
    frequency : float or str, Hz
        Rated frequency, which the file does not hold: 50 or "50Hz".
    machines : {"typical"}, optional
        Give every generator a typical machine, exciter and governor (see `with_typical_machines`), of the kind that
        mpc.genfuel and mpc.gentype say. Without it the case has no dynamic models: its power flow can be solved.

    Returns
    -------
    Case
        With the bus numbers and names of the file; generators are named 30/1, circuits 7-8 ckt 2. Demands are
        constant-power loads. What was corrected or left out is in its `warnings`.

    Raises
    ------
    CaseError
        For the first mistake, with file, line and field.
    StudyError
        If an argument is not allowed.
    """
    if machines not in (None, "typical"):
        raise StudyError(f"machines = {shown(machines)} is not allowed; the only choice is typical.")
    found = read(path, frequency=frequency)
    return with_typical_machines(found.case, found.known) if machines else found.case


def read(path: str | Path, *, frequency: float | str = FREQUENCY) -> Import:
    """What `read_matpower` reads without typical machines, with what was corrected and left out."""
    hertz = quantity(frequency, "Hz")
    file = mpc.read(Path(path))
    net = network.read(file)
    apart = net.settle_islands(str(path))
    if not net.rows["machines"]:
        raise CaseError(f"{path}: no generator in service is connected to a reference bus; a case needs one.")
    costs = [name for name in file.unread if name in COSTS]
    said = [f"{path}: not represented: {', '.join(costs)}."] if costs else []
    corrections = (*net.corrections, *apart, *said)
    others = {name: place for name, place in file.unread.items() if name not in COSTS}
    unsupported = tuple(Unsupported(f"mpc.{name}", place, "it is not modeled") for name, place in others.items())
    case = net.case(
        Path(path),
        devices={},
        base_mva=file.base_mva,
        frequency_hz=hertz,
        title=f"MATPOWER case {Path(path).stem}",
        source=f"MATPOWER {Path(path).name}",
        notes=(*corrections, *map(str, unsupported)),
    )
    return Import(case, corrections, unsupported, kinds.known(net))
