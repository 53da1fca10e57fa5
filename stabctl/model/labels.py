"""Names of machines and buses: machine 30/1 is the one with identifier 1 at bus 30; a bus may have a name."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .case import Case

STORAGE = "ESD "  # begins the names of storage devices in messages: ESD 1@2


def machine_number(case: "Case", name: object) -> int | None:
    """Number of the machine with this number or name; the bus before the slash of a name may be given by its own."""
    text = _plain(name)
    if text.isdecimal():
        return next((m.machine for m in case.machines if str(m.machine) == text), None)
    where, slash, id = text.rpartition("/")
    bus = bus_number(case, where) if slash else None
    wanted = text if bus is None else f"{bus}/{id.strip()}"
    return next((m.machine for m in case.machines if m.name and _plain(m.name) == wanted), None)


def bus_number(case: "Case", name: object) -> int | None:
    """Number of the bus with this number, or with this name if only one has it; capitals do not matter."""
    text = _plain(name)
    if text.isdecimal():
        return next((b.bus for b in case.buses if str(b.bus) == text), None)
    found = [b.bus for b in case.buses if b.name and _plain(b.name) == text]
    return found[0] if len(found) == 1 else None


def bus(case: "Case", number: int) -> str:
    """A bus in words: `bus 7`, or `bus 7 (NORTH)` if it has a name."""
    name = next((b.name for b in case.buses if b.bus == number), "")
    return f"bus {number} ({name})" if name else f"bus {number}"


def unit(name: int | str) -> str:
    """What lost synchronism in words: `machine 3`, or `storage device ESD 1@2`."""
    return f"storage device {name}" if str(name).startswith(STORAGE) else f"machine {name}"


def order(name: int | str) -> tuple[int, str]:
    """Key for sorting names of machines: numbers by size."""
    return len(str(name)), str(name)


def _plain(name: object) -> str:
    """A name in capitals, with single blanks; a number without leading zeros."""
    text = " ".join(str(name).split()).upper()
    return text.lstrip("0") or text if text.isdecimal() else text
