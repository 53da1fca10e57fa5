"""Load flow by Newton's method in polar coordinates, sparse."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from stabctl.errors import PowerFlowError

from . import network
from .case import Case

TOLERANCE = 1e-10  # pu   largest power mismatch


@dataclass(frozen=True, repr=False, eq=False)
class PowerFlow:
    """A solved load flow: voltages of the buses and power of the machines, pu on the system base, in table order."""

    case: Case
    V: np.ndarray  # (buses) complex, pu
    S: np.ndarray  # (machines) complex, pu   power produced
    iterations: int

    @property
    def branch_power(self) -> np.ndarray:
        """Complex power (branches, 2) that enters every branch at its from and its to end, pu, in table order.

        The sum over both ends is what the branch loses, its charging included.
        """
        net = network.build(self.case)
        frm, to = self.V[net.frm] / net.ratio, self.V[net.to]
        through, half = (frm - to) / net.z, 0.5j * net.charging
        return np.stack([frm * (through + half * frm).conj(), to * (half * to - through).conj()], axis=1)

    def __str__(self) -> str:
        low, high = np.abs(self.V).argmin(), np.abs(self.V).argmax()
        number = [b.bus for b in self.case.buses]
        produced = self.S.real.sum() * self.case.base_mva
        return (
            f"load flow of {self.case.name}: {self.iterations} iterations, {produced:.1f} MW produced, "
            f"voltages from {abs(self.V[low]):.3f} pu (bus {number[low]}) to {abs(self.V[high]):.3f} pu "
            f"(bus {number[high]})"
        )

    __repr__ = __str__


def demand(case: Case, place: dict[int, int] | None = None) -> np.ndarray:
    """Complex power (pu) drawn at every bus by loads and HVDC terminals, at load-flow voltage."""
    place = place or {b.bus: i for i, b in enumerate(case.buses)}
    S = np.zeros(len(case.buses), complex)
    for load in case.loads:
        S[place[load.bus]] += (load.p + 1j * load.q) / case.base_mva
    for link in case.links:
        S[place[link.from_bus]] += link.p / case.base_mva
        S[place[link.to_bus]] -= (link.p - link.loss) / case.base_mva
    return S


def solve(case: Case, limit: int = 30) -> PowerFlow:
    """The load flow of a case, from the voltages in its table or else from a flat start.

    Raises `PowerFlowError`, which names the worst bus, where Newton finds no solution from either.
    """
    net = network.build(case)
    Y = network.admittance(net)
    drawn = demand(case, net.place)
    wanted = -drawn
    for m, bus in zip(case.machines, net.machine_bus, strict=True):
        wanted[bus] += m.p / case.base_mva
    kind = np.array([b.kind for b in case.buses])
    pv, pq = np.flatnonzero(kind == "pv"), np.flatnonzero(kind == "pq")
    size, angle = np.array([b.v for b in case.buses]), np.deg2rad([b.angle for b in case.buses])
    flat = np.where(kind == "pq", 1.0, size), np.full(len(kind), angle[kind == "swing"][0])
    try:
        V, iterations = _newton(case, Y, size, angle, wanted, pv, pq, limit)
    except PowerFlowError as as_given:
        try:
            V, iterations = _newton(case, Y, *flat, wanted, pv, pq, limit)
        except PowerFlowError:
            raise as_given from None
    injected = V * (Y @ V).conj() + drawn
    return PowerFlow(case, V, _shared(case, net.machine_bus, injected), iterations)


def _newton(
    case: Case,
    Y: sp.csc_matrix,
    size: np.ndarray,
    angle: np.ndarray,
    wanted: np.ndarray,
    pv: np.ndarray,
    pq: np.ndarray,
    limit: int,
) -> tuple[np.ndarray, int]:
    """Voltages (pu) at which the injections are `wanted`, and the steps it took; halved until the mismatch falls."""
    pvpq = np.r_[pv, pq]
    worst, iteration = (0, np.inf), 0

    def mismatch(size: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
        V = size * np.exp(1j * angle)
        current = Y @ V
        miss = V * current.conj() - wanted
        F = np.r_[miss.real[pvpq], miss.imag[pq]]
        good = np.isfinite(F).all() and (not len(pq) or size[pq].min() > 0)
        return V, current, miss, F, float(np.abs(F).max(initial=0.0)) if good else np.inf

    with np.errstate(all="ignore"):
        V, current, miss, F, now = mismatch(size, angle)
        for iteration in range(limit + 1):
            if now < TOLERANCE:
                return V, iteration
            if now == np.inf:
                break
            worst = pvpq[np.abs(miss[pvpq]).argmax()], np.abs(miss[pvpq]).max()
            dV, dI, unit = sp.diags(V), sp.diags(current), sp.diags(V / size)
            da = (1j * dV @ (dI - Y @ dV).conj()).tocsr()
            dm = (dV @ (Y @ unit).conj() + dI.conj() @ unit).tocsr()
            J = sp.bmat([[da[pvpq][:, pvpq].real, dm[pvpq][:, pq].real], [da[pq][:, pvpq].imag, dm[pq][:, pq].imag]])
            try:
                step = splu(J.tocsc()).solve(-F)
            except RuntimeError:
                break
            for halving in range(8):
                tried = size.copy(), angle.copy()
                tried[1][pvpq] += step[: len(pvpq)] / 2**halving
                tried[0][pq] += step[len(pvpq) :] / 2**halving
                V, current, miss, F, then = mismatch(*tried)
                if then < now:
                    break
            else:
                break
            (size, angle), now = tried, then
    (bus, largest), low = worst, int(np.argmin(size))
    raise PowerFlowError(
        f"The load flow of {case.name} found no solution in {iteration} steps: nearest to one, power is missed most at "
        f"bus {case.buses[bus].bus} by {largest * case.base_mva:.4g} MVA, and the voltage is lowest at bus "
        f"{case.buses[low].bus} with {size[low]:.3g} pu; check their loads, lines and voltages."
    )


def _shared(case: Case, machine_bus: np.ndarray, injected: np.ndarray) -> np.ndarray:
    """Power (pu) of every machine: dispatched, the bus's remainder shared by machine base."""
    S = np.array([m.p for m in case.machines], complex) / case.base_mva
    base = np.array([m.base for m in case.machines])
    rest, whole = injected.copy(), np.zeros(len(injected))
    np.add.at(rest, machine_bus, -S)
    np.add.at(whole, machine_bus, base)
    return S + rest[machine_bus] * base / whole[machine_bus]
