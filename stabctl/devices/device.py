"""The record of a device file: the only form in which the rest of the package knows a device.

A device file is a Python module with NAME, ROLE and those of the records, equations and constants below that it needs.
`of` reads them once, checks that each of them means something, and keeps them in a `Device`. What a file leaves out has
its default there: an equation None, a record one without fields, a constant an empty tuple, mapping or text.

Equations are scalar functions marked `@inline`. They name what they read: x (State), u (Input, or single inputs by
name), i (Internal), y (its own Output), p (Par), v (bus voltage, real and imaginary part, pu; v1 and v2 of a link).
"""

import difflib
import inspect
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from dataclasses import fields as fields_of
from functools import cache, cached_property
from importlib import import_module
from types import MappingProxyType, ModuleType
from typing import Any, NamedTuple

import numpy as np

from stabctl._util.content import Content, content
from stabctl._util.errors import StudyError

ROLES: Mapping[str, str] = MappingProxyType(
    {
        "machine": "synchronous machine of a generating unit",
        "converter": "converter that takes the place of the machine of a generating unit",
        "exciter": "excitation system and voltage regulator",
        "governor": "turbine and speed governor",
        "stabilizer": "power system stabilizer",
        "electrical control": "electrical control of a converter",
        "plant control": "plant controller of a converter",
        "drive train": "drive train of a wind turbine with a converter",
        "load": "load at a bus",
        "storage": "energy storage device at a bus",
        "shunt": "controlled shunt at a bus",
        "link": "link between two buses",
        "sensor": "measurement",
        "controller": "control law of storage devices, or a designed controller",
    }
)
AT_BUS = "load", "shunt"  # roles of devices that belong to a bus; the others belong to a machine
Equation = Callable[..., Any] | None


class Empty(NamedTuple):
    """A record without fields."""


def _record(meaning: str) -> Any:
    return field(default=Empty, metadata={"record": True, "meaning": meaning})


def _equation(reads: str, gives: str) -> Any:
    return field(default=None, metadata={"reads": tuple(reads.split()), "meaning": gives})


def _constant(name: str, default: Any, meaning: str) -> Any:
    about: Any = {"constant": name, "meaning": meaning}
    return field(default_factory=dict, metadata=about) if default == {} else field(default=default, metadata=about)


