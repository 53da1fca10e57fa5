"""A device alone, its equations evaluated as plain Python: its equilibrium, its linear model, and its motion.

A linear model is compared with a block diagram written with python-control, where `s` is its Laplace variable at the
frequencies W: `(1 + s * T1) / (1 + s * T2)`.
"""

from types import SimpleNamespace

import control
import numpy as np

from stabctl.devices.ports import Port
from stabctl.dynamics import family

W = np.geomspace(1e-2, 1e2, 30)  # rad/s
s = control.frd(1j * W, W)
STEP = 1e-30  # of the complex step
FAR = 1e9


def one(value=1.0):
    """A constant gain at the frequencies W."""
    return control.frd(np.full(len(W), complex(value)), W)


def feedback(forward, backward):
    """The closed loop forward/(1 + forward backward)."""
    return forward / (1 + forward * backward)


def opened(device, p):
    """Parameters, those computed from others filled in, with every limit removed."""
    p = device.prepared(p)
    limits = [n for n in p._fields if n.endswith(("max", "min")) or n in device.upper]
    return p._replace(**{n: family.side(device, n) * FAR for n in limits})


def evaluate(device, p, x, u, v=(1.0, 0.0)):
    """State derivatives and outputs at states x and inputs u (by name)."""
    known = {"p": p, "x": device.State(*x), "v": v, "u": SimpleNamespace(**u), **u}
    if device.has("internal"):
        known["i"] = device.evaluate("internal", known)
    y, rates = device.outputs_and_rates(known)
    return np.array(rates), np.array(y)


def slopes(function, z):
    """Jacobian of a function of a vector, by complex step."""
    steps = 1j * STEP * np.eye(len(z))
    return np.array([np.asarray(function(z + step)).imag / STEP for step in steps]).T


def rest(device, p, u, given, v=(1.0, 0.0)):
    """States and inputs at which nothing moves and the outputs have the values `given`; ports without a value are free.

    Parameters
    ----------
    device, p
        The device and its parameters.
    u
        Inputs with a value, by name; other summing ports are 0.
    given
        Outputs with a value, by name.
    """
    fields = device.Input._fields
    markers = {n: [m for m in device.Input.__annotations__[n].__metadata__ if isinstance(m, Port)] for n in fields}
    u = {n: 0.0 for n in fields if markers[n] and markers[n][0].summing} | u
    free = [n for n in fields if n not in u]
    nx = len(device.State._fields)

    def equations(z):
        rates, out = evaluate(device, p, z[:nx], u | dict(zip(free, z[nx:], strict=True)), v)
        held = [out[device.Output._fields.index(n)] - value for n, value in given.items()]
        return np.array([*rates, *held])

    known = {"V": 1.0 + 0j, "I": 1.0 + 0j, "p": p}
    start = list(device.evaluate("guess", known)) if device.has("guess") else [1.0] * nx
    z = np.array([*start, *(1.0 for _ in free)])
    for _ in range(50):
        f = equations(z)
        if np.abs(f).max() < 1e-9:
            break
        z = z - np.linalg.lstsq(slopes(equations, z.astype(complex)), f, rcond=None)[0]
    assert np.abs(equations(z)).max() < 1e-8
    return z[:nx], u | dict(zip(free, z[nx:].tolist(), strict=True))


def response(device, p, x, u, inputs, output, v=(1.0, 0.0)):
    """Frequency response (inputs, W) of an output to inputs, of the device linearized at x and u."""
    nx, names = len(x), list(u)
    at = np.array([*x, *(u[n] for n in names)], complex)

    def both(z):
        return np.concatenate(evaluate(device, p, z[:nx], dict(zip(names, z[nx:], strict=True)), v))

    J, row = slopes(both, at), nx + device.Output._fields.index(output)
    A, C = J[:nx, :nx], J[row, :nx]
    columns = [nx + names.index(n) for n in inputs]
    out = [C @ np.linalg.solve(1j * w * np.eye(nx) - A, J[:nx, columns]) + J[row, columns] for w in W]
    return np.array(out).T


def distance(found, diagrams):
    """Largest difference of responses (inputs, W) from block diagrams, relative to the largest response of each."""
    wanted = np.array([(one() * d).frdata[0, 0] for d in diagrams])
    return (np.abs(found - wanted) / np.abs(wanted).max(axis=1, keepdims=True)).max()


def motion(device, p, x, u, until, v=(1.0, 0.0)):
    """States and outputs (times, ...) every 2.5 ms as the inputs u(t) move: Heun's method with the limits of LIMITS."""
    x, out, step = np.array(x, float), [], 2.5e-3

    def held(x, u):
        x = x.copy()
        for name, (low, high, *per) in device.limits.items():
            scale = u[per[0]] if per else 1.0
            k = device.State._fields.index(name)
            edges = [limit if isinstance(limit, float) else getattr(p, limit) for limit in (low, high)]
            x[k] = np.clip(x[k], edges[0] * scale, edges[1] * scale)
        return x

    for t in np.arange(0.0, until, step):
        now, then = u(t), u(t + step)
        first, y = evaluate(device, p, x, now, v)
        out.append([*x, *y])
        second, _ = evaluate(device, p, held(x + step * first, then), then, v)
        x = held(x + step / 2 * (first + second), then)
    return np.array(out)
