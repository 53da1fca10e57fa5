"""A case from a MATPOWER file."""

from pathlib import Path
from typing import Literal

from stabctl.errors import CaseError, StudyError, shown
from stabctl.model.case import Case
from stabctl.model.typical import with_typical_machines
from stabctl.units import quantity

from . import kinds, mpc, network

FREQUENCY = 60.0  # Hz   the file does not hold it


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
    hertz = quantity(frequency, "Hz")
    file = mpc.read(Path(path))
    net = network.read(file)
    apart = net.settle_islands(str(path))
    if not net.rows["machines"]:
        raise CaseError(f"{path}: no generator in service is connected to a reference bus; a case needs one.")
    unread = [f"{path}: not represented: {', '.join(file.unread)}."] if file.unread else []
    case = net.case(
        Path(path),
        devices={},
        base_mva=file.base_mva,
        frequency_hz=hertz,
        title=f"MATPOWER case {Path(path).stem}",
        source=f"MATPOWER {Path(path).name}",
        notes=(*net.corrections, *apart, *unread),
    )
    return with_typical_machines(case, kinds.known(net)) if machines else case
