"""Modes of a simulated ring-down: matrix pencil of several channels (Y. Hua, T. Sarkar, IEEE Trans. ASSP 38, 1990)."""

import numpy as np

import stabctl as st

RATE = 60  # samples per second


def pencil(Y, dt, rank=40):
    """Poles (1/s) of the rows of Y (channels, samples)."""
    width = Y.shape[1] // 2
    H = np.vstack([np.lib.stride_tricks.sliding_window_view(y, width + 1) for y in Y])
    _, sizes, V = np.linalg.svd(H, full_matrices=False)
    V = V[: min(rank, int((sizes > 1e-11 * sizes[0]).sum()))].T
    return np.log(np.linalg.eigvals(np.linalg.pinv(V[:-1]) @ V[1:]).astype(complex)) / dt


def ringdown(base, control, *, bus, mw=1.0, begin=0.6, seconds=10.0, step=None):
    """Poles of the speeds relative to the first after a load pulse of 0.4 s at a bus, and the run."""
    events = [st.LoadStep(bus, "0.1s", p=mw), st.LoadStep(bus, "0.5s", p=-mw)]
    run = base.simulate(events, begin + seconds + 0.5, control=control, step=step)
    frames = np.abs(run.time * RATE - np.round(run.time * RATE)) < 1e-6
    window = frames & (run.time >= begin - 1e-9) & (run.time < begin + seconds - 1e-9)
    speed = run.speed.values[window]
    Y = (speed[:, 1:] - speed[:, :1]).T
    return pencil(Y[:, ::3], 3 / RATE), run


def errors(poles, wanted):
    """Relative errors of frequency and decay of the pole nearest to the wanted one (1/s)."""
    found = poles[np.abs(poles - wanted).argmin()]
    return abs(found.imag / wanted.imag - 1), abs(found.real / wanted.real - 1)


def modal_pole(base, *control, bus, mw=1.0, begin=0.6, seconds=5.0):
    """Eigenvalue of the least damped swing mode of a closed loop without sampling, and the same from a simulation.

    After a load pulse the modal coordinate w^H x, w the left vector, is exp(s t): also where many modes are near.
    """
    loop = base.closed_loop(*control)
    modes = loop.modes()
    k = min(modes.swings(), key=lambda k: modes.damping_ratio[k])
    events = [st.LoadStep(bus, "0.1s", p=mw), st.LoadStep(bus, "0.5s", p=-mw)]
    run = base.simulate(events, begin + seconds, control=list(control))
    labels = [p.label for p in run.point.layout.states]
    x = run.rows[:, [labels.index(name) for name in loop.states]]
    z = (x - x[0]) @ modes.left[:, k].conj()
    t = run.time
    window = t >= begin
    phase = np.log(np.abs(z[window])) + 1j * np.unwrap(np.angle(z[window]))
    return modes.eigenvalues[k], np.polyfit(t[window], phase, 1)[0]
