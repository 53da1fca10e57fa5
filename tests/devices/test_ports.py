"""Ports: what several devices give one of them, what fills it, and signals from elsewhere."""

from dataclasses import replace

import numpy as np
import pytest
from systems import EXDC2, KINDS, OWN, PSS, ROUND, SEXS, doubled, kind, registered, small

from stabctl.dynamics import family, operating_point
from stabctl.errors import EquilibriumError
from stabctl.model.case import Branch, Bus
from stabctl.simulation.events import LoadStep, Open
from stabctl.simulation.simulation import run
from stabctl.smallsignal import linearize

STEP = [LoadStep(2, 0.1, 20.0)]
WITH_PSS = KINDS["sexs, pss, steam"]


def with_stabilizers(*rows, **tables):
    """The case of WITH_PSS with these PSS at machine 1, and with rows of other tables."""
    case = small(WITH_PSS)
    stabilizers = {f"1#{k + 1}" if k else 1: par for k, par in enumerate(rows)}
    return replace(case, devices={**case.devices, "pss": stabilizers, **tables})


def response(point, s=0.3 + 4j):
    """Transfer function from the voltage reference of machine 1 to its speed, field voltage and stabilizing signal."""
    m = linearize(point, ["vref:1"], ["speed:1", "efd:1", "vs:1"])
    return m.C @ np.linalg.solve(s * np.eye(len(m.A)) - m.A, m.B) + m.D


class TestSum:
    @pytest.mark.parametrize("n", [2, 3, 5])
    def test_stabilizers_at_one_machine_add_up(self, n):
        """Some of equal gain are one of their sum, as long as none is limited."""
        many = operating_point.solve(with_stabilizers(*[PSS] * n))
        one = operating_point.solve(with_stabilizers(PSS._replace(K=n * PSS.K)))
        a, b = (run(point, STEP, 3.0) for point in (many, one))
        assert np.abs(a.arrays.speed - b.arrays.speed).max() < 1e-12
        assert np.ptp(b.rows[:, one.layout.signals[0, "Vs"]]) > 1e-4
        assert response(many) == pytest.approx(response(one), rel=1e-10)

    def test_they_need_not_be_alike(self):
        """The signal is the sum of both outputs, each limited for itself."""
        other = PSS._replace(K=50.0, Tw=2.0, T1=0.2, Vmax=0.01, Vmin=-0.01)
        with kind("signals from elsewhere") as models:
            wide = models["wide_area"]
            point = operating_point.solve(with_stabilizers(PSS, other, wide_area={1: wide._replace(Kw=20.0)}))
        traced = run(point, [LoadStep(2, 0.1, 200.0)], 3.0)
        pss, remote = (point.system.family(name) for name in ("pss", "wide_area"))
        parts = [traced.rows[:, place] for place in (*pss.w[:, -1], *remote.w[:, -1])]
        whole = traced.rows[:, point.system.family("sexs").w[0, family.INPUTS + 1]]
        assert np.abs(sum(parts) - whole).max() < 1e-15
        assert [np.abs(part).max() for part in parts] > [1e-3] * 3
        assert np.abs(parts[1]).max() == 0.01
        assert traced.rows[:, point.layout.signals[0, "Vs"]] == pytest.approx(whole, abs=0)

    def test_with_none_it_is_zero(self):
        point = operating_point.solve(small({"genrou": ROUND, "sexs": SEXS}))
        assert point.system.family("sexs").w[0, family.INPUTS + 1] == point.layout.zero


FILLS_VREF = '''
"""Sets the voltage reference of its unit: reactive droop."""
from typing import Annotated, NamedTuple
from stabctl._util.jit import inline
from stabctl.devices.ports import PORT

NAME = "droop"
ROLE = "stabilizer"


class Par(NamedTuple):
    """Constants."""

    K: Annotated[float, "pu", "droop"]


class Input(NamedTuple):
    """Signals."""

    V0: Annotated[float, "pu", "voltage at no reactive power", PORT]
    Q: Annotated[float, "pu", "reactive power"]


class Output(NamedTuple):
    """Signal."""

    Vref: Annotated[float, "pu", "voltage reference"]


@inline
def output(u, p):
    """Voltage reference (pu)."""
    return Output(u.V0 - p.K * u.Q)
'''


