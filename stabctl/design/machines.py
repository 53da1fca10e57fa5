"""Machines that get a stabilizer, and systems without those that they have."""

from collections.abc import Iterable, Sequence

from stabctl._util.errors import StudyError, shown
from stabctl.model import naming, tables
from stabctl.model.case import Case


def with_exciter(case: Case, machines: Iterable[int] | None) -> list[int]:
    """The machines that get a stabilizer: those named, or all with an exciter."""
    if machines is not None and (isinstance(machines, str) or not isinstance(machines, Iterable)):
        raise StudyError(f"machines = {shown(machines)} is not a list of machines; give [1, 2], for example.")
    found = [m.machine for m in case.machines if case.model(m.machine, "exciter")]
    numbers = found if machines is None else [case.machine(n).machine for n in machines]
    for n in numbers:
        if n not in found:
            raise StudyError(
                f"Machine {n} of {case.name} has no exciter, so it can have no stabilizer; choose other machines."
            )
    if not numbers:
        raise StudyError(f"{case.name} has no machine with an exciter, so it can have no stabilizer.")
    return numbers


def without_stabilizers(case: Case, numbers: Sequence[int]) -> Case:
    """The case without the stabilizers that some machines have; the case itself if they have none."""
    for model in tables.of_role("stabilizer"):
        places = set(numbers) & set(map(naming.number, case.devices.get(model, ())))
        case = case.without_device(model, sorted(places)) if places else case
    return case
