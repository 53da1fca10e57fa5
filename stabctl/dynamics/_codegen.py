"""The compiled loop of every model: its source text, the function made of it, its address in this process.

    family(op, n, w, k, s, f, on)   op       which of the equations, see `family`
                                    n        devices
                                    w (i64)  a row of places per device: state, bus, second bus, unit, inputs, output
                                    k (f64)  a row of parameters per device, in the order of Par
                                    s        every signal: states, voltages, set-points, outputs
                                    f        derivatives and injected currents, at the places of states and voltages
                                    on (i64) island of every unit, -1 if it is off

The loop is generated from the field names of Par, State, Input and Output and from the argument names of the equations:
x state, u inputs, v bus voltage (v1, v2 of a link), y own output, p parameters, or the name of one input. It is
generated once for real numbers (simulation) and once for complex numbers (derivatives by complex step, h = 1e-30).
"""

import sys
from collections.abc import Callable
from functools import cache
from types import ModuleType
from typing import Any

from stabctl._util import jit, object_code
from stabctl._util.words import Loaded
from stabctl.devices.device import Device

from .family import (
    BUS,
    BUS2,
    CURRENT,
    INPUTS,
    LOCAL,
    OUTPUT,
    SOURCE,
    STATE,
    TINY,
    UNIT,
    both,
    equations,
    fused,
    shape,
    width,
)

plain: list[Any] = []  # with NUMBA_DISABLE_JIT=1 an "address" is a row of this list
_compiled: dict[tuple[Device, type], int | Loaded] = {}


def address(name: str, device: Device, scalar: type) -> int:
    """Address of the compiled loop in this process."""
    key = device, scalar
    with jit.lock:
        if key not in _compiled:
            function = _module(name, device, scalar)
            if jit.disabled():
                plain.append(function)
                _compiled[key] = len(plain) - 1
            else:
                _compiled[key] = _load(function, scalar)
    found = _compiled[key]
    return found if isinstance(found, int) else found.address


def _load(function: Callable[..., None], scalar: type) -> Loaded:
    def compiled(symbol: str) -> object_code.Code:
        return jit.compiler().callback(function, scalar, symbol)

    return object_code.found(function.__module__, "", compiled, jit.numba_version)


def on_disk(name: str, device: Device, scalar: type) -> bool:
    """Whether the object code of a family is on disk, loaded, or not needed."""
    if jit.disabled() or (device, scalar) in _compiled:
        return True
    return object_code.here(_module(name, device, scalar).__module__)


@cache
def _module(name: str, device: Device, scalar: type) -> Callable[..., None]:
    """The loop as a Python function of a module that is named after its source text."""
    kind = scalar.__name__
    inside = device.module.__package__
    text = f"import {device.module.__name__} as device\n" if inside else "import sys\n"
    if not inside:
        text += f"device = sys.modules[{device.module.__name__!r}]\n"
    text += f"\n\n{write(device, name, scalar)}"
    stem = f"{name}_{kind}_{jit.digest(text, made_of(device))}"
    module = sys.modules[stem] = ModuleType(stem)
    exec(compile(text, f"<{stem}>", "exec"), vars(module))  # text generated above
    return getattr(module, name)  # type: ignore[no-any-return]


def made_of(device: Device) -> str:
    """What the code of a device is made from: sources of the package, and content of what is the user's."""
    if device.module.__name__.startswith("stabctl."):
        return jit.sources(device.module)
    return "".join([device.content.text, *map(jit.sources, device.content.package)])


def write(device: Device, name: str, scalar: type) -> str:
    """Source text of the family's loop, for float or complex."""
    text = [f"def {name}(op, n, w, k, s, f, on):"]
    if device.family is not None:
        text += ["    device.family(op, n, w, k, s, f, on)"]
        if scalar is complex and device.differentiated is not None:
            text += [f"    if op == {LOCAL}:", "        device.differentiated(n, w, k, s, f, on)"]
        return "\n".join([*text, ""])
    ops = equations(device)
    if scalar is complex:
        if fused(device):
            ops = {**ops, OUTPUT: both(device)[:1]}
        ops = {op: ops[op] for op in (CURRENT, OUTPUT) if op in ops}
    for op, names in ops.items():
        text += [f"    if op == {op}:", "        for j in range(n):"]
        text += [f"            {line}" for line in _body(device, op, names, op == SOURCE or scalar is complex)]
    if scalar is complex:
        text += [f"    if op == {LOCAL}:", *(f"        {line}" for line in _local(device))]
    return "\n".join([*text, ""])


def _body(device: Device, op: int, names: tuple[str, ...], anew: bool) -> list[str]:
    """Lines that evaluate equations of one device and store the results."""
    head, (row, bus, place) = _head(device) | _internal(device, anew), _places(device)
    links, outputs = shape(device)[3] == 2, len(device.Output._fields)
    inject = [bus, "f[b] += g[0]", "f[b + 1] += g[1]", *(("f[b2] += g[2]", "f[b2 + 1] += g[3]") if links else ())]
    shown = [place, *(f"s[o + {i}] = y.{n}" for i, n in enumerate(device.Output._fields))]
    rates = [row, *(f"f[first + {i}] = d.{n}" for i, n in enumerate(device.State._fields))]
    memory = [row, *(f"s[first + {i}] = x.{n}" for i, n in enumerate(device.State._fields))]
    result = {"source": "g", "current": "g", "output": "y", "derivatives": "d", "step": "x, y" if memory[1:] else "y"}
    store = {"source": inject, "current": inject, "output": shown, "derivatives": rates}
    result["equations"], store["equations"] = "y, d", shown if op == OUTPUT else [*shown, *rates]
    store["step"] = [*(memory if memory[1:] else ()), *shown]
    of_unit = op in (SOURCE, CURRENT) and device.role in ("machine", "converter")
    lines = [f"if on[w[{width(device)} * j + {UNIT}]] < 0:", "    continue"] if of_unit else []
    keep = [place, *(f"s[o + {outputs + k}] = i.{n}" for k, n in enumerate(device.Internal._fields))]
    if not names:
        return [*lines, *(line for a in ("x", "p", "i") for line in head[a]), *keep]
    known: set[str] = set()
    for name in names:
        needed = _needed(device, name, anew)
        lines += [line for a in needed if a not in known for line in head[a]]
        if op == SOURCE and "i" in needed:
            lines += keep
        known |= {*needed, result[name]}
        lines += [f"{result[name]} = device.{name}({', '.join(device.arguments(name))})", *store[name]]
    return lines


