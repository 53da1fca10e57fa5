"""Governors at random points, beside their diagrams written down a second time."""

import numpy as np
import pytest
from pointwise import compare, held, outside


def lead(T1, T2, u, x):
    """Output of [(1+sT1)/(1+sT2)], its lagged input x."""
    return x + T1 / T2 * (u - x)


def tgov(p, x, u, _):
    order = held(u.Pref - p.K * (u.omega - 1), p.Pmin, p.Pmax)
    gate = lead(p.T3, p.Tc, x.servo, x.gate)
    return {
        "servo": (order - x.servo) / p.Ts,
        "gate": (x.servo - x.gate) / p.Tc,
        "turbine": (gate - x.turbine) / p.T5,
        "Pm": lead(p.T4, p.T5, gate, x.turbine),
    }


def tgov1(p, x, u, _):
    return {
        "valve": ((u.Pref - u.omega + 1) / p.R - x.valve) / p.T1,
        "turbine": (x.valve - x.turbine) / p.T3,
        "Pm": lead(p.T2, p.T3, x.valve, x.turbine) - p.Dt * (u.omega - 1),
    }


def gast(p, x, u, _):
    order = min(u.Pref - (u.omega - 1) / p.R, p.AT + p.KT * (p.AT - x.heat))
    return {
        "valve": (order - x.valve) / p.T1,
        "flow": (x.valve - x.flow) / p.T2,
        "heat": (x.flow - x.heat) / p.T3,
        "Pm": x.flow - p.Dturb * (u.omega - 1),
    }


def ieeeg1(p, x, u, _):
    speed = lead(p.T2, p.T1, u.omega - 1, x.governor)
    shares = (p.K1 + p.K2, p.K3 + p.K4, p.K5 + p.K6, p.K7 + p.K8)
    return {
        "governor": (u.omega - 1 - x.governor) / p.T1,
        "valve": held((u.Pref - p.K * speed - x.valve) / p.T3, p.Umin, p.Umax),
        "one": (x.valve - x.one) / p.T4,
        "two": (x.one - x.two) / p.T5,
        "three": (x.two - x.three) / p.T6,
        "four": (x.three - x.four) / p.T7,
        "Pm": sum(k * stage for k, stage in zip(shares, (x.one, x.two, x.three, x.four), strict=True)),
    }


def hygov(p, x, u, _):
    d_error = (u.Pref - (u.omega - 1) - p.R * x.desired - x.error) / p.Tf
    head = (x.flow / x.gate) ** 2
    return {
        "error": d_error,
        "desired": held((x.error + p.Tr * d_error) / (p.r * p.Tr), -p.VELM, p.VELM),
        "gate": (x.desired - x.gate) / p.Tg,
        "flow": (1 - head) / p.Tw,
        "Pm": p.At * head * (x.flow - p.qNL) - p.Dturb * x.gate * (u.omega - 1),
    }


def ieesgo(p, x, u, _):
    order, speed = held(u.Pref - x.governor, p.Pmin, p.Pmax), p.K1 * (u.omega - 1)
    return {
        "controller": (speed - x.controller) / p.T1,
        "governor": (lead(p.T2, p.T1, speed, x.controller) - x.governor) / p.T3,
        "one": (order - x.one) / p.T4,
        "two": (x.one - x.two) / p.T5,
        "three": (x.two - x.three) / p.T6,
        "Pm": (1 - p.K2) * x.one + p.K2 * (1 - p.K3) * x.two + p.K2 * p.K3 * x.three,
    }


def ieeeg3(p, x, u, _):
    droop = p.sigma * x.gate + p.delta * (x.gate - x.dashpot)
    e = u.Pref - (u.omega - 1) - droop
    T = p.a11 * p.TW
    return {
        "pilot": (e / p.TG - x.pilot) / p.TP,
        "gate": held(x.pilot, p.Umin, p.Umax),
        "dashpot": (x.gate - x.dashpot) / p.TR,
        "turbine": (x.gate - x.turbine) / T,
        "Pm": p.a23 * lead((p.a11 - p.a13 * p.a21 / p.a23) * p.TW, T, x.gate, x.turbine),
    }