class TestPort:
    @pytest.fixture
    def droop(self, tmp_path):
        path = tmp_path / "droop.py"
        path.write_text(FILLS_VREF)
        with registered(path) as (device,):
            yield device

    def test_a_device_that_fills_a_port_takes_the_place_of_its_set_point(self, droop):
        point = operating_point.solve(small({**WITH_PSS, "droop": droop.Par(0.05)}))
        plain = operating_point.solve(small(WITH_PSS))
        assert point.layout.setpoint(0, "Vref") is None
        Q = point.s[point.layout.signals[0, "Q"]]
        V0 = point.s[point.layout.setpoint(0, "V0")]
        vref = plain.s[plain.layout.setpoint(0, "Vref")]
        assert abs(Q) > 0.05
        assert V0 - 0.05 * Q == pytest.approx(vref, abs=1e-12)
        a, b = (run(p, [LoadStep(2, 0.1, 0.0, 50.0)], 5.0).arrays.V[-1, 0] for p in (point, plain))
        assert abs(a) < abs(b) - 1e-4

    def test_without_effect_it_changes_nothing(self, droop):
        both = WITH_PSS, {**WITH_PSS, "droop": droop.Par(0.0)}
        a, b = (run(operating_point.solve(small(models)), STEP, 2.0) for models in both)
        assert np.abs(a.arrays.speed - b.arrays.speed).max() < 1e-12

    def test_two_that_fill_one_port_are_refused(self, droop):
        case = small({**WITH_PSS, "droop": droop.Par(0.05)})
        case = replace(case, devices={**case.devices, "droop": {1: droop.Par(0.05), "1#2": droop.Par(0.05)}})
        with pytest.raises(
            EquilibriumError, match="droop and droop both give Vref of machine 1 at bus 1 in small; keep"
        ):
            operating_point.solve(case)

    def test_a_signal_that_nobody_gives_is_named(self, droop, tmp_path):
        path = tmp_path / "hungry.py"
        path.write_text(FILLS_VREF.replace("Q:", "gas:").replace("u.Q", "u.gas").replace('"droop"', '"hungry"'))
        with registered(path) as (device,), pytest.raises(EquilibriumError) as caught:
            operating_point.solve(small({**WITH_PSS, "hungry": device.Par(0.1)}))
        says = "hungry of machine 1 at bus 1 in small reads gas, which no device of its unit gives; use another model."
        assert str(caught.value) == says


