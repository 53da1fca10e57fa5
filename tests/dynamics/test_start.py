"""At its start nothing moves, and a start that a limit forbids is refused with the limit's name."""

import numpy as np
import pytest
from systems import (
    APART,
    CLASSICAL,
    EXDC2,
    EXST3,
    KINDS,
    LIBRARY,
    PSS,
    REEC,
    REGC,
    ROUND,
    SATURATED,
    SEXS,
    STEAM,
    doubled,
    each,
    kind,
    small,
    table,
    with_shares,
)

from stabctl import devices, io
from stabctl._util.errors import EquilibriumError
from stabctl.dynamics import newton, operating_point, start
from stabctl.dynamics.jacobian import array
from stabctl.simulation import simulation


def rates(point):
    """State rates (1/s) and mismatch of currents (pu) at a point, on the whole network."""
    d = point.equations.at(point.s.copy())
    return d.rates, d.currents - point.admittance() @ point.V


@pytest.mark.parametrize("name", io.packaged())
@pytest.mark.parametrize("classical", [False, True])
def test_packaged_cases_start_stationary(cases, points, name, classical):
    point = operating_point.solve(cases(name).classical()) if classical else points(name)
    moving, mismatch = rates(point)
    assert np.abs(moving).max() < 1e-10  # 1/s
    assert np.abs(mismatch).max() < 1e-8  # pu of 100 MVA, currents up to 60


@pytest.mark.parametrize("name", io.packaged())
def test_a_residual_of_rounding_is_an_equilibrium(cases, points, monkeypatch, name):
    """Newton's method ends where it no longer improves and only rounding remains, whatever the tolerance."""
    monkeypatch.setattr(newton, "TOLERANCE", 0.0)
    monkeypatch.setattr(newton, "ROUNDOFF", 0.0)
    point = operating_point.solve(cases(name))
    assert np.abs(point.s - points(name).s).max() < 1e-8
    assert point.iterations < 2 * newton.STEPS


@pytest.mark.parametrize("KE", [1.0, 0.0])
def test_every_step_is_counted(monkeypatch, KE):
    """Those for a part of the saturation, and those with the KE that is computed from a first start."""
    solve, calls = newton.Groups.solve, []
    monkeypatch.setattr(newton.Groups, "solve", lambda *given: calls.append(1) or solve(*given))
    case = small({"genrou": SATURATED, "exdc2": EXDC2._replace(KE=KE)})
    assert operating_point.solve(case).iterations == len(calls) > 5


def test_a_residual_above_rounding_is_none(monkeypatch):
    """A start that no step improves is no equilibrium unless only rounding remains."""
    monkeypatch.setattr(newton.Groups, "solve", lambda self, data, f: np.zeros(self.width))
    with pytest.raises(EquilibriumError, match="Newton steps"):
        operating_point.solve(small(KINDS["saturated"]))


@pytest.mark.parametrize("name", each())
@pytest.mark.parametrize("shares", [{}, {"p_current": 1.0, "q_power": 0.4}, {"p_power": 1.0, "q_current": 1.0}])
def test_every_model_starts_stationary(name, shares):
    with kind(name) as models:
        point = operating_point.solve(with_shares(small(models), **shares))
    moving, mismatch = rates(point)
    assert np.abs(moving).max() < 1e-10
    assert np.abs(mismatch).max() < 1e-9


def test_the_kinds_hold_every_model():
    """A new model is one file and one row of KINDS."""
    assert {model for models in (KINDS | LIBRARY).values() for model in models} | APART >= set(devices.models())


@pytest.mark.parametrize("name", each())
def test_the_machine_gives_its_power_flow_power(name):
    with kind(name) as models:
        point = operating_point.solve(doubled(small(models)))
    run = simulation.run(point, until=0.01)
    assert run.arrays.P[0] == pytest.approx(point.flow.S.real * 100, abs=1e-6)
    units = range(len(point.case.machines))
    Q = [run.rows[0, point.layout.signals[unit, "Q"]] * point.case.machines[unit].base for unit in units]
    assert pytest.approx(point.flow.S.imag * 100, abs=1e-6) == Q


@pytest.mark.parametrize("name", io.packaged())
def test_nothing_drifts_in_ten_seconds(points, name):
    run = simulation.run(points(name), until=10.0)
    iterated = name == "wscc9"  # its constant powers leave 1e-7 pu of voltage
    assert np.abs(run.arrays.speed - 1).max() < (1e-9 if iterated else 2e-12)
    signals = np.delete(run.rows, run.point.layout.step, axis=1)
    assert np.abs(signals - signals[0]).max() < (1e-6 if iterated else 1e-9)
    assert run.outcome.kind == "stable"