def engine(p, x, e):
    """Electric box, actuator and delay of a Woodward diesel governor, driven by e."""
    curve = (e - x.box - p.T1 * x.box_rate) / (p.T1 * p.T2)
    drive = x.box + p.T3 * x.box_rate
    T, product = p.T5 + p.T6, p.T5 * p.T6
    rates = {
        "box": x.box_rate,
        "box_rate": curve,
        "drive": x.drive_rate,
        "drive_rate": (drive - x.drive - T * x.drive_rate) / product,
        "throttle": p.K * (x.drive + p.T4 * x.drive_rate),
    }
    s, T = x.throttle, p.TD / 4
    for k in range(1, 5):  # (1 - sT/2 + s^2 T^2/12)/(1 + sT/2 + s^2 T^2/12)
        y, dy = getattr(x, f"d{k}"), getattr(x, f"d{k}_rate")
        curve = (s - y - T / 2 * dy) * 12 / T**2
        rates |= {f"d{k}": dy, f"d{k}_rate": curve}
        s = y - T / 2 * dy + T**2 / 12 * curve
    return rates, s


def degov(p, x, u, _):
    rates, power = engine(p, x, 1 - u.omega)
    return rates | {"Pm": power * u.omega}


def degov1(p, x, u, _):
    rates, power = engine(p, x, u.Pref - (u.omega - 1) - p.DROOP * (x.power if p.M else x.throttle))
    return rates | {"power": (u.P - x.power) / p.TE, "Pm": power * u.omega}


def curve(p, gate):
    """Power at a gate opening; the first and the last segment go on beyond their ends."""
    xs, ys = (p.G0, p.G1, p.G2, 1.0), (0.0, p.P1, p.P2, p.P3)
    k = int(np.clip(np.searchsorted(xs, gate), 1, 3))
    return ys[k - 1] + (ys[k] - ys[k - 1]) / (xs[k] - xs[k - 1]) * (gate - xs[k - 1])


def pidgov(p, x, u, _):
    e = x.droop - (u.omega - 1)
    terms = x.proportional + p.Kd / p.Ta * (e - x.derivative)
    Tz = p.Atw * p.Tw
    return {
        "droop": (p.Rperm * (u.Pref - (x.gate if p.feedback else u.P)) - x.droop) / p.Treg,
        "integral": p.Ki * e,
        "proportional": (p.Kp * e + x.integral - x.proportional) / p.Ta,
        "derivative": (e - x.derivative) / p.Ta,
        "desired": (terms - x.desired) / p.Ta,
        "gate": held((x.desired - x.gate) / p.Tb, p.Velmin, p.Velmax),
        "water": (curve(p, x.gate) - x.water) / (Tz / 2),
        "Pm": lead(-Tz, Tz / 2, curve(p, x.gate), x.water) - p.Dturb * (u.omega - 1),
    }


def wpidhy(p, x, u, _):
    """The first lag, in partial fractions: (Kp + Ki/s + sKd)/(1+sTa) = Ki/s + (Kp - Ki Ta + sKd)/(1+sTa)."""
    e = x.droop - (u.omega - 1)
    d_derivative = (e - x.derivative) / p.Ta
    terms = x.integral + (p.Kp - p.Ki * p.Ta) * x.derivative + p.Kd * d_derivative
    power = curve(p, x.gate)
    return {
        "droop": (p.Reg * (u.P - u.Pref) - x.droop) / p.Treg,
        "integral": p.Ki * e,
        "derivative": d_derivative,
        "one": (terms - x.one) / p.Ta,
        "two": (x.one - x.two) / p.Tb,
        "gate": held(x.two, p.Velmin, p.Velmax),
        "water": (power - x.water) / (p.Tw / 2),
        "Pm": held(lead(-p.Tw, p.Tw / 2, power, x.water), p.Pmin, p.Pmax) - p.D * (u.omega - 1),
    }


