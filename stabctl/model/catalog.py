"""The device models that have a table of their own, `<model>.csv`, and the key of its rows.

A load model is keyed by bus and gives dynamic parameters to a row of loads.csv. A shunt is also keyed by bus, and may
be at any bus. Every other model is keyed by machine.
"""

from collections.abc import Mapping
from typing import Any

from stabctl import devices
from stabctl.devices.device import Device
from stabctl.schema import Field, fields

from .tables import TABLES

LEFT_BY = {"converter": ("exciter", "governor", "stabilizer"), "machine": devices.OF_CONVERTER}  # role -> controls
UNIT_ROLES = ("machine", "converter")  # every row of machines.csv has exactly one model with one of these
_OWNERS = {"load": ("loads", "bus"), "shunt": ("buses", "bus")}  # role -> table and column of the key
SINGLE_ROLES = (
    *UNIT_ROLES,
    "exciter",
    "governor",
    *devices.OF_CONVERTER,
)  # a machine has at most one model with each of these


def models() -> Mapping[str, Device]:
    """Device models by name, without those that use a table of the case."""
    return {name: device for name, device in devices.models().items() if fields(device.Par)}


def role(model: str) -> str:
    """Role of a model: machine, converter, exciter, governor, stabilizer, load ..."""
    return models()[model].role


def of_role(*roles: str) -> list[str]:
    """Names of the models with one of these roles."""
    return [name for name, device in models().items() if device.role in roles]


def key_field(model: str) -> Field:
    """The column that says what a row of a model's table belongs to: `bus` or `machine`."""
    table, column = _OWNERS.get(role(model), ("machines", "machine"))
    return fields(TABLES[table])[column]


def at_bus(model: str) -> bool:
    """Whether the model is keyed by bus."""
    return role(model) in _OWNERS


def columns(model: str) -> dict[str, Field]:
    """Every column of a model's table, its key first."""
    key = key_field(model)
    return {key.name: key, **fields(models()[model].Par)}


def parameters(model: str, **values: Any) -> Any:
    """Parameters of a model from the columns of a row; fields that are filled from the case are 0."""
    record = models()[model].Par
    unfilled = {name: 0.0 for name in record._fields if name not in fields(record)}
    return record(**unfilled, **values)


def takes(model: str, control: str) -> bool:
    """Whether a unit of this model may have a control of that role: any, unless its CONTROLS lists some."""
    allowed = models()[model].controls
    return allowed is None or control in allowed
