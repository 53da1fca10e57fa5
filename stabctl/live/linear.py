"""Modes for the page, with one kind of parameter of all machines multiplied by a factor."""

from dataclasses import replace
from typing import Any

import numpy as np

from stabctl.dynamics import operating_point
from stabctl.errors import StudyError
from stabctl.model import catalog
from stabctl.model.case import Case
from stabctl.schema import fields
from stabctl.smallsignal import areas
from stabctl.smallsignal.analysis import modes

ROLES = "stabilizer", "exciter", "governor"


def gains(case: Case) -> list[str]:
    """Gains of the controls of a case, as `pss.K`: parameters whose names begin with K."""
    tables = [model for model in catalog.of_role(*ROLES) if case.devices.get(model)]
    return [f"{model}.{name}" for model in tables for name in fields(catalog.models()[model].Par) if name[0] == "K"]


def scaled(case: Case, gain: str, factor: float) -> Case:
    """The case with a gain of all machines multiplied."""
    if factor == 1 or not gain:
        return case
    if gain not in gains(case):
        raise StudyError(f"{case.name} has no gain {gain!r}; choose one of {', '.join(gains(case))}.")
    model, name = gain.split(".")
    rows = {k: par._replace(**{name: factor * getattr(par, name)}) for k, par in case.devices[model].items()}
    return replace(case, devices={**case.devices, model: rows})


def answer(case: Case, gain: str, factor: float) -> dict[str, Any]:
    """Eigenvalues of the upper half plane, with name, damping, participation and mode shape."""
    found = modes(operating_point.solve(scaled(case, gain, factor)))
    upper = [int(k) for k in np.flatnonzero(found.eigenvalues.imag >= 0)]
    swings = found.swings()
    rows = {m: i for i, m in enumerate(m.called for m in case.machines)}
    shown = []
    for k in upper:
        mode = found.mode(k)
        shape = [[rows[p.machine], p.magnitude, p.angle_deg] for p in mode.shape if p.magnitude > 0.02]
        s = mode.eigenvalue
        shares = [[p.state, p.share] for p in mode.participation if p.share > 0.01]
        shown.append([s.real, s.imag / (2 * np.pi), mode.damping_ratio, k in swings, mode.label, shares, shape])
    groups = areas(found).groups if swings else ()
    return {
        "modes": shown,
        "areas": [[rows[m] for m in group] for group in groups],
        "text": str(found),
        "gain": gain,
        "factor": factor,
    }
