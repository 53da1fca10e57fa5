"""Signals of other buses and machines."""

from dataclasses import replace

import numpy as np
import pytest
from records import csvgn1
from systems import kind, small

from stabctl._util.errors import EquilibriumError
from stabctl.dynamics import family, operating_point
from stabctl.model.tables import Branch, Bus, Machine
from stabctl.simulation.events import LoadStep, Open
from stabctl.simulation.simulation import run

STEP = [LoadStep(2, 0.1, 20.0)]


class TestElsewhere:
    @pytest.fixture(scope="class")
    @classmethod
    def traced(cls):
        with kind("signals from elsewhere") as models:
            point = operating_point.solve(small(models))
            return run(point, [LoadStep(2, 0.1, 100.0)], 3.0)

    @staticmethod
    def read(traced, signal):
        """What an input of the stabilizer at machine 1 has read."""
        f = traced.point.system.family("wide_area")
        return traced.rows[:, f.w[0, family.INPUTS + f.device.Input._fields.index(signal)]]

    def test_the_voltage_is_that_of_the_bus(self, traced):
        bus = traced.point.net.place[3]
        assert np.abs(self.read(traced, "V") - np.abs(traced.arrays.V[:, bus])).max() < 1e-15
        assert np.ptp(self.read(traced, "V")) > 1e-4

    def test_the_speed_is_that_of_the_machine(self, traced):
        assert np.array_equal(self.read(traced, "far"), traced.arrays.speed[:, 1])
        assert np.array_equal(self.read(traced, "omega"), traced.arrays.speed[:, 0])

    def test_the_frequency_is_the_lagged_rate_of_the_angle(self, traced):
        """wb (f - 1) T is the angle that the sensor lags behind, and its angle turns by wb (f - 1)."""
        f = traced.point.system.family("bus_frequency")
        theta, signal = traced.rows[:, f.w[0, family.STATE]], self.read(traced, "f")
        (wb, T), V = f.k[0], traced.arrays.V[:, traced.point.net.place[3]]
        behind = np.angle(V * np.exp(-1j * theta))
        assert np.abs(wb * (signal - 1) * T - behind).max() < 1e-12
        rate = np.gradient(theta, traced.time)
        late = traced.time > 0.5
        assert np.abs(rate - wb * (signal - 1))[late].max() < 2e-3 * np.abs(rate).max()
        assert np.abs(signal - 1).max() > 1e-4

    def test_the_frequency_follows_the_speed_of_a_strong_machine(self, traced):
        late = traced.time > 0.5
        assert np.abs(self.read(traced, "f") - traced.arrays.speed[:, 1])[late].max() < 1e-4

    def test_its_signal_is_what_its_equation_says(self, traced):
        f = traced.point.system.family("wide_area")
        p, slow = f.device.Par(*f.k[0]), traced.rows[:, f.w[0, family.STATE]]
        want = p.Kv * (self.read(traced, "V") - slow) + p.Kf * (self.read(traced, "f") - 1)
        want += p.Kw * (self.read(traced, "omega") - self.read(traced, "far"))
        assert np.abs(traced.rows[:, f.w[0, -1]] - np.clip(want, p.Vmin, p.Vmax)).max() < 1e-15

    def test_without_gains_it_changes_nothing(self):
        with kind("signals from elsewhere") as models:
            silent = {**models, "wide_area": models["wide_area"]._replace(Kv=0.0, Kf=0.0, Kw=0.0)}
            without = {k: v for k, v in models.items() if k != "wide_area"}
            runs = [run(operating_point.solve(small(one)), STEP, 2.0) for one in (silent, without)]
        assert np.abs(runs[0].arrays.speed - runs[1].arrays.speed).max() < 1e-12

    def test_zero_means_its_own_bus_and_machine(self):
        with kind("signals from elsewhere") as models:
            here = {**models, "wide_area": models["wide_area"]._replace(bus=0, other=0)}
            traced = run(operating_point.solve(small(here)), STEP, 0.5)
        assert np.array_equal(self.read(traced, "far"), traced.arrays.speed[:, 0])
        assert np.abs(self.read(traced, "V") - np.abs(traced.arrays.V[:, 0])).max() < 1e-15

    def test_a_bus_has_one_sensor_however_many_read_it(self):
        with kind("signals from elsewhere") as models:
            case = small(models)
            rows = {1: models["wide_area"], "1#2": models["wide_area"]}
            point = operating_point.solve(replace(case, devices={**case.devices, "wide_area": rows}))
        assert [len(point.system.family(name).w) for name in ("bus_voltage", "bus_frequency")] == [1, 1]

    @pytest.mark.parametrize(
        ("change", "says"),
        [
            ({"bus": 9}, "There is no bus 9 in small, the bus of wide-area stabilizer 1; choose another."),
            (
                {"other": 9},
                "Machine 9 of small has no signal omega, which wide-area stabilizer 1 reads; choose another machine.",
            ),
        ],
    )
    def test_what_is_not_there_is_named(self, change, says):
        with kind("signals from elsewhere") as models, pytest.raises(EquilibriumError) as caught:
            operating_point.solve(small({**models, "wide_area": models["wide_area"]._replace(**change)}))
        assert str(caught.value) == says

    def test_a_machine_without_the_signal_is_called_by_its_name(self):
        with kind("signals from elsewhere") as models:
            case = small({**models, "wide_area": models["wide_area"]._replace(other=3)})
            machines = (*case.machines, Machine(3, 2, 100.0, 0.0, 2, name="2/S"))
            svc = {3: csvgn1.Par(0, 0, 0, K=20.0, T1=0.0, T2=1.0, T3=0.15, T4=1.0, T5=0.01, Cbase=60.0)}
            case = replace(case, machines=machines, devices={**case.devices, "csvgn1": svc})
            with pytest.raises(EquilibriumError, match=r"^Machine 2/S of small has no signal omega"):
                operating_point.solve(case)

    def test_a_bus_that_dies_gives_zero_and_spoils_nothing(self):
        """The stabilizer reads a bus behind a line that opens."""
        with kind("signals from elsewhere") as models:
            case = small({**models, "wide_area": models["wide_area"]._replace(bus=9)})
            buses, branches = (*case.buses, Bus(9, "pq")), (*case.branches, Branch(2, 9, 0.001, 0.02))
            traced = run(operating_point.solve(replace(case, buses=buses, branches=branches)), [Open("2-9", 0.5)], 2.0)
        assert traced.outcome.kind == "islanded"
        assert np.isfinite(traced.rows).all()
        assert self.read(traced, "V")[-1] == 0
        assert self.read(traced, "f")[-1] == 1
