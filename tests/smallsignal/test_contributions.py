"""What devices contribute to a mode: gains times sensitivities, changes of the modes when effects are scaled."""

import numpy as np
import pytest

import stabctl as st
from stabctl._util.errors import StudyError
from stabctl.dynamics.jacobian import Equations


@pytest.fixture(scope="module")
def modes():
    return st.load("two_area").modes()


def by_name(found):
    return {(row.model, row.place): row for row in found.rows}


@pytest.mark.parametrize("mode", ["0.6Hz", "1.3Hz"])
def test_a_device_with_a_gain_contributes_the_gain_times_the_sensitivity(modes, mode):
    """The output of a stabilizer is proportional to K, that  of TGOV to 1 / R."""
    found = by_name(modes.contributions(mode))
    for path in ("pss.K", "sexs.KA", "tgov.K"):
        for effect in modes.sensitivity(path, mode=mode).rows:
            row = found[effect.model, effect.place]
            assert row.real == pytest.approx(effect.real, rel=2e-4, abs=1e-9), effect.path
            assert row.damping_ratio == pytest.approx(effect.damping_ratio, rel=2e-4, abs=1e-9), effect.path


@pytest.mark.parametrize("name", ["two_area", "ieee39"])
def test_signs_are_those_of_a_system_without_the_device(name):
    """Weakened by 10 %, a strong stabilizer leaves the mode less damped by 10 % of what it contributes."""
    case = st.load(name)
    modes = case.modes()
    found = modes.contributions()
    row = next(r for r in found.damping if r.role == "stabilizer")
    path = f"pss.{row.place}.K"
    weaker = case.set({path: 0.9 * case.devices["pss"][row.place].K}).modes()
    s, before = np.asarray(weaker.eigenvalues), found.mode.eigenvalue
    after = s[np.abs(s - before).argmin()]
    assert after.real - before.real == pytest.approx(-10 * row.real, rel=0.1)


def test_it_says_who_damps_and_who_does_not(modes):
    found = modes.contributions()
    assert [row.name for row in found.damping[:2]] == ["PSS 4", "PSS 1"]
    assert all(row.damping_ratio < 0 for row in found.undamping)
    assert found.undamping[0].damping_ratio == min(row.damping_ratio for row in found.rows)
    assert "damped by PSS 4 +0.00034, PSS 1" in str(found)
    assert [*found.df.columns] == ["model", "place", "role", "real", "frequency_hz", "damping_ratio"]
    assert {row.role for row in found.rows} == {"stabilizer", "exciter", "governor"}


@pytest.mark.parametrize("name", ["two_area", "wscc9"])
def test_a_larger_effect_moves_the_mode_by_what_the_control_contributes(monkeypatch, name):
    """The entries of the equations in which others read its states and outputs are made a little larger."""
    base = st.load(name).initialize()
    found = base.modes().contributions()
    equations, lay, entries, more = base.equations, base.layout, Equations.entries, 1e-5
    device, families = equations.pattern.device, [f.name for f in equations.families]
    for row in [*found.damping[:3], *found.undamping[:3]]:
        number = sum(len(f.w) for f in equations.families[: families.index(row.model)])
        number += list(base.case.devices[row.model]).index(row.place)
        places = {*np.flatnonzero(device[: lay.nx] == number)}
        places |= {*lay.first_output + np.flatnonzero(device[lay.nx : lay.nx + lay.outputs] == number)}
        scaled = np.isin(equations.columns, [*places]) & (device[equations.rows] != number)

        def larger(self, *given, scaled=scaled, **how):
            values = entries(self, *given, **how)
            return values[0] * (1 + more * scaled), values[1]

        monkeypatch.setattr(Equations, "entries", larger)
        s = np.linalg.eigvals(base.modes().linear.A)
        monkeypatch.setattr(Equations, "entries", entries)
        moved = s[np.abs(s - found.mode.eigenvalue).argmin()] - found.mode.eigenvalue
        assert moved.real == pytest.approx(100 * more * row.real, rel=1e-3, abs=1e-9), row


def test_what_is_no_mode_is_told(modes):
    with pytest.raises(StudyError, match="There is no mode near 7 Hz"):
        modes.contributions("7Hz")
