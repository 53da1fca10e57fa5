"""Derivatives of every device at its own terminals: a few complex steps for the whole system.

Devices meet only through the network. Given private terminals, no two of them act on the same row, so that one
place of every device is perturbed at once: some twenty evaluations instead of one per state.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from stabctl.dynamics import layout, system
from stabctl.dynamics.jacobian import jacobian
from stabctl.dynamics.system import Buffers, Plant


class Private(NamedTuple):
    """The plant with private terminals for machines, storage devices and loads, in this order."""

    plant: Plant
    bus: np.ndarray  # (terminals) row of the bus each stands at
    owner: np.ndarray  # (rows of f) terminal of the device that the row belongs to
    columns: np.ndarray  # (colors, terminals) places perturbed at once; the last two are the voltages


def private(plant: Plant) -> Private:
    """Private terminals for every device that injects a current."""
    m, ns, nl = len(plant.machine_bus), len(plant.storage), len(plant.load)
    bus = np.concatenate([plant.machine_bus, plant.storage_bus, plant.load_bus])
    alone = plant._replace(
        machine_bus=np.arange(m), storage_bus=m + np.arange(ns), load_bus=m + ns + np.arange(nl)
    )  # fmt: skip
    n = system.sizes(alone, len(bus))
    owner = np.r_[plant.owner, m + np.repeat(np.arange(ns), 2), np.repeat(np.arange(len(bus)), 2)]
    machines = layout.colors(alone, len(bus))
    table = np.full((max(len(machines), 2) + 2, len(bus)), -1, np.int64)
    table[: len(machines), :m] = machines
    for j in range(ns):
        share = system.first_state(alone, "storage") + 2 * j
        table[:2, m + j] = share, n.states + n.voltages + 2 * n.machines + j
    table[-2:] = n.states + np.arange(2 * len(bus)).reshape(-1, 2).T
    return Private(alone, bus, owner, table)


def at(alone: Private, z: np.ndarray) -> Buffers:
    """Buffers of the private plant at z of the whole one."""
    b = system.buffers(alone.plant, len(alone.bus), complex)
    nx = len(b.f) - 2 * len(alone.bus)
    buses = (len(z) - len(b.z)) // 2 + len(alone.bus)
    b.z[:nx] = z[:nx]
    b.s.v[:] = z[nx : nx + 2 * buses].reshape(-1, 2)[alone.bus]
    b.z[nx + 2 * len(alone.bus) :] = z[nx + 2 * buses :]
    return b


def values(alone: Private, b: Buffers) -> np.ndarray:
    """State rates (1/s), then the injected currents (terminals, 2) as one vector, pu."""
    J = np.empty((len(b.f), 1))
    jacobian(b, alone.plant, _all_on(alone), np.full((1, 1), -1, np.int64), J)
    return b.f.real.copy()


def derivatives(alone: Private, b: Buffers) -> np.ndarray:
    """Row k: derivatives of f (rows of f) along the places of its owner in `columns[k]`; 0 where there is none."""
    J = np.empty((len(b.f), len(alone.columns)))
    jacobian(b, alone.plant, _all_on(alone), alone.columns, J)
    return J.T


def voltage_slopes(alone: Private, b: Buffers) -> np.ndarray:
    """The last two rows of `derivatives`: slopes of f along both components of its own voltage."""
    J = np.empty((len(b.f), 2))
    jacobian(b, alone.plant, _all_on(alone), alone.columns[-2:], J)
    return J.T


def assemble(alone: Private, J: np.ndarray, buses: int) -> sp.csc_matrix:
    """Sparse derivative of [state rates | currents into the buses] along the places of z of the whole plant."""
    n = system.sizes(alone.plant, len(alone.bus))
    rows = np.r_[np.arange(n.states), n.states + _pairs(alone.bus)]
    shift = 2 * (buses - len(alone.bus))
    entries = []
    for k, place in enumerate(alone.columns[:, alone.owner]):
        live = (place >= 0) & (J[k] != 0)
        column = place[live]
        if k >= len(alone.columns) - 2:
            column = n.states + 2 * alone.bus[alone.owner[live]] + (k - len(alone.columns) + 2)
        else:
            column = np.where(column < n.states, column, column + shift)
        entries.append((J[k, live], rows[live], column))
    data, row, column = (np.concatenate(part) for part in zip(*entries, strict=True))
    shape = (n.states + 2 * buses, n.states + 2 * buses + 2 * n.machines + n.storage)
    return sp.csc_matrix((data, (row, column)), shape=shape)


def currents(alone: Private, f: np.ndarray, buses: int) -> np.ndarray:
    """Currents (buses, complex, pu) of the devices from the answer of `values`."""
    out = np.zeros(buses, complex)
    np.add.at(out, alone.bus, f[len(f) - 2 * len(alone.bus) :].view(complex))
    return out


def real(Y: sp.spmatrix) -> sp.csc_matrix:
    """Real form (2n, 2n) of a complex admittance, real and imaginary parts interleaved."""
    return sp.kron(Y.real, np.eye(2), "csc") + sp.kron(Y.imag, [[0, -1], [1, 0]], "csc")


def _pairs(bus: np.ndarray) -> np.ndarray:
    return (2 * bus[:, None] + np.arange(2)).ravel()


def _all_on(alone: Private) -> np.ndarray:
    return np.zeros(len(alone.plant.machine_bus), np.int64)
