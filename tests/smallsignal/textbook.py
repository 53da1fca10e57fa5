"""Kundur's machine written out with its rotor circuits, independent of the package's models.

Per unit on the machine's base. Mutual fluxes psi_ad, psi_aq are unknowns beside the bus voltages:

    psi_ad + psi_I,d = Lad (-id + ifd + i1d),  psi_aq + psi_I,q = Laq (-iq + i1q + i2q)
    ifd = (psi_fd - psi_ad)/Lfd, and the other rotor currents alike

psi_I is what saturation takes, Asat exp(Bsat (psi_at - psi_T1)) along the total flux. `incremental` is the book's
linearization (section 3.8.2, 12.3): the incremental saturation factor on both axes, whichever way the flux moves;
without it, the true derivative. `speed_voltage` puts the speed into the stator voltages, `constant_power` keeps the
mechanical power, not the torque.
"""

from typing import NamedTuple

import numpy as np

from stabctl import io
from stabctl.model import network, powerflow

WB = 2 * np.pi * 60
H = np.array([6.5, 6.5, 6.175, 6.175])
RA, XL, LAD, LAQ = 0.0025, 0.2, 1.6, 1.5
LFD = LAD * 0.1 / (LAD - 0.1)
L1D = 1 / (1 / 0.05 - 1 / 0.1)
L1Q = LAQ * 0.35 / (LAQ - 0.35)
L2Q = 1 / (1 / 0.05 - 1 / 0.35)
RFD, R1Q = (LAD + LFD) / (WB * 8.0), (LAQ + L1Q) / (WB * 0.4)
R1D = (L1D + LAD * LFD / (LAD + LFD)) / (WB * 0.03)
R2Q = (L2Q + LAQ * L1Q / (LAQ + L1Q)) / (WB * 0.05)
ASAT, BSAT, PSIT1 = 0.015, 9.6, 0.9
KA, TR, TW, T1, T2, T3, T4, KSTAB = 200.0, 0.01, 10.0, 0.05, 0.02, 3.0, 5.4, 20.0
STEP = 1e-30


class Option(NamedTuple):
    """What the machine and its controls are."""

    control: str  # manual, thyristor or pss
    incremental: bool = True
    speed_voltage: bool = False
    constant_power: bool = False