class TestLoop:
    """Devices that wait for each other's outputs."""

    EXCITER = '''
from typing import Annotated, NamedTuple
from stabctl._util.jit import inline
from stabctl.devices.exciters.signals import Input, Output

NAME = "direct"
ROLE = "exciter"


class Par(NamedTuple):
    """Constants."""

    K: Annotated[float, "pu", "gain"]


@inline
def output(u, p):
    """Field voltage (pu)."""
    return Output(p.K * (u.Vref + u.Vs - u.vt))
'''
    STABILIZER = '''
from typing import Annotated, NamedTuple
from stabctl._util.jit import inline

NAME = "field reader"
ROLE = "stabilizer"


class Par(NamedTuple):
    """Constants."""

    K: Annotated[float, "pu", "gain"]


class Input(NamedTuple):
    """Signal."""

    Efd: Annotated[float, "pu", "field voltage"]


class Output(NamedTuple):
    """Signal."""

    Vs: Annotated[float, "pu", "stabilizing signal"]


@inline
def output(Efd, p):
    """Stabilizing signal (pu)."""
    return Output(-p.K * Efd)
'''

    @pytest.fixture
    def models(self, tmp_path):
        paths = tmp_path / "direct.py", tmp_path / "field_reader.py"
        for path, text in zip(paths, (self.EXCITER, self.STABILIZER), strict=True):
            path.write_text(text)
        with registered(*paths) as (exciter, stabilizer):
            yield {"genrou": ROUND, "direct": exciter.Par(20.0), "field_reader": stabilizer.Par(0.01)}

    def test_it_is_named_with_its_devices_and_their_machine(self, models):
        with pytest.raises(EquilibriumError, match=r"^These devices form an algebraic loop: ") as caught:
            operating_point.solve(small(models))
        for name in ("direct of machine 1 at bus 1", "field_reader of machine 1 at bus 1"):
            assert name in str(caught.value)
        assert "\n" not in str(caught.value)

    def test_each_of_them_alone_is_none(self, models):
        direct = {k: models[k] for k in ("genrou", "direct")}
        reader = {"genrou": ROUND, "exdc2": EXDC2, "field_reader": models["field_reader"]}
        for one in (direct, reader):
            point = operating_point.solve(small(one))
            assert run(point, STEP, 1.0).outcome.stable
            assert np.abs(point.equations.at(point.s.copy()).rates).max() < 1e-10

    RELAY = '''
from typing import Annotated, NamedTuple
from stabctl._util.jit import inline
from stabctl.devices.ports import At

NAME = "relay"
ROLE = "stabilizer"


class Par(NamedTuple):
    """Constants."""

    of: Annotated[int, "-", "machine it listens to"]


class Input(NamedTuple):
    """Signal."""

    heard: Annotated[float, "pu", "what that machine says", At("said", "of")]


class Output(NamedTuple):
    """Signal."""

    said: Annotated[float, "pu", "the same doubled"]


@inline
def output(heard):
    """The same doubled (pu)."""
    return Output(2 * heard)
'''
    ROOT = RELAY.replace('"relay"', '"root"').replace("stabilizer", "governor").replace("2 * heard", "heard")
    ROOT = ROOT.replace('At("said", "of")', 'At("omega", "of")')

    @pytest.fixture
    def chain(self, tmp_path):
        """Makes a point where machine 1 listens to machine 101, and that to the given one; machine 2 says its speed."""
        for name, text in (("relay", self.RELAY), ("root", self.ROOT)):
            (tmp_path / f"{name}.py").write_text(text)
        with registered(tmp_path / "relay.py", tmp_path / "root.py") as (relay, root):

            def made(last):
                case = doubled(small(WITH_PSS))
                tables = {"relay": {1: relay.Par(101), 101: relay.Par(last)}, "root": {2: root.Par(0)}}
                return operating_point.solve(replace(case, devices={**case.devices, **tables}))

            yield made

    def test_devices_of_one_model_may_listen_to_each_other(self, chain):
        point = chain(2)
        traced = run(point, STEP, 1.0)
        said = [traced.rows[:, point.layout.signals[unit, "said"]] for unit in (0, 1, 2)]
        assert np.array_equal(said[2], traced.arrays.speed[:, 2])
        assert np.array_equal(said[1], 2 * said[2])
        assert np.array_equal(said[0], 4 * said[2])
        d = point.equations.at(point.s.copy()).of_outputs.toarray()
        speed = point.rotors.angle[2] + 1
        slopes = [d[point.layout.signals[unit, "said"] - point.layout.first_output, speed] for unit in (0, 1, 2)]
        assert slopes == [4, 2, 1]

    @pytest.mark.parametrize("last", [1, 101])
    def test_but_not_in_a_circle(self, chain, last):
        with pytest.raises(EquilibriumError, match=r"form an algebraic loop: .*relay of machine 101 at bus 1"):
            chain(last)


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
            here = {**models, "wide_area": models["wide_area"]._replace(bus=0, machine=0)}
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
            ({"bus": 9}, "There is no bus 9 in small, which wide-area stabilizer 1 names as bus."),
            ({"machine": 9}, "Machine 9 of small gives no omega, which wide-area stabilizer 1 reads."),
        ],
    )
    def test_what_is_not_there_is_named(self, change, says):
        with kind("signals from elsewhere") as models, pytest.raises(EquilibriumError) as caught:
            operating_point.solve(small({**models, "wide_area": models["wide_area"]._replace(**change)}))
        assert str(caught.value) == says

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


def test_the_files_of_these_tests_are_devices():
    for path in sorted(OWN.glob("*.py")):
        if not path.name.startswith(("test_", "conftest")):
            with registered(path) as (device,):
                assert device.NAME