def needed(models, part):
    """Value of an exciter's or governor's output at the start."""
    return getattr(simulation.run(operating_point.solve(small(models)), until=0.01).arrays, part)[0, 0]


LIMITS = [
    # devices, what binds, limit from the field voltage or power needed
    ({"genrou": ROUND, "sexs": SEXS}, "sexs", "Efdmax", lambda e: 0.9 * e),
    ({"genrou": ROUND, "sexs": SEXS}, "sexs", "Efdmin", lambda e: 1.1 * e),
    ({"genrou": ROUND, "sexs": SEXS._replace(TA=0.0, KA=15.0)}, "sexs", "Efdmax", lambda e: 0.9 * e),
    ({"genrou": ROUND, "exst3": EXST3}, "exst3", "VRmax", lambda e: 0.7 * e),
    ({"genrou": ROUND, "exst3": EXST3}, "exst3", "VRmin", lambda e: 1.1 * e),
    ({"genrou": ROUND, "exst3": EXST3._replace(KA=10.0, VImax=1.0)}, "exst3", "VImax", lambda e: 0.05),
    ({"genrou": ROUND, "exst3": EXST3._replace(KA=10.0, VImax=1.0)}, "exst3", "VImin", lambda e: 0.5),
    ({"genrou": ROUND, "exst3": EXST3}, "exst3", "Emax", lambda e: 0.9 * e),
    ({"genrou": ROUND, "exdc2": EXDC2._replace(SE2=0.0)}, "exdc2", "VRmax", lambda e: 0.9 * e / 1.02),
    ({"genrou": ROUND, "exdc2": EXDC2._replace(SE2=0.0)}, "exdc2", "VRmin", lambda e: 1.1 * e / 1.02),
    ({"genrou": ROUND, "sexs": SEXS, "pss": PSS}, "pss", "Vmin", lambda e: 0.01),
    ({"genrou": ROUND, "tgov": STEAM}, "tgov", "Pmax", lambda e: 0.6),
    ({"genrou": ROUND, "tgov": STEAM}, "tgov", "Pmin", lambda e: 0.9),
    ({"gencls": CLASSICAL, "tgov": STEAM._replace(Ts=0.0)}, "tgov", "Pmax", lambda e: 0.6),
]


@pytest.mark.parametrize(
    ("models", "model", "limit", "value"), LIMITS, ids=[f"{m} {n} {i}" for i, (_, m, n, _) in enumerate(LIMITS)]
)
def test_a_limit_beyond_which_the_start_lies_is_named_with_device_and_machine(models, model, limit, value):
    figure = float(f"{value(needed(models, 'Efd')):.4g}")
    tight = {**models, model: models[model]._replace(**{limit: figure})}
    with pytest.raises(EquilibriumError) as caught:
        operating_point.solve(small(tight))
    start = f"{devices.every()[model].name} of machine 1 at bus 1 cannot be initialized: {limit} = {figure:g} pu"
    assert str(caught.value).startswith(start)
    assert f"widen {limit} in {model}.csv (--set {model}.1.{limit}=...)" in str(caught.value)


