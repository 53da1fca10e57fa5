"""The start of converters with their controls: at rest, with what nothing reads, without equilibrium or derivative."""

import numpy as np
import pytest
from records import reec_b, repc_a
from systems import DER, PLANT, REEC, REGC, small

from stabctl._util.errors import EquilibriumError, LinearizationError
from stabctl.dynamics import operating_point
from stabctl.simulation import simulation
from stabctl.simulation.events import LoadStep
from stabctl.smallsignal import linearize


def after_a_load_step(models, p):
    """The operating point, and all bus voltages after 20 MW more of load."""
    point = operating_point.solve(small(models, p=p))
    assert np.abs(point.equations.at(point.s.copy()).rates).max() < 1e-10
    return point, simulation.run(point, [LoadStep(2, 0.1, p=20.0)], until=2.0).arrays.V


@pytest.mark.parametrize("control", [REEC, REEC._replace(QFlag=1), DER], ids=["QFlag 0", "QFlag 1", "DER_A"])
def test_without_power_at_the_start_reactive_power_is_held_instead_of_its_ratio(control):
    """Q/P is not defined at P = 0."""
    table, converter = ("reec_b", {"regc_a": REGC}) if isinstance(control, reec_b.Par) else ("dera1", {})
    (_, ordered), (point, held) = (
        after_a_load_step(converter | {table: control._replace(Pmin=-0.1, PfFlag=flag)}, 0.0) for flag in (0, 1)
    )
    assert np.abs(held - ordered).max() < 1e-12  # measured 0
    assert abs(point.s[point.layout.setpoint(0, "pfref")]) < 10


@pytest.mark.parametrize("RefFlag", [0, 1])
def test_a_reference_that_nothing_reads_rests_within_its_limits(RefFlag):
    """With PfFlag = 1, REEC does not read Qext of REPC: Q of the unit, or between the limits, with a derivative."""
    plant = PLANT._replace(RefFlag=RefFlag)
    control = {"regc_a": REGC, "reec_b": REEC._replace(PfFlag=1)}
    _, alone = after_a_load_step(control, 300.0)
    for given in ({}, {"Qmax": 0.01, "Qmin": 0.0}):
        point, V = after_a_load_step(control | {"repc_a": plant._replace(FFlag=0, **given)}, 300.0)
        assert np.abs(V - alone).max() < 1e-12  # measured 5e-14
        f = point.system.family("repc_a")
        Q = point.s[point.layout.signals[0, "Q"]]
        rests = 0.005 if given else Q
        assert point.s[f.w[0, 0] + repc_a.State._fields.index("xq")] == pytest.approx(rests, abs=1e-12)
        linearize(point)


@pytest.mark.parametrize("flags", [{}, {"QFlag": 1}])
def test_a_start_below_the_dip_voltage_is_one_at_rest(flags):
    after_a_load_step({"regc_a": REGC, "reec_b": REEC._replace(Vdip=1.05, **flags)}, 300.0)


def test_a_regulator_without_gains_keeps_its_output():
    """Without Kqp and Kqi the voltage reference is constant, as with VFlag = 0; without Kp and Ki of REPC Qext is."""
    control = {"regc_a": REGC, "reec_b": REEC._replace(QFlag=1, Kqp=0.0, Kqi=0.0, VFlag=1)}
    _, none = after_a_load_step(control, 300.0)
    _, constant = after_a_load_step(control | {"reec_b": REEC._replace(QFlag=1, VFlag=0)}, 300.0)
    assert np.abs(none - constant).max() < 1e-12  # measured 1e-15
    without = {"repc_a": PLANT._replace(Kp=0.0, Ki=0.0, Kpg=0.0, Kig=0.0)}
    _, none = after_a_load_step({"regc_a": REGC, "reec_b": REEC} | without, 300.0)
    _, constant = after_a_load_step({"regc_a": REGC, "reec_b": REEC}, 300.0)
    assert np.abs(none - constant).max() < 1e-12  # measured 1e-15


def test_a_converter_without_an_equilibrium_is_told_what_to_check():
    """REEC_B takes no power."""
    with pytest.raises(EquilibriumError, match="; check its dispatch, and the flags, gains and current curves of its"):
        operating_point.solve(small({"regc_a": REGC, "reec_b": REEC._replace(Pmin=-1.0)}, p=-50.0))


def test_without_power_a_converter_that_takes_none_has_no_linear_model_and_says_so():
    """Its current has a derivative upwards only; with 0.01 MW it has both."""
    models = {"regc_a": REGC, "reec_b": REEC._replace(Pmin=-0.1)}
    with pytest.raises(LinearizationError, match="a converter that can only deliver power has none: give it some"):
        linearize(operating_point.solve(small(models, p=0.0)))
    assert len(linearize(operating_point.solve(small(models, p=0.01))).states)


def test_a_droop_with_two_slopes_and_no_deadband_is_named_where_it_bends():
    models = {"regc_a": REGC, "reec_b": REEC, "repc_a": PLANT._replace(Dup=0.0)}
    with pytest.raises(
        LinearizationError, match=r"machine 1, .*REPC_A 1, are not differ.* \(Ddn and Dup\) bends there"
    ):
        linearize(operating_point.solve(small(models)))
    assert len(linearize(operating_point.solve(small(models | {"repc_a": PLANT}))).states)
