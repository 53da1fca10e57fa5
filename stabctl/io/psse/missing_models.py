"""Machines and controls without a model: refused, or on request injections and constant controls."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from stabctl._util.wording import named
from stabctl.errors import CaseError
from stabctl.model import catalog, keys
from stabctl.model.tables import Load, Machine

from ..table_builder import POWER_LOW
from .devices import Dynamics, Unsupported
from .generators import Source
from .network import Network

SHOWN = 8  # names in a list
ACTS_ON = {"stabilizer": "exciter", "plant control": "electrical control"}


def settle(
    net: Network,
    dynamics: Dynamics,
    sources: Mapping[tuple[int, str], Source],
    dyr: str | Path | None,
    missing: str,
    missing_controls: str,
) -> list[str]:
    """Replace or refuse what has no model; returns a sentence for everything replaced.

    Raises `CaseError` with the list if it is refused.
    """
    names = {source.machine: f"{bus}/{id}" for (bus, id), source in sources.items()}
    lacking = without(net, dynamics) if dyr is not None else []
    gone = {names[m.machine] for m in lacking}
    controls = [u for u in dynamics.unsupported if u.machine and u.machine not in gone]
    _refuse(dyr, lacking if missing == "refuse" else [], controls if missing_controls == "refuse" else [], dynamics)
    said = [_new_swing(net, bus, lacking) for bus in _swings_without(net, lacking)]
    said += [_injection(net, dynamics, m) for m in lacking]
    return said + _without_owner(dynamics, names)


def without(net: Network, dynamics: Dynamics) -> list[Machine]:
    """The machines that no record models."""
    modeled = {
        keys.number(key) for model in catalog.of_role(*catalog.UNIT_ROLES) for key in dynamics.rows.get(model, {})
    }
    return [m for m in net.rows["machines"] if m.machine not in modeled]


def _refuse(
    dyr: str | Path | None, machines: Sequence[Machine], controls: Sequence[Unsupported], dynamics: Dynamics
) -> None:
    """Raise `CaseError` with the list of machines and controls without a model, if there are any."""
    tried = {u.machine: f" ({u.kind}, line {u.place.line}: {u.reason})" for u in reversed(dynamics.unsupported)}
    parts, remedies = [], []
    if machines:
        listed = _listed(f"{m.name}{tried.get(m.name, '')}" for m in machines)
        parts.append(f"{named(len(machines), 'machine')} {listed}")
        become = "it an injection" if len(machines) == 1 else "them injections"
        remedies.append(f"--missing injection makes {become} of constant power")
    if controls:
        parts.append(_listed(f"{u.kind} of {u.machine} (line {u.place.line}: {u.reason})" for u in controls))
        remedies.append("--missing-controls fixed keeps what such records control constant")
    if parts:
        raise CaseError(f"{dyr}: no model for {' and for '.join(parts)}; {', '.join(remedies)}.")


def _swings_without(net: Network, lacking: Sequence[Machine]) -> list[int]:
    """The swing buses that keep no machine."""
    kept = {m.bus for m in net.rows["machines"] if m not in lacking}
    return [b.bus for b in net.rows["buses"] if b.kind == "swing" and b.bus not in kept]


def _new_swing(net: Network, bus: int, lacking: Sequence[Machine]) -> str:
    """Make the bus of the largest machine of an island with a model its swing bus, at its stored voltage."""
    island = dict(zip((b.bus for b in net.rows["buses"]), net.islands().tolist(), strict=True))
    others = [m for m in net.rows["machines"] if m not in lacking and island[m.bus] == island[bus]]
    place = net.places["buses"][net.at[bus]]
    if not others:
        raise place.error(f"no machine of the island of swing bus {bus} has a model in the DYR file.")
    largest = max(others, key=lambda m: m.base)
    net.change(largest.bus, kind="swing")
    net.change(bus, kind="pv")
    return f"{place}: no machine at the swing bus {bus} has a model; bus {largest.bus} is the swing bus instead."


def _injection(net: Network, dynamics: Dynamics, m: Machine) -> str:
    """Replace a machine by an injection of its stored power."""
    i = net.rows["machines"].index(m)
    place = net.places["machines"].pop(i)
    del net.rows["machines"][i]
    for model, rows in dynamics.rows.items():
        if not catalog.at_bus(model):
            gone = [k for k, key in enumerate(rows) if keys.number(key) == m.machine]
            for key in [list(rows)[k] for k in gone]:
                del rows[key]
            dynamics.places[model] = [p for k, p in enumerate(dynamics.places[model]) if k not in gone]
    if all(other.bus != m.bus for other in net.rows["machines"]):
        net.change(m.bus, kind="pq")
    if m.p or m.q:
        net.add("loads", Load(m.bus, -m.p, -m.q, 1.0, 1.0, v_low=POWER_LOW, id=m.name, kind="injection"), place)
    return f"{place}: machine {m.name} has no model and is a constant-power injection of {m.p:.4g} MW, {m.q:.4g} Mvar."


def _without_owner(dynamics: Dynamics, names: Mapping[int, str]) -> list[str]:
    """Leave out the controls that act on a control which has no model: its stabilizers, its plant control."""
    said = []
    for role, owner in ACTS_ON.items():
        known = {keys.number(key) for model in catalog.of_role(owner) for key in dynamics.rows.get(model, {})}
        for model in catalog.of_role(role):
            rows: dict[keys.Key, Any] = dynamics.rows.get(model, {})
            for key, place in zip(list(rows), list(dynamics.places.get(model, ())), strict=True):
                if keys.number(key) not in known:
                    del rows[key]
                    dynamics.places[model].remove(place)
                    said.append(
                        f"{place}: {model} of {names[keys.number(key)]} left out, because its {owner} has no model."
                    )
    return said


def _listed(names: Iterable[str]) -> str:
    names = list(names)
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more