@dataclass(frozen=True, eq=False, repr=False)
class Device:
    """A device model: what its file says, with the meaning of each part beside it."""

    module: ModuleType
    table: str  # name of its file, of its table, and of its signals
    name: str  # in labels and messages, such as SEXS
    role: str  # one of ROLES

    Par: Any = _record("parameters: the columns of its table")
    State: Any = _record("states")
    Input: Any = _record("signals that it reads")
    Output: Any = _record("signals that it gives")
    Internal: Any = _record("quantities that several equations use")

    internal: Equation = _equation("x p", "Internal, computed before the voltages are")
    equations: Equation = _equation("x i u v v1 v2 p", "Output and State: outputs, and derivatives in 1/s")
    output: Equation = _equation("x i u v v1 v2 p", "Output")
    derivatives: Equation = _equation("x i u v v1 v2 y p", "State, the derivatives of the states in 1/s")
    source: Equation = _equation("x i u p", "Norton current of a voltage source, pu on the system base")
    admittance: Equation = _equation("p", "Norton admittance of this source, pu on the system base")
    fault_admittance: Equation = _equation("p", "admittance of a machine in a short circuit, if not that one")
    current: Equation = _equation("x i u v v1 v2 p", "current into the bus or buses, pu on the system base")
    step: Equation = _equation("x u v y p", "Output, or State and Output, of a law: once per time step")
    prepare: Equation = _equation("p", "Par, with the parameters that follow from others")
    guess: Equation = _equation(
        "V I p", "State from which initialization starts; V and I complex, pu; I on the base of the unit"
    )
    automatic: Equation = _equation("p u y", "Par, with the parameters that follow from the starting point")
    inertia: Equation = _equation("p", "inertia constant of a virtual rotor, s on its own base")
    loops: Equation = _equation("p", "LOOPS, where parameters decide what a loop holds")
    elsewhere: Equation = _equation("p", "largest eigenvalue away from the start: of a stopped motor, at limits, 1/s")
    stalled: Equation = _equation("x v p", "whether a motor has stalled")
    blocked: Equation = _equation("p", "Par of a link while a terminal is in an island without a source")
    stepped: Equation = _equation("p power", "Par of a load that draws more power, complex, pu on the system base")
    from_case: Equation = _equation("*", "Par, from a row of loads.csv, storage.csv or links.csv")
    from_record: Equation = _equation("*", "Par and corrections, from the constants of a PSS/E record")
    family: Equation = _equation("op count w k s f on", "a loop written by hand, for devices of any size")
    differentiated: Equation = _equation(
        "count w k s f on", "the local derivatives of such a device, as `_codegen` lays them out"
    )
    sizes: Equation = _equation("k", "numbers of states, inputs, outputs and buses of such a device")
    operations: Equation = _equation("k", "operations of such a device, each with its equations")
    read: Equation = _equation("op w k", "places that an operation of such a device reads")
    fastest: Equation = _equation("k", "largest eigenvalue of such a device, 1/s")

    limits: Mapping[str, Sequence[Any]] = _constant(
        "LIMITS", {}, "state -> low and high non-windup limit (parameter or number), and the input that multiplies both"
    )
    stops: Collection[str] = _constant("STOPS", (), "states of LIMITS at whose limit the power of the device jumps")
    upper: Collection[str] = _constant("UPPER", (), "parameters that are upper limits without a name in ...max")
    levels: Collection[str] = _constant("LEVELS", (), "parameters where a signal bends, which a start may exceed")
    deadbands: Collection[str] = _constant("DEADBANDS", (), "parameters that initialization sets to 0: deadbands")
    closed: Collection[str] = _constant("CLOSED", (), "time constants whose value 0 opens a circuit")
    continuation: Collection[str] = _constant("CONTINUATION", (), "parameters that initialization introduces in steps")
    angles: Collection[str] = _constant("ANGLES", ("delta",), "states that are angles in the synchronous frame")
    phasors: Collection[tuple[str, str]] = _constant("PHASORS", (), "pairs of states that are a phasor in that frame")
    pll: str = _constant("PLL", "", "state that is the angle of a phase-locked loop")
    pll_gains: Sequence[str] = _constant("PLL_GAINS", (), "parameters that are its gains, proportional and integral")
    current_limit: str = _constant("CURRENT_LIMIT", "", "parameter that limits the current of storage, pu on its MVA")
    named_loops: Mapping[str, Collection[str]] = _constant("LOOPS", {}, "control loop -> states; modes are named so")
    controls: Collection[str] | None = _constant(
        "CONTROLS", None, "roles of the controls that a unit may have beside it; without it, all of its kind"
    )
    dyr: Mapping[str, str] = _constant(
        "DYR", {}, "PSS/E record -> its constants in order: parameters, `_name` ignored, `+name` integer, `'name` text"
    )
    kit: Any = _constant("KIT", (), "published models that a storage device consists of")
    start: Sequence[float] = _constant("START", (), "what a law gave before it acts")
    single: bool = _constant("SINGLE", False, "each device has a loop of its own")
    unverified: str = _constant("UNVERIFIED", "", "what its equations have not been compared with")

    def __repr__(self) -> str:
        return f"<{self.role} {self.name}>"

    def __reduce__(self) -> tuple[Any, ...]:
        return _received, (self.module.__name__, self.file)

    @property
    def file(self) -> str:
        """Its file."""
        return str(self.module.__file__)

    @cached_property
    def content(self) -> Content:
        """What a device of the user's consists of when it is first asked for: this is what is compiled."""
        parts = {f.name: vars(self)[f.name] for f in fields_of(self) if f.name != "module"}
        return content({name: part for name, part in parts.items() if part is not Empty}, self.file)

    @property
    def text(self) -> str:
        """The header of its file."""
        return self.module.__doc__ or self.name

    @property
    def injects(self) -> bool:
        """Whether it gives a current to its bus."""
        return self.source is not None or self.current is not None

    def fields(self, record: str) -> tuple[str, ...]:
        """Names of the fields of a record."""
        return tuple(vars(self)[record]._fields)

    def has(self, equation: str) -> bool:
        """Whether its file has an equation."""
        return vars(self)[equation] is not None

    def arguments(self, equation: str) -> tuple[str, ...]:
        """Names of what an equation reads; empty without this equation."""
        return self._arguments[equation]

    @cached_property
    def _arguments(self) -> dict[str, tuple[str, ...]]:
        given = ((name, vars(self)[name]) for name in EQUATIONS)
        return {name: tuple(inspect.signature(found).parameters) if found else () for name, found in given}

    def evaluate(self, equation: str, known: Mapping[str, Any]) -> Any:
        """What an equation gives, reading its arguments from those known by name."""
        return self.call(equation, *(known[name] for name in self.arguments(equation)))

    def outputs_and_rates(self, known: Mapping[str, Any]) -> tuple[Any, Any]:
        """Output, and State with derivatives in 1/s, for arguments known by name; empty where there are none."""
        if self.has("equations"):
            return self.evaluate("equations", known)  # type: ignore[no-any-return]
        y = self.evaluate("output", known) if self.has("output") else Empty()
        return y, self.evaluate("derivatives", {**known, "y": y}) if self.has("derivatives") else Empty()

    def call(self, equation: str, *arguments: Any) -> Any:
        """What an equation gives for these arguments."""
        return vars(self)[equation](*arguments)

    def prepared(self, p: Any) -> Any:
        """Parameters, with those that follow from others."""
        return p if self.prepare is None else self.prepare(p)

    def admittances(self, k: np.ndarray) -> np.ndarray:
        """Norton admittances (devices), complex, pu on the system base, of rows of parameters; 0 without a source."""
        if self.admittance is None:
            return np.zeros(len(k), complex)
        g, b = self.admittance(self.Par(*k.T))
        return np.asarray(g + 1j * b)