@pytest.mark.parametrize(
    ("models", "model", "limit", "state"),
    [
        ({"genrou": ROUND, "tgov": STEAM}, "tgov", "Pmax", "servo"),
        ({"genrou": ROUND, "tgov": STEAM}, "tgov", "Pmin", "servo"),
        ({"regc_a": REGC, "reec_b": REEC}, "reec_b", "Pmax", "pord"),
    ],
)
def test_a_start_at_its_limit_within_the_accuracy_of_the_solution_is_one(models, model, limit, state):
    """Solved states differ from the limit by up to 1e-10 pu; the start lies on the limit, and nothing moves."""
    case = small(models)
    free = operating_point.solve(case)
    f = free.system.family(model)
    needed = float(free.s[f.w[0, 0] + f.device.State._fields.index(state)])
    beyond = 1 if limit == "Pmin" else -1
    at = operating_point.solve(case.set(f"{model}.1.{limit}", needed + 1e-10 * beyond))
    lim = at.system.limits
    assert (at.s[lim.state] <= lim.high * at.s[lim.scale]).all()
    assert (at.s[lim.state] >= lim.low * at.s[lim.scale]).all()
    assert np.abs(rates(at)[0]).max() < 1e-8  # 1/s
    with pytest.raises(EquilibriumError, match=f"{limit} = "):
        operating_point.solve(case.set(f"{model}.1.{limit}", needed + 1e-6 * beyond))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "given", "level", "value"),
    [
        ("esst3a", {}, "VBmax", 1.5),
        ("esst3a", {"VImax": 2.0}, "VGmax", 0.5),
        ("esst4b", {}, "VBmax", 1.5),
        ("st8c", {}, "VB1max", 1.5),
        ("st8c", {"VB1max": 2.0}, "VB2max", 0.1),
        ("exst3 with a compound source", {"KG": 1.0, "VImax": 5.0}, "VGmax", 0.5),
        ("esac6a", {"KH": 4.0}, "VHmax", 0.2),
    ],
)
def test_beyond_a_level_of_a_source_or_a_feedback_there_is_an_equilibrium(name, given, level, value):
    """The control makes up for it: the field voltage is the same, and nothing moves."""
    models, model = LIBRARY[name], table(name)
    free = models | {model: models[model]._replace(**given)}
    held = models | {model: models[model]._replace(**given, **{level: value})}
    point, without = operating_point.solve(small(held)), operating_point.solve(small(free))
    assert len(point.s) == len(without.s)
    assert np.abs(point.s - without.s).max() > 1e-3
    assert np.abs(rates(point)[0]).max() < 1e-9
    assert np.abs(rates(point)[1]).max() < 1e-9
    assert needed(held, "Efd") == pytest.approx(needed(free, "Efd"), abs=1e-9)


@pytest.mark.slow
def test_a_gate_of_the_field_current_is_opened_while_the_start_is_searched():
    """EXAC2 with KH = 0: the limiter takes over on the way, and not at the start."""
    fast = LIBRARY["exac2"]["exac2"]._replace(
        KH=0.0, KA=400.0, KB=25.0, VAmax=8.0, VAmin=-8.0, VRmax=105.0, VRmin=-95.0
    )
    models = LIBRARY["exac2"] | {"exac2": fast._replace(VLR=8.0, TR=0.0, TB=0.0, TC=0.0)}
    assert np.abs(rates(operating_point.solve(small(models)))[0]).max() < 1e-8
    with pytest.raises(EquilibriumError, match=r"EXAC2 of machine 1 at bus 1 .*: VLR = 0.5 pu is exceeded"):
        operating_point.solve(small(models | {"exac2": fast._replace(VLR=0.5)}))


def test_a_bypassed_block_has_no_state_that_could_lie_beyond_a_limit():
    """SEXS with TA = 0 has no regulator state; only its output is limited."""
    models = {"genrou": ROUND, "sexs": SEXS._replace(TA=0.0, KA=15.0)}
    efd = needed(models, "Efd")
    for low in (0.9 * efd, -5.0):
        held = {**models, "sexs": models["sexs"]._replace(Efdmax=1.1 * efd, Efdmin=low)}
        assert np.abs(rates(operating_point.solve(small(held)))[0]).max() < 1e-10


def test_a_machine_without_an_equilibrium_is_named_with_its_residual(monkeypatch):
    monkeypatch.setattr(newton, "STEPS", 0)
    says = r"^Machine 1 of small has no equilibrium at its power-flow power after 0 Newton steps \(residual .*\); "
    with pytest.raises(EquilibriumError, match=says):
        operating_point.solve(small(KINDS["bare"]))


def test_a_machine_that_would_stand_upside_down_is_refused(monkeypatch):
    """Newton has a second root with the rotor reversed; a guess on its side must not be taken for a start."""
    guess = start._guess

    def reversed_guess(system, V, current, s):
        guess(system, V, current, s)
        s[system.rotors.angle[0]] += np.pi
        s[[p.name for p in system.layout.states].index("eq")] = -1

    monkeypatch.setattr(start, "_guess", reversed_guess)
    with pytest.raises(EquilibriumError, match="Machine 1 of small starts with a reversed rotor; check its power, rat"):
        operating_point.solve(small(KINDS["bare"]))


@pytest.mark.parametrize("name", ["two_area", "ieee39"])
def test_the_fastest_eigenvalue_is_that_of_all_states_at_given_voltages(points, name):
    point = points(name)
    A = array(point.equations.at(point.s.copy()).of_rates[:, : point.layout.nx])
    assert point.fastest == pytest.approx(np.abs(np.linalg.eigvals(A)).max(), rel=1e-9)
