"""Storage devices: a store of energy, ideal or behind a converter, composed by the table below.

A store says how much power it can take and give, and how its energy changes. A file that connects a store (`ideal`,
`following`, `framed`, `forming`) is executed once for each of its compositions, and asks `parts` for the store, the
converter, and what stands between the orders and the converter.
"""

import sys
from collections.abc import Mapping
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from threading import RLock
from types import MappingProxyType, ModuleType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

STORES = {"esd": "battery", "supercap": "supercapacitor", "flywheel": "flywheel"}  # prefix -> file of the store
CONNECTIONS = {  # suffix -> the file that connects the store, the converter, what stands before it
    "": ("ideal",),
    "regc": ("following", "converters.regc_a", "storage.direct"),
    "regc_b": ("following", "converters.regc_b", "storage.direct"),
    "regc_c": ("framed", "converters.regc_c", "storage.direct"),
    "regc_repc": ("following", "converters.regc_a", "storage.plant"),
    "regc_b_repc": ("following", "converters.regc_b", "storage.plant"),
    "regc_c_repc": ("framed", "converters.regc_c", "storage.plant"),
    "regfm": ("forming", "converters.regfm_a1"),
    "regfm_b1": ("forming", "converters.regfm_b1"),
}
_lock = RLock()  # a module is complete before another thread has it


class Before(Protocol):
    """What stands between the orders of a device and the electrical control of its converter."""

    NAME: str
    Par: Any
    State: Any
    Input: Any
    DEADBANDS: Any  # names of its parameters that are deadbands

    def kit(self, of: Any) -> Any:
        """The published models of a device, with its own."""

    def references(self, x: Any, u: Any, shares: Any, vt: Any, P: Any, Q: Any, p: Any) -> tuple[Any, Any]:
        """What the electrical control reads, and the derivatives (1/s) of its own states.

        `shares` are active and reactive power over the rating; vt, P and Q are those at the terminals (pu converter).
        """

    def guess(self, V: complex, p: Any) -> Any:
        """Its states at rest."""


class Composition(NamedTuple):
    """A storage device made of parts."""

    device: str
    behind: str  # file that connects the store
    parts: tuple[str, ...]  # modules of `devices`: the store, then those of CONNECTIONS


def _compositions() -> dict[str, Composition]:
    found = {}
    for prefix, store in STORES.items():
        for suffix, (behind, *rest) in CONNECTIONS.items():
            device = "_".join(filter(None, (prefix, suffix)))
            model = (suffix or "ideal") if prefix == "esd" else device
            found[model] = Composition(device, behind, (f"stores.{store}", *rest))
    return found


MODELS: Mapping[str, Composition] = MappingProxyType(_compositions())  # by the names in the column storage_model
DEVICES: Mapping[str, Composition] = MappingProxyType({one.device: one for one in MODELS.values()})
if TYPE_CHECKING:
    from stabctl.devices.stores import Store, battery, flywheel, supercapacitor

    from . import direct, plant

    _stores: tuple[Store, ...] = (battery, supercapacitor, flywheel)  # the type checker compares them
    _before: tuple[Before, ...] = (direct, plant)
    StorageModel = str
else:
    StorageModel = Literal[tuple(MODELS)]


def parts(module: str) -> tuple[Any, ...]:
    """Store, converter and what stands before it, of the composition whose module this is."""
    return tuple(import_module(f"stabctl.devices.{part}") for part in DEVICES[module.rpartition(".")[2]].parts)


def composed(device: str) -> ModuleType:
    """The module of a device, made at its first use."""
    name, one = f"{__name__}.{device}", DEVICES[device]
    with _lock:
        if name not in sys.modules:
            spec: Any = spec_from_file_location(name, Path(__file__).with_name(f"{one.behind}.py"))
            module = sys.modules[name] = module_from_spec(spec)
            try:
                spec.loader.exec_module(module)
            except BaseException:
                del sys.modules[name]
                raise
            module.__doc__ = _text(module.__doc__ or "", parts(name))
        return sys.modules[name]


def _text(text: str, of: tuple[Any, ...]) -> str:
    """The header of a file with the names of the parts."""
    text = text.replace("STORE", of[0].NAME).replace("CONVERTER", of[1].NAME if len(of) > 1 else "")
    title, _, rest = text.partition("\n")
    before = of[2].NAME if len(of) > 2 else ""
    return f"{title.rstrip('.')}{before and f', and plant control {before}'}.\n{rest}"
