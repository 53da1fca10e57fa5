"""Devices that wait for one another's outputs: refused as an algebraic loop, and only then."""

from dataclasses import replace

import numpy as np
import pytest
from systems import EXDC2, KINDS, ROUND, doubled, registered, small

from stabctl._util.errors import EquilibriumError
from stabctl.dynamics import operating_point
from stabctl.dynamics.jacobian import array
from stabctl.simulation.events import LoadStep
from stabctl.simulation.simulation import run

STEP = [LoadStep(2, 0.1, 20.0)]
WITH_PSS = KINDS["sexs, pss, steam"]


class TestLoop:
    EXCITER = '''
from typing import Annotated, NamedTuple
from stabctl._util.jit import inline
from stabctl.devices.exciters.shared import Input, Output

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
    ROOT = ROOT.replace('At("said", "of")', 'At("omega", "of")').replace("import At", "import PORT, At")
    ROOT = ROOT.replace('doubled"]', 'doubled"]\n    Pm: Annotated[float, "pu", "mechanical power"]')
    ROOT = ROOT.replace('"of")]', '"of")]\n    Pref: Annotated[float, "pu", "set-point of the power", PORT]')
    ROOT = ROOT.replace("output(heard)", "output(heard, Pref)").replace("Output(heard)", "Output(heard, Pref)")

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
        d = array(point.equations.at(point.s.copy()).of_outputs)
        speed = point.rotors.angle[2] + 1
        slopes = [d[point.layout.signals[unit, "said"] - point.layout.first_output, speed] for unit in (0, 1, 2)]
        assert slopes == [4, 2, 1]

    @pytest.mark.parametrize("last", [1, 101])
    def test_but_not_in_a_circle(self, chain, last):
        with pytest.raises(EquilibriumError, match=r"form an algebraic loop: .*relay of machine 101 at bus 1"):
            chain(last)
