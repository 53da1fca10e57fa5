"""Constants of a DYR record as parameters of a device, by the `DYR` data of the device modules."""

from collections.abc import Iterator, Mapping
from functools import cache
from types import MappingProxyType
from typing import Any

from stabctl.devices.blocks.lags import SHORT
from stabctl.model import catalog
from stabctl.schema import fields

from ..table_builder import NO_IMPEDANCE
from .dyr import Record
from .generators import Source
from .lexer import number, whole

REACTANCES = "x1d", "Xe"  # parameters that are the source reactance of a generator where no constant gives them


@cache
def kinds() -> Mapping[str, tuple[str, str]]:
    """Kind of record -> name of the device model, and its constants in order."""
    found = {kind: (name, order) for name, device in catalog.models().items() for kind, order in device.dyr.items()}
    return MappingProxyType(found)


def parameters(record: Record, model: str, order: str, source: Source | None) -> tuple[Any, list[str]]:
    """Parameters of a device and what was corrected in them; `ValueError` with a sentence for an unsupported code."""
    device, names = catalog.models()[model], order.split()
    values: dict[str, Any] = {}
    if len(record.constants) < len(names):
        given = len(record.constants)
        text = f"the record has {given} constants, {record.kind} of {record.bus}/{record.id} needs {len(names)}."
        raise record.place.error(text)
    for k, (name, text) in enumerate(zip(names, record.constants, strict=False), 1):
        plain = name.lstrip("+_'")
        if name.startswith("'"):
            values[plain] = text.strip()
            continue
        value = (whole if name.startswith("+") else number)(
            text or "0", record.place, f"constant {k} ({plain or 'unused'})"
        )
        if not name.startswith("_"):
            values[plain] = value
    sentences: list[str] = []
    if device.from_record is not None:
        made, sentences = device.from_record(record.kind, values)
        values = made if isinstance(made, dict) else made._asdict()
    allowed = fields(device.Par)
    values = {name: value for name, value in values.items() if name in allowed}
    if source is not None:
        behind = next((name for name in REACTANCES if name in allowed and name not in names), None)
        if behind and source.x == 0:
            source = source._replace(x=NO_IMPEDANCE)
            sentences = [*sentences, f"ZX = 0: the source reactance is {NO_IMPEDANCE:g} pu."]
        for name, value in (("ra", source.ra), ("Re", source.ra), *((name, source.x) for name in REACTANCES)):
            if name in allowed and name not in names:
                values[name] = value
    extra = len(record.constants) - len(names)
    if extra > 0 and any(number(text or "0", record.place, "constant") for text in record.constants[len(names) :]):
        sentences = [*sentences, f"{extra} further constants are not used."]
    par = catalog.parameters(model, **values)
    return par, [*sentences, *_short_lags(par, catalog.role(model))]


def _short_lags(par: Any, role: str) -> Iterator[str]:
    """A sentence for every time constant of a control that is too short to be simulated."""
    if role in catalog.UNIT_ROLES:
        return
    kind: type = type(par)
    for name, of in fields(kind).items():
        if of.unit == "s" and 0 < getattr(par, name) < SHORT:
            yield f"{name} = {getattr(par, name):g} s is below {1e3 * SHORT:g} ms, where a lag is bypassed."
