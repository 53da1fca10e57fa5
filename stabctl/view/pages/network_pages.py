"""The pages of the network and its data: power flow, short-circuit power, weak grids, import."""

from collections.abc import Iterator

import numpy as np

from stabctl.io.import_report import HEAD, ImportReport, about, checks, completeness, corrections, unsupported
from stabctl.model.powerflow import PowerFlow
from stabctl.model.short_circuit import ShortCircuit
from stabctl.smallsignal.weak_grid import WeakGrid

from ..figures import grid_strength, one_line
from .pattern import Page, Part, Section, Text, figure, table

MOST = 500  # buses of a one-line diagram
BUSES = "bus", "voltage (pu)", "angle (deg)", "generated (MW)", "(Mvar)", "load (MW)", "(Mvar)"
BRANCHES = "circuit", "from", "to", "in at from (MW)", "(Mvar)", "in at to (MW)", "(Mvar)", "losses (MW)"


def power_flow(flow: PowerFlow) -> Page:
    """Return the page of a power flow."""
    case, buses, branches = flow.case, flow.df, flow.branches
    low = int(np.abs(flow.V).argmin())
    drawn: list[Part] = []
    if len(case.buses) <= MOST:
        text = "Voltages as colors of the buses; lines are as wide as the power that they carry."
        drawn.append(figure(one_line.plot(case), "One-line diagram.", text))
    digits = 5, 3, 2, 2, 2, 2
    rows = [(str(bus), *_cells(values, digits)) for bus, *values in buses.itertuples()]
    return Page(
        f"{case.name}_powerflow",
        f"Power flow of {case.name}",
        [*([case.title] if case.title else []), f"{flow}."],
        [
            (f"{buses['p_gen_mw'].sum():.1f}", "MW generated"),
            (f"{buses['p_load_mw'].sum():.1f}", "MW of load"),
            (f"{branches['loss_mw'].sum():.1f}", "MW lost in branches"),
            (f"{abs(flow.V[low]):.3f}", f"pu, the lowest voltage (bus {case.buses[low].bus})"),
        ],
        [
            Section("", drawn),
            Section("Buses", [table(BUSES, rows)]),
            Section("Branches", [table(BRANCHES, _branches(branches.itertuples()))]),
        ],
    )


def _branches(rows: object) -> Iterator[tuple[str, ...]]:
    for name, from_bus, to_bus, *powers in rows:  # type: ignore[attr-defined]
        yield str(name), str(from_bus), str(to_bus), *(f"{p:.2f}" for p in powers)


def _cells(values: list[float], digits: tuple[int, ...]) -> Iterator[str]:
    """Voltage and angle, and powers that are not zero."""
    for k, (value, places) in enumerate(zip(values, digits, strict=True)):
        yield f"{value:.{places}f}" if k < 2 or value else ""


def short_circuit(found: ShortCircuit) -> Page:
    """Return the page of short-circuit powers."""
    weakest = int(np.argmin(found.mva))
    rows = [(str(b.bus), f"{mva:.1f}") for b, mva in zip(found.case.buses, found.mva, strict=True)]
    return Page(
        f"{found.case.name}_scr",
        f"Short-circuit power of {found.case.name}",
        [f"{found}"],
        [(f"{found.mva[weakest]:.0f}", f"MVA at bus {found.case.buses[weakest].bus}, the weakest")],
        [
            Section("", [figure(grid_strength.plot_short_circuit(found), "The weakest buses.")]),
            Section("Buses", [table(("bus", "short-circuit power (MVA)"), rows)]),
        ],
    )


def weak_grid(found: WeakGrid) -> Page:
    """Return the page of a converter at grids of different strength."""
    boundary = [
        (f"{k:.4g}", "none" if np.isnan(s) else "all" if s == 0 else f"{s:.3f}")
        for k, s in zip(found.gain, found.boundary, strict=True)
    ]
    share = f"{int(found.stable.sum())} of {found.stable.size}"
    return Page(
        f"{found.name}_weak-grid",
        f"{found.name} in weak grids",
        [f"{found}."],
        [(share, "points are stable"), (f"{found.scr[0]:g} to {found.scr[-1]:g}", "short-circuit ratio")],
        [
            Section(
                "",
                [
                    figure(
                        grid_strength.plot_weak_grid(found),
                        "Least damping ratio",
                        "over the gain of the phase-locked loop and the short-circuit ratio. Red: a mode grows. Gray: "
                        "no operating point. Line: the boundary of stability.",
                    )
                ],
            ),
            Section(
                "Boundary",
                [
                    table(
                        ("gain (rad/s per pu)", "stable above the short-circuit ratio"),
                        boundary,
                        "None: unstable with the largest ratio of the map. All: stable with all of its ratios.",
                    )
                ],
            ),
        ],
    )


def imported(found: ImportReport) -> Page:
    """Return the page of an import."""
    names = " and ".join(path.name for path in found.files)
    kinds = [(k.kind, k.role, str(k.records), str(k.supported), f"{k.mva:.0f}" if k.mva else "") for k in found.kinds]
    records = [(f"{found.supported} of {found.records}", "records of dynamic models are represented")]
    size = [(str(len(found.case.buses)), "buses"), (str(len(found.case.machines)), "machines")]
    return Page(
        f"{found.case.name}_import",
        f"Import of {names}",
        [*(f"{one}." for one in about(found)), *completeness(found), *found.failures],
        [*(records if found.kinds else []), *size],
        [
            Section("Checks", [table(("check", "result"), checks(found))]),
            Section("Not supported", [Text(one) for one in unsupported(found)]),
            Section("Unusual data", [Text(one) for one in found.unusual.sentences()]),
            Section("Without effect on the power flow", [Text(one) for one in found.idle]),
            Section("Corrections", [Text(one) for one in corrections(found)]),
            Section("Dynamic models", [table(HEAD, kinds)] if kinds else []),
        ],
    )
