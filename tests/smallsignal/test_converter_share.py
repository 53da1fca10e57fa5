"""Converters in place of machines: where they are unstable, a simulation grows at the rate of the least damped mode."""

import importlib.util
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "analysis" / "converter_share.py"


@pytest.fixture(scope="module")
def share():
    spec = importlib.util.spec_from_file_location(SCRIPT.stem, SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_step_replaces_one_more_machine(share):
    for series in share.SERIES:
        mixed = [share.mix(series, count) for count in range(11)]
        assert [len(m.forming) + len(m.following) for m in mixed] == list(range(11))
        assert [m.percent for m in mixed] == sorted(m.percent for m in mixed)
        assert mixed[0].percent == 0
        assert mixed[-1].percent == pytest.approx(100)
        for one in mixed[1:]:
            mva = {m.machine: m.base for m in one.case.machines}
            last = max(one.forming + one.following, key=lambda unit: mva[unit])
            formed = sum(mva[unit] for unit in one.forming)
            wanted = series.share * sum(mva[unit] for unit in one.forming + one.following)
            other = formed - mva[last] if last in one.forming else formed + mva[last]
            assert abs(formed - wanted) <= abs(other - wanted)


@pytest.mark.parametrize("series", [0, 1])
def test_without_a_voltage_source_the_last_step_is_refused(share, series):
    found = share.step(share.mix(share.SERIES[series], 10))
    assert found.modes is None
    assert "nothing sets its voltage and frequency, because its units 1, 2, 3" in found.outcome


@pytest.mark.parametrize(("series", "stable"), [(2, False), (3, True)])
def test_grid_forming_units_hold_the_system_alone(share, series, stable):
    """With three of ten, the phase-locked loop of the largest unit is too fast; at half the gain it is stable."""
    mixed = share.mix(share.SERIES[series], 10)
    base = mixed.case.initialize()
    modes = base.modes()
    assert not {"genrou", "exst3", "pss", "tgov"} & mixed.case.devices.keys()
    assert modes.stable == stable
    if not stable:
        assert modes.label(share.least_damped(modes)) == "PLL of REGC_C 1"
        as_is, none, slower, *_ = share.variants(share.SERIES[series], mixed)
        assert none is None
        assert share.rate(as_is) > 3
        assert share.rate(slower) < -2


@pytest.mark.parametrize(("series", "count"), [(0, 9), (1, 8), (1, 9)])
def test_the_stabilizers_of_the_last_machines_make_it_unstable(share, series, count):
    mixed = share.mix(share.SERIES[series], count)
    as_is, without, *_ = share.variants(share.SERIES[series], mixed)
    assert share.rate(as_is) > 0.05
    assert share.rate(without) < -0.05


@pytest.mark.slow
@pytest.mark.parametrize(
    ("series", "count", "stable"),
    [(0, 8, True), (0, 9, False), (1, 8, False), (1, 9, False), (2, 10, False), (3, 8, True), (3, 10, True)],
)
def test_a_simulation_has_the_rate_of_the_least_damped_mode(share, series, count, stable):
    found = share.step(share.mix(share.SERIES[series], count))
    s = found.modes.eigenvalues[found.mode]
    assert found.modes.stable == stable
    assert (s.real < 0) == stable
    assert found.rate.real == pytest.approx(s.real, rel=6e-3)  # 4e-3 with 100 kW: states at rest drift by 1e-7
    assert found.rate.imag == pytest.approx(s.imag, rel=1e-3)  # 2e-4, on another processor 7e-4