EQUATIONS = {f.name: f.metadata["reads"] for f in fields_of(Device) if "reads" in f.metadata}
CONSTANTS = {f.metadata["constant"]: f.name for f in fields_of(Device) if "constant" in f.metadata}
RECORDS = tuple(f.name for f in fields_of(Device) if "record" in f.metadata)
_OF_RECORD = {  # constants that are names of fields -> where these are
    "STOPS": "State", "UPPER": "Par", "LEVELS": "Par", "DEADBANDS": "Par", "CLOSED": "Par", "CONTINUATION": "Par",
    "PLL_GAINS": "Par", "ANGLES": "State", "PLL": "State", "CURRENT_LIMIT": "Par", "LIMITS": "State",
    "PHASORS": "State", "LOOPS": "State",
}  # fmt: skip


def of(module: ModuleType) -> Device:
    """The device of a module, another one if the module was reloaded, which makes its parts anew.

    Raises
    ------
    StudyError
        For the first part that means nothing, with the file and what was probably meant.
    """
    return _of(module, tuple(vars(module).get(name) for name in (*RECORDS, *EQUATIONS)))


@cache
def _of(module: ModuleType, _parts: tuple[Any, ...]) -> Device:
    inside = vars(module)
    known = {name: inside[name] for name in (*RECORDS, *EQUATIONS) if name in inside}
    known |= {name: inside[constant] for constant, name in CONSTANTS.items() if constant in inside}
    device = Device(module, module.__name__.rpartition(".")[2], inside["NAME"], inside["ROLE"], **known)
    for text in mistakes(device):
        raise StudyError(f"{device.file}: {text}{'' if text.endswith('?') else '.'}")
    return device


def mistakes(device: Device) -> Iterator[str]:
    """What means nothing in a device, each without its file and without a final period."""
    if device.role not in ROLES:
        yield f"the role {device.role!r} is not known{_meant(device.role, ROLES) or '; use one of ' + ', '.join(ROLES)}"
    for name in RECORDS:
        if not (isinstance(vars(device)[name], type) and issubclass(vars(device)[name], tuple)):
            yield f"{name} is no record; write class {name}(NamedTuple)"
            return
    for name in EQUATIONS:
        if device.has(name) and not callable(vars(device)[name]):
            yield f"{name} is no function"
            return
    yield from _incomplete(device)
    yield from _unknown_arguments(device)
    yield from _unknown_fields(device)


