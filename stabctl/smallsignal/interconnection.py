"""A linear model whose inputs and outputs are signals, and the loops of continuous controllers closed in it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stabctl.dynamics.layout import StatePlace, unique
from stabctl.dynamics.named import Named
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.dynamics.signals import Signal
from stabctl.errors import StudyError

from .descriptor import descriptor
from .model import Linear, eliminated


@dataclass(frozen=True)
class Plant:
    """A linear model with its inputs and outputs as signals."""

    model: Linear
    drives: Sequence[Signal]
    reads: Sequence[Signal]

    def columns(self, signals: Iterable[Signal]) -> list[int]:
        """Columns of B of some inputs."""
        return [self.drives.index(s) for s in signals]

    def rows(self, signals: Iterable[Signal]) -> list[int]:
        """Rows of C of some outputs."""
        return [self.reads.index(s) for s in signals]

    def with_continuous(self, c: Named) -> "Plant":
        """The loop closed with u = K y added to the inputs it drives."""
        m, K = self.model, c.matrices
        inputs, outs = (
            np.eye(len(self.drives))[:, self.columns(c.outputs)],
            np.eye(len(self.reads))[self.rows(c.inputs)],
        )
        B, D = m.B @ inputs, m.D @ inputs  # of what the controller gives
        L = outs @ D  # direct path from its outputs to its inputs
        Dk, Ck = c.gains[:, None] * K.D, c.gains[:, None] * K.C
        try:
            Q = np.linalg.inv(np.eye(len(Dk)) - Dk @ L)
        except np.linalg.LinAlgError:
            raise StudyError(
                f"{c.controller.name} forms an algebraic loop of gain 1 with the network; add a lag to it."
            ) from None
        # u = Q (Ck xk + Dk (outs C x + outs D w)), w the other inputs
        F = [Q @ Dk @ outs @ m.C, Q @ Ck, Q @ Dk @ outs @ m.D]
        y = [outs @ m.C + L @ F[0], L @ F[1], outs @ m.D + L @ F[2]]
        A = np.block([[m.A + B @ F[0], B @ F[1]], [K.B @ y[0], K.A + K.B @ y[1]]])
        Bn = np.vstack([m.B + B @ F[2], K.B @ y[2]])
        Cn, Dn = np.hstack([m.C + D @ F[0], D @ F[1]]), m.D + D @ F[2]
        places = [
            StatePlace("controller", 0, -1, f"x{i + 1}", f"x{i + 1} {c.controller.name}") for i in range(len(K.A))
        ]
        states = unique((*m.states, *(p.label for p in places)))
        model = replace(m, A=A, B=Bn, C=Cn, D=Dn, states=states, places=(*m.places, *places))
        return replace(self, model=model)


def plant_of(
    point: OperatingPoint, own: Sequence[Named], inputs: Iterable[Signal] = (), outputs: Iterable[Signal] = ()
) -> Plant:
    """The system with all that controllers drive and read as inputs and outputs, and more of them."""
    drives = list(dict.fromkeys([s for c in own for s in c.outputs] + list(inputs)))
    reads = list(dict.fromkeys([s for c in own for s in c.inputs] + list(outputs)))
    return Plant(eliminated(descriptor(point, drives, reads)), drives, reads)
