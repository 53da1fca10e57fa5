"""The very source of the devices' equations, executed on sympy symbols.

Every function marked `@inline` is read from its file and executed again with the numpy functions replaced by those of
sympy. A branch that looks at a value (`.real`) is a limiter: its unlimited path is taken. What is left is smooth, and
sympy can differentiate it.
"""

import ast
import inspect
import sys
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import sympy

from stabctl.dynamics import family

NUMPY = SimpleNamespace(
    sin=sympy.sin, cos=sympy.cos, tan=sympy.tan, sqrt=sympy.sqrt, exp=sympy.exp, log=sympy.log, arctan=sympy.atan,
    tanh=sympy.tanh, pi=sympy.pi,
)  # fmt: skip


class Unlimited(ast.NodeTransformer):
    """Drops every branch whose condition looks at the real part of a value."""

    @staticmethod
    def limits(test):
        return any(isinstance(n, ast.Attribute) and n.attr == "real" for n in ast.walk(test))

    def visit_If(self, node):
        self.generic_visit(node)
        return (node.orelse or None) if self.limits(node.test) else node

    def visit_IfExp(self, node):
        self.generic_visit(node)
        return node.orelse if self.limits(node.test) else node


def kernels(module):
    """name -> syntax tree of every function marked `@inline` in the module, without its decorator."""
    found = {}
    for node in ast.parse(Path(module.__file__).read_text()).body:
        if isinstance(node, ast.FunctionDef) and [getattr(d, "id", "") for d in node.decorator_list] == ["inline"]:
            node.decorator_list = []
            found[node.name] = ast.Module([node], [])
    return found


@cache
def executed(module):
    """The module's names, its kernels and those it takes from elsewhere as plain functions on sympy expressions."""
    own = kernels(module)
    space = {**vars(module), "np": NUMPY}
    for name, value in vars(module).items():
        home = sys.modules.get(getattr(value, "__module__", None) or "")
        if inspect.isfunction(value) and home not in (None, module) and value.__name__ in kernels(home):
            space[name] = executed(home)[value.__name__]
        if inspect.ismodule(value) and value.__name__.startswith("stabctl.devices.") and kernels(value):
            space[name] = SimpleNamespace(**executed(value))  # a part of a composed device
    for name, tree in own.items():
        smooth = ast.fix_missing_locations(Unlimited().visit(tree))
        exec(compile(smooth, f"{module.__name__}.{name}", "exec"), space)
    return space


def equation(device, name, known):
    """What an equation of a device gives for the arguments that are `known`, a tuple; None where it has no such."""
    if not device.has(name):
        return None
    return tuple(executed(device.module)[name](*(known[a] for a in device.arguments(name))))


def outputs_and_rates(device, known, separate=("output", "derivatives")):
    """Outputs and rates of a device for the arguments that are `known`; of separate equations only those named."""
    if device.has("equations"):
        return equation(device, "equations", known)
    y = equation(device, "output", known) if "output" in separate else None
    known = known | ({"y": device.Output(*y)} if y else {})
    return y or (), equation(device, "derivatives", known) if "derivatives" in separate else None


class Symbols:
    """All signals of a system as expressions in its states, voltages and set-points."""

    def __init__(self, system):
        self.system, lay = system, system.layout
        self.z = sympy.symbols(f"z:{lay.step}", real=True)
        self.signals = dict(enumerate(self.z)) | {lay.zero: sympy.Integer(0), lay.one: sympy.Integer(1)}
        self.maker = {}
        for f in self.families():
            outputs = len(f.device.Output._fields)
            self.maker |= {w[-1] + c: (f, j) for j, w in enumerate(f.w) for c in range(outputs)}
            inner = range(outputs, family.stride(f.device))  # nobody reads them elsewhere
            self.signals |= {w[-1] + c: sympy.Integer(0) for w in f.w for c in inner}

    def families(self):
        """The families that live between steps."""
        return [f for f in self.system.families if not f.device.has("step")]

    def signal(self, place):
        """The expression of a signal, through the outputs that it is made from."""
        if place not in self.signals:
            f, j = self.maker[place]
            made = "equations" if f.device.has("equations") else "output"
            y, _ = outputs_and_rates(f.device, self.arguments(f, j, self.signal, made), ("output",))
            self.signals |= {f.w[j, -1] + c: value for c, value in enumerate(y)}
        return self.signals[place]

    def arguments(self, f, j, signal, *equations):
        """Arguments of equations of row j of a family, by name; `signal` gives the expression of a place."""
        device, w = f.device, f.w[j]
        wanted = {a for e in equations for a in device.arguments(e)}
        wanted |= {"x", "p"} if "i" in wanted else set()
        names = device.Input._fields
        read = {n: signal(w[family.INPUTS + c]) for c, n in enumerate(names) if "u" in wanted or n in wanted}
        v1, v2 = ((self.z[w[b]], self.z[w[b] + 1]) for b in (family.BUS, family.BUS2))
        states = len(device.State._fields)
        known = read | {"v": v1, "v1": v1, "v2": v2}
        if "p" in wanted:
            known["p"] = device.Par(*map(float, f.k[j]))
        if "x" in wanted:
            known["x"] = device.State(*self.z[w[family.STATE] : w[family.STATE] + states])
        if "u" in wanted:
            known["u"] = device.Input(*(read[n] for n in names))
        if "i" in wanted:
            known["i"] = device.Internal(*equation(device, "internal", known))
        return known

    def whole(self):
        """Rates, outputs and currents (real and imaginary part per bus) of the system."""
        lay = self.system.layout
        rates, current = [sympy.Integer(0)] * lay.nx, [sympy.Integer(0)] * (2 * lay.buses)
        for f in self.families():
            for j, w in enumerate(f.w):
                rate, drawn = self.of_row(f, j, self.signal)[::2]
                rates[w[family.STATE] : w[family.STATE] + len(rate)] = rate
                for c, value in enumerate(drawn):
                    bus = w[family.BUS if c < 2 else family.BUS2]
                    current[bus - lay.nx + c % 2] += value
        outputs = [self.signal(lay.first_output + k) for k in range(lay.outputs)]
        return rates + outputs + current

    def of_row(self, f, j, signal):
        """Rates, outputs and currents of row j of a family."""
        device = f.device
        made = [e for e in ("equations", "output", "derivatives", "source", "current") if device.has(e)]
        known = self.arguments(f, j, signal, *made)
        y, rates = outputs_and_rates(device, known)
        rates = rates or (0,) * len(device.State._fields)
        parts = [g for g in (equation(device, name, known) for name in ("source", "current")) if g]
        return rates, y, tuple(map(sum, zip(*parts, strict=True)))


def jacobian(z, f, values):
    """Values of f and of its Jacobian at z = values, differentiated by sympy."""
    J = np.zeros((len(f), len(z)))
    place = {symbol: k for k, symbol in enumerate(z)}
    entries, where = [], []
    for i, expression in enumerate(f):
        for symbol in sympy.sympify(expression).free_symbols:
            entries.append(sympy.diff(expression, symbol))
            where.append((i, place[symbol]))
    numbers = sympy.lambdify([z], [*f, *entries], "math", cse=True)(list(values))
    for (i, k), number in zip(where, numbers[len(f) :], strict=True):
        J[i, k] = number
    return np.array(numbers[: len(f)], float), J
