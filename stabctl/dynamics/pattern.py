"""Where the derivatives of all devices go: worked out once for all systems of one structure.

Systems have one structure if they differ only in the parameters of their devices, as in a sweep or a design.
"""

from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np

from . import family
from .layout import Layout
from .program import Program, local_program
from .tables import Family

MOST = 16  # structures kept

_known: dict[Hashable, "Pattern"] = {}


class Pattern:
    """Rows and columns of the entries of the local blocks in [rates | outputs | injections] and the signals.

    Attributes
    ----------
    program
        Calls that make all outputs and all local derivatives; with the constants of the first system.
    rows, columns
        Row and column of every entry.
    starts
        Where the blocks of each family begin.
    slopes, values
        Places of the entries in the blocks; those of the rates, outputs and injections themselves.
    answers
        Rows of these values.
    injections, injecting
        Family -> its injections; places of the bus voltage of every injection.
    total
        Number of rows.
    kept
        What follows from the pattern, by name.
    """

    def __init__(self, families: Sequence[Family], layout: Layout) -> None:
        self.program: Program = local_program(families)
        self.kept: dict[str, Any] = {}
        self.injections: dict[str, slice] = {}
        rows, columns, places, injection, starts = [], [], [], 0, [0]
        slopes, values, all_answers = [], [], []
        first = layout.nx + layout.outputs
        for f in families:
            states, inputs, outputs, buses = family.shape(f.device)
            n, j = len(f.w), np.arange(len(f.w))[:, None]
            bus = f.w[:, [family.BUS, family.BUS2][:buses]]
            voltages = (bus[:, :, None] + np.arange(2)).reshape(n, 2 * buses)
            x = f.w[:, [family.STATE]] + np.arange(states)
            variables = np.hstack([x, f.w[:, family.INPUTS : family.INPUTS + inputs], voltages])
            y = f.w[:, [-1]] - layout.first_output + layout.nx + np.arange(outputs)
            g = first + 2 * (injection + buses * j) + np.arange(2 * buses)
            answers = np.hstack([x, y, g])
            self.injections[f.name] = slice(injection, injection + buses * n)
            injection += buses * n
            places.append(bus.ravel())
            shape = (n, variables.shape[1], answers.shape[1])
            columns.append(np.broadcast_to(variables[:, :, None], shape).ravel())
            rows.append(np.broadcast_to(answers[:, None, :], shape).ravel())
            all_answers.append(answers.ravel())
            blocks = starts[-1] + np.arange(n * (shape[1] + 1) * shape[2]).reshape(n, shape[1] + 1, shape[2])
            slopes.append(blocks[:, :-1].ravel())
            values.append(blocks[:, -1].ravel())
            starts.append(starts[-1] + blocks.size)
        self.rows, self.columns = np.concatenate(rows), np.concatenate(columns)
        self.starts, self.answers = np.array(starts, np.int64), np.concatenate(all_answers)
        self.slopes, self.values = np.concatenate(slopes), np.concatenate(values)
        self.injecting = np.concatenate(places)
        self.total = first + 2 * injection


def pattern(families: Sequence[Family], layout: Layout) -> Pattern:
    """The pattern of a system, shared by all systems of its structure."""
    key = layout.size, *((f.name, f.device, len(f.w), f.w.tobytes()) for f in families)
    found = _known.get(key)
    if found is None:
        found = Pattern(families, layout)
        while len(_known) >= MOST:
            _known.pop(next(iter(_known)), None)
        _known[key] = found
    return found
