"""Complex-step derivatives equal those sympy takes of the same source; the rules that make complex step exact."""

import ast
import inspect
from pathlib import Path

import numpy as np
import pytest
from symbolic import Unlimited, f_of_z, jacobian, kernels
from systems import KINDS, small, with_shares

import stabctl
from stabctl import devices
from stabctl.dynamics import jacobian as step
from stabctl.dynamics import operating_point, system
from stabctl.dynamics.system import FAMILIES, sizes
from stabctl.model.case import Storage

SOURCES = sorted((Path(stabctl.__file__).parent / "devices").rglob("*.py"))


@pytest.mark.parametrize("kind", KINDS)
def test_complex_step_equals_sympy(kind):
    """At a point off the equilibrium, above the knees of saturation and within all limits."""
    case = with_shares(small(KINDS[kind]), p_current=0.3, q_power=0.5, p_power=0.4)
    case = case.with_storage(
        [Storage(1, 2, 40.0, "power", energy=1.0, lag=0.1, efficiency=0.8), Storage(2, 3, 20.0, "current")]
    )
    point = operating_point.solve(case)
    plant, buses = point.plant, len(point.V)
    n = sizes(plant, buses)
    random = np.random.default_rng(1)
    values = point.z + 1e-3 * random.standard_normal(len(point.z))
    values[len(values) - n.storage :] = -0.5  # orders: injecting, the branch the transformed source keeps
    first = system.first_state(plant, "storage")
    values[first] = -0.4
    b = system.buffers(plant, buses, complex)
    b.z[:] = values
    J = step.columns_of(b, plant, np.arange(len(values)))
    f, exact = jacobian(*f_of_z(plant, buses), values)
    scale = np.abs(exact).max(axis=1, keepdims=True) + 1e-30
    assert np.abs(b.f.real - f).max() < 4e-11  # 2.0e-11, rates up to 1e5
    assert np.abs((J - exact) / scale).max() < 5e-15  # 2.3e-15
    assert np.count_nonzero(exact) > 3 * n.states  # the comparison is not between zeros


def test_together_the_kinds_and_storage_hold_every_family():
    assert {k.__name__.rpartition(".")[2] for k in FAMILIES} == {m for d in KINDS.values() for m in d} | {"storage"}


def offences(tree):
    """Everything in a kernel that complex step would silently get wrong."""
    in_conditions = {
        id(part)
        for node in ast.walk(tree)
        if isinstance(node, ast.Compare)
        for part in ast.walk(node)
        if isinstance(part, ast.Attribute)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and node.attr == "real" and id(node) not in in_conditions:
            yield f"line {node.lineno}: .real as a value"
        if isinstance(node, ast.Attribute) and node.attr in (
            "imag",
            "conj",
            "conjugate",
            "sign",
            "abs",
            "angle",
            "hypot",
        ):
            yield f"line {node.lineno}: .{node.attr}"
        if isinstance(node, ast.Name) and node.id in ("abs", "min", "max", "sign", "complex", "round"):
            yield f"line {node.lineno}: {node.id}"
        if isinstance(node, ast.Constant) and isinstance(node.value, complex):
            yield f"line {node.lineno}: a complex phasor"


@pytest.mark.parametrize("module", [*devices.ALL.values(), devices.blocks, system.load, system.storage, system])
def test_kernels_use_nothing_that_complex_step_gets_wrong(module):
    stopped = ("confine",)  # in the time simulation only
    found = {name: list(offences(tree)) for name, tree in kernels(module).items() if name not in stopped}
    assert found
    assert not any(found.values()), found


def test_the_rule_finds_what_it_forbids():
    for bad in (
        "abs(x)",
        "x.real",
        "np.abs(x)",
        "x.conj()",
        "max(x, 1)",
        "np.sign(x)",
        "1j * x",
        "y if x > 0 else x.imag",
    ):
        assert list(offences(ast.parse(bad)))
    for good in ("y if x.real > 0 else x", "np.sqrt(x)", "x.re * 2"):
        assert not list(offences(ast.parse(good)))


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: p.stem)
def test_limiters_live_in_blocks_only(path):
    """Elsewhere a value is looked at only where a store is full or empty, or which way its power flows."""
    looks = [n for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Attribute) and n.attr == "real"]
    assert not looks or path.stem in ("blocks", "storage")


def test_every_exciter_limit_follows_the_naming_rule():
    """Newton opens limits by their names; a device that clips with any other field would make it singular."""
    for name, model in devices.ALL.items():
        called = [
            n
            for tree in kernels(model).values()
            for n in ast.walk(tree)
            if isinstance(n, ast.Call) and getattr(n.func, "id", "") == "clip"
        ]
        for call in called:
            for limit in call.args[-2:]:
                fields = [n.attr for n in ast.walk(limit) if isinstance(n, ast.Attribute) and n.attr != "vt"]
                assert all(f.endswith(("max", "min")) for f in fields), (name, fields)
                assert fields


def test_dropping_limiters_keeps_everything_else():
    tree = ast.parse("if x.real > 1:\n    y = 1\nelse:\n    y = x\nif p > 0:\n    z = 2\n")
    assert ast.unparse(Unlimited().visit(tree)) == "y = x\nif p > 0:\n    z = 2"
    assert inspect.getsource(devices.blocks.clip).count(".real") == 4