def _needed(device: Device, equation: str, anew: bool) -> tuple[str, ...]:
    """Arguments of an equation, in an order in which they can be computed."""
    names = device.arguments(equation)
    return ("x", "p", *(n for n in names if n not in ("x", "p"))) if anew and "i" in names else names


def _internal(device: Device, anew: bool) -> dict[str, tuple[str, ...]]:
    """Lines that compute the internal quantities, or read those that SOURCE has stored after the outputs."""
    outputs, names = len(device.Output._fields), device.Internal._fields
    if anew:
        return {"i": ("i = device.internal(x, p)",)}
    kept = ", ".join(f"s[o + {outputs + k}]" for k in range(len(names)))
    return {"i": (_places(device)[2], f"i = device.Internal({kept})")}


def _local(device: Device) -> list[str]:
    """Lines that write the outputs, derivatives and currents of every device, perturbing each of its variables in turn.

    Block j of f has a row per state, input and voltage component and a last one without perturbation; its columns are
    the derivatives, the outputs and the injected currents.
    """
    states, inputs, outputs, buses = shape(device)
    if device.step is not None:
        return ["pass"]
    rows, columns = states + inputs + 2 * buses, states + outputs + 2 * buses
    head = _head(device, f"{TINY}j")
    lines: list[str] = []
    known = {"y"}
    for a in ("p", "x", "u", *((), ("v",), ("v1", "v2"))[buses]):
        if a in "pxu" and not device.fields({"p": "Par", "x": "State", "u": "Input"}[a]):
            continue
        lines += head[a]
        known.add(a)
    body = ["i = device.internal(x, p)"] if device.internal is not None else []
    known.add("i")
    two = device.source is not None and device.current is not None
    results = {"equations": "y, d", "output": "y", "derivatives": "d", "source": "g", "current": "c" if two else "g"}
    for equation, result in results.items():
        if device.has(equation):
            needed = device.arguments(equation)
            body += [line for a in needed if a not in known for line in head[a]]
            known |= set(needed)
            body += [f"{result} = device.{equation}({', '.join(needed)})"]
    body += ["g = g[0] + c[0], g[1] + c[1]"] if two else []
    names = [f"d.{n}" for n in device.State._fields]
    names += [f"y.{n}" for n in device.Output._fields]
    names += [f"g[{i}]" for i in range(2 * buses)] if device.injects else ["0j"] * 2 * buses
    body += [f"f[a + {i}] = {value}" for i, value in enumerate(names)]
    inner = [f"        {line}" for line in (*lines, *body, f"a += {columns}")]
    return ["a = 0", "for j in range(n):", f"    for c in range({rows + 1}):", *inner]


def _head(device: Device, step: str = "") -> dict[str, tuple[str, ...]]:
    """Lines that read each kind of argument; `step` is added to every variable that may be differentiated."""
    par, state, inputs, shown = (device.fields(record) for record in ("Par", "State", "Input", "Output"))
    (row, bus, place), columns = _places(device), width(device)
    at = {n: INPUTS + i for i, n in enumerate(inputs)}
    count = iter(range(10**6))

    def perturbed(text: str) -> str:
        return f"{text} + ({step} if c == {next(count)} else 0)" if step else text

    x = ", ".join(perturbed(f"s[first + {i}]") for i in range(len(state)))
    u = ", ".join(perturbed(f"s[w[{columns} * j + {at[n]}]]") for n in inputs)
    v = [f"({perturbed(f's[{b}]')}, {perturbed(f's[{b} + 1]')})" for b in ("b", "b2")]
    return {
        "p": (f"p = device.Par({', '.join(f'k[{len(par)} * j + {i}]' for i in range(len(par)))})",),
        "x": (row, f"x = device.State({x})"),
        "u": (f"u = device.Input({u})",),
        "v": (bus, f"v = {v[0]}"),
        "v1": (bus, f"v1 = {v[0]}"),
        "v2": (f"v2 = {v[1]}",),
        "y": (place, f"y = device.Output({', '.join(f's[o + {i}]' for i in range(len(shown)))})"),
        **{n: (f"{n} = u.{n}",) if step else (f"{n} = s[w[{columns} * j + {at[n]}]]",) for n in inputs},
    }


def _places(device: Device) -> tuple[str, str, str]:
    """Lines that read where the states, the buses and the outputs of a device are."""
    row = f"w[{width(device)} * j + "
    return f"first = {row}{STATE}]", f"b, b2 = {row}{BUS}], {row}{BUS2}]", f"o = {row}{width(device) - 1}]"