class System:
    """Example 12.6 at its operating point: residuals of the states and of the algebra."""

    def __init__(self, option: Option) -> None:
        case = io.load("two_area_manual")
        flow, net = powerflow.solve(case), network.build(case)
        self.option, self.bus, self.Y = option, net.machine_bus, network.admittance(net).toarray()
        self.load, self.v0 = powerflow.demand(case), np.abs(flow.V)
        V = flow.V[self.bus]
        current = (flow.S / V).conj() / 9
        air = np.abs(V + (RA + 1j * XL) * current)
        taken = ASAT * np.exp(BSAT * (air - PSIT1)) / air
        delta = np.angle(V + (RA + 1j * (XL + LAQ / (1 + taken))) * current)
        turn = np.exp(-1j * (delta - np.pi / 2))
        i, v = current * turn, V * turn
        self.ad, self.aq = v.imag + RA * i.imag + XL * i.real, -(v.real + RA * i.real) + XL * i.imag
        self.taken, self.slope = taken, 1 + BSAT * taken * air
        ifd = self.ad * (1 + taken) / LAD + i.real
        self.efd, self.torque = LAD * ifd, self.ad * i.imag - self.aq * i.real
        self.vref = np.abs(V) + self.efd / KA
        parts = [delta, np.ones(4), self.ad + LFD * ifd, self.ad, self.aq, self.aq]
        parts += [np.abs(V)] if option.control != "manual" else []
        parts += [np.ones(4), np.zeros(4), np.zeros(4)] if option.control == "pss" else []
        self.x = np.concatenate(parts).astype(complex)
        self.y = np.concatenate([flow.V.view(float), self.ad, self.aq]).astype(complex)

    def residual(self, x, y):
        """State rates, then current balance of the buses and terminal voltages of the machines."""
        n = len(self.Y)
        V, (ad, aq) = y[: 2 * n].reshape(n, 2), y[2 * n :].reshape(2, 4)
        delta, w, fd, d1, q1, q2 = x[:24].reshape(6, 4)
        field, current1d = (fd - ad) / LFD, (d1 - ad) / L1D
        current1q, current2q = (q1 - aq) / L1Q, (q2 - aq) / L2Q
        mmf_d, mmf_q = self._mmf(ad, aq)
        id_, iq = field + current1d - mmf_d / LAD, current1q + current2q - mmf_q / LAQ
        speed = w if self.option.speed_voltage else 1.0
        vd, vq = -RA * id_ - speed * (aq - XL * iq), -RA * iq + speed * (ad - XL * id_)
        s, c = np.sin(delta), np.cos(delta)
        g = np.zeros((n, 2), complex)
        g[self.bus, 0], g[self.bus, 1] = 9 * (id_ * s + iq * c), 9 * (iq * s - id_ * c)
        size = np.sqrt(V[:, 0] ** 2 + V[:, 1] ** 2)
        G, B = self.load.real / (size * self.v0), self.load.imag / self.v0**2
        g[:, 0] -= G * V[:, 0] + B * V[:, 1] + self.Y.real @ V[:, 0] - self.Y.imag @ V[:, 1]
        g[:, 1] -= G * V[:, 1] - B * V[:, 0] + self.Y.imag @ V[:, 0] + self.Y.real @ V[:, 1]
        terminal = V[self.bus, 0] - vd * s - vq * c, V[self.bus, 1] + vd * c - vq * s
        driving = self.torque / w if self.option.constant_power else self.torque
        efd, controls = self._controls(x, w, size[self.bus])
        rates = [
            WB * (w - 1),
            (driving - (ad * iq - aq * id_)) / (2 * H),
            WB * RFD * (efd / LAD - field),
            -WB * R1D * current1d,
            -WB * R1Q * current1q,
            -WB * R2Q * current2q,
            *controls,
        ]
        return np.concatenate([*rates, g.ravel(), *terminal])

    def _mmf(self, ad, aq):
        if self.option.incremental:
            start = 1 + self.taken
            return (self.ad * start + self.slope * (ad - self.ad), self.aq * start + self.slope * (aq - self.aq))
        total = np.sqrt(ad * ad + aq * aq)
        taken = ASAT * np.exp(BSAT * (total - PSIT1)) / total
        return ad * (1 + taken), aq * (1 + taken)

    def _controls(self, x, w, vt):
        if self.option.control == "manual":
            return self.efd, []
        measured, signal, rates = x[24:28], 0.0, []
        if self.option.control == "pss":
            slow, lag1, lag2 = x[28:40].reshape(3, 4)
            fast = KSTAB * (w - slow)
            first = lag1 + T1 / T2 * (fast - lag1)
            signal = lag2 + T3 / T4 * (first - lag2)
            rates = [(w - slow) / TW, (fast - lag1) / T2, (first - lag2) / T4]
        return KA * (self.vref - measured + signal), [(vt - measured) / TR, *rates]


def swings(option: Option) -> np.ndarray:
    """The three electromechanical eigenvalues (upper half), the slowest first."""
    system = System(option)
    z, n = np.concatenate([system.x, system.y]), len(system.x)
    assert np.abs(system.residual(system.x, system.y)).max() < 1e-8
    J = np.empty((len(z), len(z)))
    for k in range(len(z)):
        step = z.copy()
        step[k] += 1j * STEP
        J[:, k] = system.residual(step[:n], step[n:]).imag / STEP
    values = np.linalg.eigvals(J[:n, :n] - J[:n, n:] @ np.linalg.solve(J[n:, n:], J[n:, :n]))
    found = values[(values.imag > 1) & (values.imag < 12) & (values.real > -3)]
    return found[np.argsort(found.imag)]
