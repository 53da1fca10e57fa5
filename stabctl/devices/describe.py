"""Description of a device as plain records, for `stabctl models`, the page of models, and tests."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, get_args, get_type_hints

from stabctl._util.errors import StudyError
from stabctl._util.schema import hints
from stabctl._util.wording import near
from stabctl.devices import ROLES, every
from stabctl.devices.device import Device
from stabctl.devices.ports import At, Port


class Signal(NamedTuple):
    """A state, input or output; `from_` says what an input reads."""

    name: str
    unit: str
    meaning: str
    from_: str = ""


class Parameter(NamedTuple):
    """A parameter: what is allowed, and its default; both are empty if it is filled from the case."""

    name: str
    unit: str
    meaning: str
    allowed: str
    default: float | str | None


class Limit(NamedTuple):
    """A state with non-windup limits."""

    state: str
    low: str
    high: str


class Description(NamedTuple):
    """A device. `name` is that of its file and table, `title` and `text` are the parts of its docstring.

    `unverified` says what its equations have not been compared with; it is empty for most devices.
    """

    name: str
    title: str
    role: str
    role_meaning: str
    text: str
    parameters: tuple[Parameter, ...]
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    limits: tuple[Limit, ...]
    unverified: str = ""


def describe(name: str) -> Description:
    """Describe the device with this name, that of its file (genrou) or its NAME (GENROU).

    Raises
    ------
    StudyError
        If there is no such device.
    """
    devices = every()
    found = name if name in devices else next((k for k, m in devices.items() if m.name.lower() == name.lower()), None)
    if found is None:
        raise StudyError(f"There is no model {name!r}; {near(name.lower(), devices, 'the models are')}")
    device = devices[found]
    title, _, text = device.text.partition("\n")
    states, inputs, outputs = (tuple(_signals(device, record)) for record in ("State", "Input", "Output"))
    return Description(
        found,
        title.rstrip(". "),
        device.role,
        ROLES[device.role],
        text.strip("\n"),
        tuple(_parameters(device)),
        states,
        inputs,
        outputs,
        tuple(_limits(device)),
        device.unverified,
    )


def _parameters(device: Device) -> Iterator[Parameter]:
    given = hints(device.Par)
    for name, (_, unit, meaning, *_) in _annotated(device.Par).items():
        field = given[name]
        if field is None:
            yield Parameter(name, unit, meaning, "", None)
        else:
            yield Parameter(name, unit, meaning, field.expected(), None if field.required else field.default)


def _signals(device: Device, record: str) -> Iterator[Signal]:
    for name, (_, unit, meaning, *rest) in _annotated(vars(device)[record]).items():
        yield Signal(name, unit, meaning, _reads(rest) if record == "Input" else "")


def _annotated(record: type) -> Mapping[str, tuple[Any, ...]]:
    return {name: get_args(hint) for name, hint in get_type_hints(record, include_extras=True).items()}


def _reads(markers: list[Any]) -> str:
    """What an input reads, in words."""
    for marker in markers:
        if isinstance(marker, At):
            return f"{marker.signal} at the bus or machine of {marker.place}"
        if isinstance(marker, Port) and marker.summing:
            return "sum of all outputs of this name in its unit"
        if isinstance(marker, Port) and marker.start is not None:
            return f"output of this name in its unit, otherwise a set-point, initially {marker.start:g}"
        if isinstance(marker, Port):
            return "output of this name in its unit, otherwise a set-point from initialization"
    return "signal of this name in its unit"


def _limits(device: Device) -> Iterator[Limit]:
    for state, (low, high, *per) in device.limits.items():
        yield Limit(
            state, *(f"{limit:g}" if isinstance(limit, float) else " x ".join((limit, *per)) for limit in (low, high))
        )