def ggov1(p, x, u, _):
    measured = u.P * p.base / p.Trate
    y = {1: x.pe, 0: 0.0, -1: x.ago, -2: x.valve}[p.select]
    e = held(outside(u.Pref + x.load - p.R * y - (u.omega - 1), -p.db, p.db), p.errmin, p.errmax)
    part = p.Kdgov / p.Tdgov * (e - x.lagged)
    fsrn = p.Kpgov * e + part + x.gov
    fsrt = p.Kpload * (p.Ldref / p.Kturb + p.Wfnl - x.exhaust) + x.limiter
    fsra = x.ago + 0.01 * p.Ka * (p.Aset - (u.omega - x.swing) / p.Ta)
    fsr = held(min(fsrn, fsrt, fsra), p.Vmin, p.Vmax)
    q = x.valve * u.omega if p.fuel else x.valve
    T = p.Teng
    curve = (p.Kturb * (q - p.Wfnl) - x.delayed - T / 2 * x.ddelayed) * 12 / T**2
    after = x.delayed - T / 2 * x.ddelayed + T**2 / 12 * curve
    hot = q * u.omega**p.Dm if p.Dm < 0 else q
    return {
        "pe": (measured - x.pe) / p.Tpelec,
        "lagged": (e - x.lagged) / p.Tdgov,
        "gov": p.Kigov / p.Kpgov * (fsr - part - x.gov),
        "valve": held((fsr - x.valve) / p.Tact, p.Rmin, p.Rmax),
        "delayed": x.ddelayed,
        "ddelayed": curve,
        "turbine": (after - x.turbine) / p.Tb,
        "detected": (hot - x.detected) / p.Tsb,
        "exhaust": (lead(p.Tsa, p.Tsb, hot, x.detected) - x.exhaust) / p.Tfload,
        "limiter": p.Kiload / p.Kpload * (fsr - x.limiter),
        "load": p.Kimw * (u.Pref / p.R - x.pe),
        "swing": (u.omega - x.swing) / p.Ta,
        "ago": (fsr - x.ago) / 0.01,
        "Pm": (lead(p.Tc, p.Tb, after, x.turbine) - max(p.Dm, 0) * (u.omega - 1)) * p.Trate / p.base,
    }


GATE = {"G0": (0.05, 0.15), "G1": (0.4, 0.5), "P1": (0.2, 0.25), "G2": (0.7, 0.8), "P2": (0.5, 0.55), "P3": (1.0, 1.2)}
GATE |= {"Gmax": (0.8, 1.2), "Gmin": (-0.2, 0.2), "Gatmax": (0.8, 1.2), "Gatmin": (-0.2, 0.2)}
ITS = {"u.omega": (0.7, 1.3), "feedback": [0, 1], "M": [0, 1], "x.gate": (0.1, 1.2), "x.flow": (0.1, 1.2)}
ITS |= {"Umax": (0.5, 1.5), "Umin": (-0.7, -0.2), "Velmax": (0.5, 1.5), "Velmin": (-0.7, -0.2)}
ITS |= {"select": [1, 0, -1, -2], "fuel": [0, 1], "Dm": (-0.9, 0.9), "Trate": (50.0, 90.0), "base": (80.0, 130.0)}
ITS |= {"db": (0.01, 0.1), "Rmax": (0.5, 3.0), "Rmin": (-2.0, -0.4), "Ka": (1.0, 9.0), "x.swing": (0.7, 1.3)}
ITS |= {"x.exhaust": (0.1, 0.9), "x.ago": (-0.2, 1.0), "x.load": (-0.1, 0.1)}
ITS |= {"K1": (0.1, 2.0), "a21": (1.2, 1.6), "Reg": (-0.9, -0.1)}
MODELS = {f.__name__: f for f in (tgov, tgov1, gast, ieeeg1, ieesgo, ieeeg3, degov, degov1, pidgov, wpidhy)}
MODELS |= {"hygov": hygov, "ggov1": ggov1}


@pytest.mark.parametrize("name", MODELS)
def test_a_governor_is_its_diagram_within_and_beyond_every_limit(name):
    gate = GATE if name in ("pidgov", "wpidhy") else {"Gmax": (0.6, 1.1), "Gmin": (0.1, 0.3)}
    compare(name, MODELS[name], ITS | gate)
