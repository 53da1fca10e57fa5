"""Complex-step derivatives equal those sympy takes of the same source; the rules that make complex step exact."""

import ast
import inspect
import os
import subprocess
import sys
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import sympy
from symbolic import Symbols, Unlimited, jacobian, kernels
from systems import ALL_KINDS, APART, KINDS, LIBRARY, each, kind, one_of, small, with_shares

import stabctl
from stabctl import devices
from stabctl.devices import blocks
from stabctl.devices.storage import MODELS, STORES
from stabctl.dynamics import adder, family, operating_point
from stabctl.dynamics.jacobian import array
from stabctl.model.tables import Link, Storage

SOURCES = sorted((Path(stabctl.__file__).parent / "devices").rglob("*.py"))
BLOCKS = [m for m in vars(blocks).values() if inspect.ismodule(m)]
ALL = [*(device.module for device in devices.every().values()), *BLOCKS, adder]
FILES = [module for module in ALL if kernels(module)]  # a file may take all its equations from others
LINK = Link("a", 2, 3, 30.0, 1.0)


def everything(case):
    """The point of a case with every sort of load, storage and link, some way off its equilibrium.

    Above the knees of saturation and within all limits; a state that rests at a non-windup limit stays there, and
    storage injects, the branches that `Unlimited` keeps.
    """
    case = with_shares(case, p_current=0.3, q_power=0.5, p_power=0.4)
    case = case.with_storage(
        [Storage(1, 2, 40.0, "power", energy=1.0, lag=0.1, efficiency=0.8), Storage(2, 3, 20.0, "current")]
    )
    point = operating_point.solve(case)
    return point, away(point)


def away(point):
    """Signals some way off the equilibrium of a point, where storage injects."""
    lay, s = point.layout, point.s.copy()
    s[: lay.step] += 1e-3 * np.random.default_rng(1).standard_normal(lay.step)
    limits = point.system.limits
    resting = limits.state[point.s[limits.state] == limits.low]
    s[resting] = point.s[resting]
    s[[lay.first_setpoint + k for k, p in enumerate(lay.setpoints) if p.name == "order"]] = -0.5
    s[[k for k, p in enumerate(lay.states) if p.name == "share"]] = -0.4
    delivers = ("_regc", "_regc_repc")  # behind REGC_A, whose current is a state
    s[[k for k, p in enumerate(lay.states) if p.name == "ip" and p.table.endswith(delivers)]] = 0.3
    return s


@cache
def moved(name):
    """`everything` of a kind."""
    with kind(name) as models:
        return everything(small(models, links=[LINK]))


ITERATED = ("gentpj1", "gentpj1 without saturation")  # its four Newton steps are too long for sympy; see test_machines


@pytest.mark.parametrize("name", each(name for name in ALL_KINDS if name not in ITERATED))
def test_complex_step_of_a_device_equals_sympy(name):
    """Every device alone, at its own terminals; those that all kinds have, in the first kind only."""
    point, s = moved(name)
    compared(point, s, {f.name for f in moved(ALL_KINDS[0])[0].system.families} if name != ALL_KINDS[0] else set())


FAST = "repc_Kpg=0.5 repc_Kig=8 repc_Ddn=0 repc_Dup=0"  # a plant controller of 0.1 s without a deadband of frequency
BEHIND = "regc", "regc_repc", "regc_b_repc", "regc_c_repc", "regfm_b1"
OTHERS = [f"{store}_{behind}" for store in ("supercap", "flywheel") for behind in BEHIND]


@pytest.mark.parametrize("model", one_of("regc_repc", *(m for m in MODELS if m not in ("regc_repc", "ideal", *OTHERS))))
def test_complex_step_of_storage_equals_sympy(model):
    """Every store and every converter with plant control, and every file that connects them, while it injects."""
    compared_storage(model)


@pytest.mark.slow
def test_complex_step_of_further_storage_equals_sympy():
    """The other compositions of these stores and converters, as plain Python, which need not be compiled."""
    script = f"from test_jacobian import *\nfor model in {OTHERS}:\n    compared_storage(model)\nprint(model)"
    where = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=where)
    assert done.stdout.split() == OTHERS[-1:], done.stderr


def compared_storage(model):
    """`compared`, of a storage device at bus 2."""
    case = small(KINDS["sexs, pss, steam"])
    row = Storage(1, 2, 40.0, energy=1.0, lag=0.1, efficiency=0.8, storage_model=model)
    behind = model not in STORES
    row = row._replace(mva=50.0 if behind else 0.0, converter=FAST if model.endswith("_repc") else "")
    point = operating_point.solve(case.with_storage([row]))
    apart = {f.name for f in point.system.families} - {row.device}
    compared(point, away(point), apart)


ROUNDING = 2e-14  # 9.6e-15
IEEL = 1e-13  # 4.4e-14; the terms of its powers of the voltage are larger than their sum


