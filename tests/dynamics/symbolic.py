"""The very source of the kernels, executed on sympy symbols.

Every kernel is read from its file and executed again with np.sin, np.cos, np.sqrt of sympy. A branch that looks at a
value (`.real`) is a limiter: its unlimited path is taken. What is left is smooth, and sympy can differentiate it.
"""

import ast
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import sympy

from stabctl.devices import blocks
from stabctl.dynamics import system
from stabctl.dynamics.system import FAMILIES, NAMES

NUMPY = SimpleNamespace(sin=sympy.sin, cos=sympy.cos, sqrt=sympy.sqrt)


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
    """name -> syntax tree of every kernel written in the module, without its decorator."""
    found = {}
    for node in ast.parse(Path(module.__file__).read_text()).body:
        if isinstance(node, ast.FunctionDef) and [getattr(d, "id", "") for d in node.decorator_list] == ["kernel"]:
            node.decorator_list = []
            found[node.name] = ast.Module([node], [])
    return found


def executed(module, **replaced):
    """The module's kernels as plain functions on sympy expressions."""
    space = {**vars(module), "np": NUMPY, **replaced}
    for name, tree in kernels(module).items():
        smooth = ast.fix_missing_locations(Unlimited().visit(tree))
        exec(compile(smooth, f"{module.__name__}.{name}", "exec"), space)
    return space


class Row(list):
    """A record that is written by place and read by name."""

    def __init__(self, names):
        super().__init__([sympy.Integer(0)] * len(names))
        self.names = names

    def __getattr__(self, name):
        return self[self.names.index(name)]


def named(record):
    """A record with its fields as plain numbers (a field T of a numpy record is taken for its transpose)."""
    return SimpleNamespace(**{name: float(record[name]) for name in record.dtype.names})


def f_of_z(plant, buses):
    """Symbols z and the expressions f(z) of the whole system, as `system.rates`, `sources`, `draws` write them."""
    shared = executed(blocks)
    shared = {name: shared[name] for name in kernels(blocks)}
    models = {}
    for module in (*FAMILIES, system.load):
        models[module.__name__.rpartition(".")[2]] = SimpleNamespace(**executed(module, **shared))
    wiring = executed(system, **shared, **models)
    n = system.sizes(plant, buses)
    z = list(sympy.symbols(f"z:{n.states + n.voltages + 2 * n.machines + n.storage}", real=True))
    at, states, rows = 0, [], []
    for name, family in zip(NAMES, FAMILIES, strict=True):
        fields, devices = family.State._fields, []
        for _ in getattr(plant, name):
            devices.append(family.State(*z[at : at + len(fields)]))
            at += len(fields)
        states.append(devices)
        rows.append([[sympy.Integer(0)] * len(fields) for _ in devices])
    v = [[z[n.states + 2 * b], z[n.states + 2 * b + 1]] for b in range(buses)]
    rest = z[n.states + n.voltages :]
    m = n.machines
    s = system.Signals(z, *states, v, rest[:m], rest[m : 2 * m], rest[2 * m :])
    stator = [Row(system.stator.Output._fields) for _ in range(m)]
    w = system.Wires([0] * m, [0] * m, [0] * m, stator, stator, [0] * n.storage)
    g = np.zeros((buses, 2), object)
    r = system.Rates(*rows, g)
    tables = {name: [named(row) for row in getattr(plant, name)] for name in (*NAMES, "load")}
    plant = plant._replace(**tables)
    wiring["rates"](s, plant, w, r)
    wiring["sources"](s, plant, np.zeros(m, int), g)
    wiring["draws"](s, plant, g)
    return z, [entry for family in rows for device in family for entry in device] + list(g.ravel())


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