def _incomplete(device: Device) -> Iterator[str]:
    """A record without the equation that gives it, or the other way around."""
    if device.has("equations"):
        for name in ("output", "derivatives"):
            if device.has(name):
                yield f"it defines equations and also {name}, which equations gives"
        for record in ("State", "Output"):
            if vars(device)[record] is Empty:
                yield f"it defines equations but not {record}"
    elif device.step is None and device.family is None:
        for record, equation in (("State", "derivatives"), ("Output", "output")):
            if (vars(device)[record] is not Empty) != device.has(equation):
                there, missing = (equation, record) if device.has(equation) else (record, equation)
                yield f"it defines {there} but not {missing}"


def _unknown_arguments(device: Device) -> Iterator[str]:
    for name, allowed in EQUATIONS.items():
        known = (*allowed, *device.fields("Input")) if "u" in allowed else allowed
        for argument in device.arguments(name) if allowed != ("*",) else ():
            if argument not in known:
                yield f"{name} has an unknown argument {argument!r}; it may take {', '.join(known)}"


def _unknown_fields(device: Device) -> Iterator[str]:
    """Names in constants that no record has; a text where a collection is needed is one."""
    for constant, record in _OF_RECORD.items():
        value = vars(device)[CONSTANTS[constant]]
        text = constant in ("PLL", "CURRENT_LIMIT")
        if isinstance(value, str) != text or not isinstance(value, Collection):
            yield f"{constant} = {value!r} is no {'name' if text else 'collection of names'}"
            continue
        names: Collection[Any] = (value,) if text and value else value
        if isinstance(value, Mapping) and constant == "LOOPS":
            names = [name for group in value.values() for name in group]
        if constant == "PHASORS":
            names = [name for pair in value for name in pair]
        if constant != "ANGLES" or tuple(value) != ("delta",):
            yield from (_unknown(constant, name, record, device) for name in names if name not in device.fields(record))
    yield from (f"STOPS contains {n!r}, which LIMITS does not" for n in device.stops if n not in device.limits)
    for state, limit in device.limits.items():
        if not 2 <= len(limit) <= 3:
            yield f"LIMITS of {state} has {len(limit)} entries; give the low and the high limit, and perhaps an input"
            continue
        for name, record in zip(limit, ("Par", "Par", "Input"), strict=False):
            if isinstance(name, str) and name not in device.fields(record):
                yield _unknown("LIMITS", name, record, device)
    if not device.from_record:
        for kind, constants in device.dyr.items():
            for name in (text.lstrip("+'") for text in constants.split()):
                if not name.startswith("_") and name not in device.fields("Par"):
                    yield _unknown(f"DYR {kind}", name, "Par", device)


def _unknown(constant: str, name: str, record: str, device: Device) -> str:
    known = device.fields(record)
    return f"{constant} contains {name!r}, which is not a field of {record}{_meant(name, known)}"


def _meant(name: str, known: Collection[str]) -> str:
    near = difflib.get_close_matches(str(name), known, 1)
    return f"; did you mean {near[0]}?" if near else ""


def misspelt(module: ModuleType) -> str | None:
    """What is wrong with a name that nothing reads and that is nearly one with a meaning; None if there is none."""
    known = (*CONSTANTS, *EQUATIONS, *RECORDS, "NAME", "ROLE")
    functions = [value for value in vars(module).values() if inspect.isfunction(value)]
    used = {name for function in functions for name in function.__code__.co_names}
    for name, value in vars(module).items():
        own = name.isupper() or (inspect.isfunction(value) and value.__module__ == module.__name__)
        if own and name not in known and name not in used and not name.startswith("_"):
            near = difflib.get_close_matches(name, known, 1, 0.8)
            if near:
                return f"it defines {name}, which nothing reads; did you mean {near[0]}?"
    return None


def _received(name: str, file: str) -> Device:
    """A device from another process; one that was registered there is registered here, too."""
    if name not in sys.modules:
        from stabctl import devices  # imported late: it imports this module

        table = name.rpartition(".")[2]
        if table in devices.every():
            return devices.every()[table]
        if not name.startswith("stabctl."):
            devices.register(file)
    return of(import_module(name))