def compared(point, s, known):
    """Are the derivatives of all families but those known equal to those of sympy?"""
    lay, of = point.layout, Symbols(point.system)
    z = sympy.symbols(f"z:{lay.size}", real=True)
    of.z = z
    s = s.copy()
    slopes, _ = point.equations.entries(s)
    J = np.zeros((lay.nx + lay.outputs + 2 * point.equations.injecting.size, lay.size))
    np.add.at(J, (point.equations.rows, point.equations.columns), slopes)
    first = lay.nx + lay.outputs
    for f in (f for f in of.families() if f.name not in known):
        start = first + 2 * point.equations.injections[f.name].start
        for j, w in enumerate(f.w):
            parts = of.of_row(f, j, z.__getitem__)
            rates, outputs, currents = (len(part) for part in parts)
            rows = np.r_[
                w[family.STATE] + np.arange(rates),
                lay.nx + w[-1] - lay.first_output + np.arange(outputs),
                start + family.shape(f.device)[3] * 2 * j + np.arange(currents),
            ].astype(int)
            values, exact = jacobian(z, [entry for part in parts for entry in part], s)
            vector = [*range(rates + outputs), *(rates + outputs + np.arange(currents) // 2)]
            assert close(J[rows], exact, vector, IEEL if f.name == "ieel" else ROUNDING), f.keys[j]
            assert np.abs(exact).max() > 0  # the comparison is not between zeros
            assert values[rates : rates + outputs] == pytest.approx(
                s[w[-1] : w[-1] + outputs], rel=0, abs=2e-14
            )  # 3e-15


# devices of every role and every way of signals between them; all others are composed in the same way
COMPOSED = "signals from elsewhere", "exst3 inner feedback", "converter"
FURTHER = "salient", "exponential load", "exdc2", "repc_a, compensation", "reec_a and wtdt_a", "cim of one cage", "ieel"


@pytest.mark.parametrize("name", [*COMPOSED, *(pytest.param(k, marks=pytest.mark.slow) for k in FURTHER)])
def test_complex_step_of_the_whole_equals_sympy(name):
    point, s = moved(name)
    lay, of = point.layout, Symbols(point.system)
    d = point.equations.at(s.copy())
    f, exact = jacobian(of.z, of.whole(), s[: lay.step])
    parts = lay.nx, lay.nx + lay.outputs
    for found, wanted in zip((d.rates, d.outputs, d.currents.view(float)), np.split(f, parts), strict=True):
        assert np.abs(found - wanted).max() < 4e-11  # 2.0e-11, rates up to 1e5
    for found, wanted in zip((d.of_rates, d.of_outputs, d.of_currents), np.split(exact, parts), strict=True):
        assert close(array(found), wanted, within=IEEL if name.startswith("ieel") else ROUNDING)
    assert np.count_nonzero(exact) > 3 * lay.nx  # the comparison is not between zeros


def close(found, exact, vector=None, within=ROUNDING):
    """Are derivatives equal, by the largest of their row, or of the rows of the same number in `vector`?"""
    scale = np.abs(exact).max(axis=1, keepdims=True) + 1e-30
    if vector is not None:
        scale = np.array([scale[np.equal(vector, v)].max() for v in vector])[:, None]
    return np.abs((found[:, : exact.shape[1]] - exact) / scale).max() < within


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


@pytest.mark.parametrize("module", FILES, ids=lambda m: m.__name__)
def test_equations_use_nothing_that_complex_step_gets_wrong(module):
    found = {name: list(offences(tree)) for name, tree in kernels(module).items()}
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
    module = SimpleNamespace(__file__=path)
    nodes = [node for tree in kernels(module).values() for node in ast.walk(tree)]
    looks = [n for n in nodes if isinstance(n, ast.Attribute) and n.attr == "real"]
    assert not looks or path.parent.name == "blocks" or path.stem == "order"


@pytest.mark.parametrize("name", devices.every())
def test_every_limit_follows_the_naming_rule(name):
    """Newton opens limits by their names; a device that clips with any other field would make it singular."""
    called = [
        n
        for tree in kernels(devices.every()[name].module).values()
        for n in ast.walk(tree)
        if isinstance(n, ast.Call) and getattr(n.func, "id", "") == "clip"
    ]
    for call in called:
        for limit in call.args[-2:]:
            fields = [n.attr for n in ast.walk(limit) if isinstance(n, ast.Attribute) and n.value.id == "p"]
            assert all(f.endswith(("max", "min")) for f in fields), fields
            assert fields


def test_the_kinds_hold_every_device():
    """So that every device is differentiated above: a new one needs a row of KINDS."""
    with kind("signals from elsewhere") as sensors:
        met = {f.name for f in everything(small(sensors, links=[LINK]))[0].system.families}
    met |= {model for models in (KINDS | LIBRARY).values() for model in models}
    assert met | APART >= set(devices.every())


def test_dropping_limiters_keeps_everything_else():
    tree = ast.parse("if x.real > 1:\n    y = 1\nelse:\n    y = x\nif p > 0:\n    z = 2\n")
    assert ast.unparse(Unlimited().visit(tree)) == "y = x\nif p > 0:\n    z = 2"
    assert inspect.getsource(blocks.clip).count(".real") == 4
