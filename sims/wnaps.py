"""The paper's Case 2 (Figures 17 to 19, Table 4): fault at bus 83 of the reduced Western system, line 83-33 opened."""

from pathlib import Path

from rich.console import Console
from rich.table import Table

from stabctl import equilibrium, fleet, powerflow, read
from stabctl.clearing import clearing_time
from stabctl.controllers import BangBang
from stabctl.report import clearing, trajectories
from stabctl.simulate.events import contingency
from stabctl.simulate.simulation import run

REPORTS = Path("reports")
FAULT, TRIP = "83", ("83-33",)
SHOWN = (1, 8, 13, 14, 16, 27, 34)
PERCENT, PAPER = (0, 5, 15, 20, 25, 30), (0, 20, 40, 60, 60, 60)


def main() -> None:
    """Simulate, print Table 4 in both readings, draw."""
    REPORTS.mkdir(exist_ok=True)
    console = Console(highlight=False)
    case = read.load("wnaps")
    events = contingency(FAULT, 6 / case.frequency_hz, TRIP)
    bare = run(equilibrium.solve(case), events)
    held = run(equilibrium.solve(case.with_storage(fleet.everywhere(case, "5%mva"))), events, control=BangBang())
    console.print(f"six cycles, no storage: {bare.outcome}")
    console.print(f"six cycles, 5 % of MVA: {held.outcome}")
    active = [name for name, p in zip(held.devices(), held.storage.T, strict=True) if abs(p).max() > 0]
    console.print(f"devices that act: {', '.join(active)}")

    rows = table_4()
    table = Table("ESD power, % of dispatch", "paper, gain %", "whole cycles", "gain %", "1/8 cycle", "gain %")
    for percent, gain, whole, fine in zip(PERCENT, PAPER, rows["whole cycles"], rows["1/8 cycle"], strict=True):
        gains = (
            f"{100 * (now / base[0] - 1):.0f}"
            for now, base in ((whole, rows["whole cycles"]), (fine, rows["1/8 cycle"]))
        )
        first, second = gains
        table.add_row(str(percent), str(gain), f"{whole:g}", first, f"{fine:g}", second)
    console.print(table)
    console.print("Machine 14 goes first and machine 13 stays in step; the paper has both lose synchronism.")

    figures = {
        "wnaps.png": trajectories.speeds({"without storage": bare, "with 5 % ESDs": held}, SHOWN),
        "wnaps_storage.png": trajectories.storage(held, (13, 14)),
        "wnaps_table4.png": clearing.against_size(PERCENT, rows, "ESD power, % of dispatched power"),
    }
    for name, figure in figures.items():
        figure.savefig(REPORTS / name, dpi=130)
        console.print(f"wrote {REPORTS / name}")


def table_4() -> dict[str, list[float]]:
    """Critical clearing times (cycles) by ESD power, on whole cycles as the paper took them and on eighths."""
    case = read.load("wnaps_paper")
    flow = powerflow.solve(case)
    rows: dict[str, list[float]] = {"whole cycles": [], "1/8 cycle": []}
    for percent in PERCENT:
        devices = fleet.everywhere(case, f"{percent}%dispatch", flow, characteristic="conductance", lag=0.05)
        point = equilibrium.solve(case.with_storage(devices), flow)
        for name, resolution in (("whole cycles", 1.0), ("1/8 cycle", 0.125)):
            rows[name].append(clearing_time(point, FAULT, TRIP, BangBang(), resolution).cycles)
    return rows


if __name__ == "__main__":
    main()
