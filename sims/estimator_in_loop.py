"""How much of the ideal controller's clearing time survives noisy, late and missing PMU signals."""

from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.table import Table

from stabctl import compiled, equilibrium, fleet, read
from stabctl.clearing import clearing_time
from stabctl.controllers import BangBang
from stabctl.equilibrium import Point
from stabctl.estimate.loop import Driven, watch
from stabctl.estimate.pmu import Pmu
from stabctl.report import estimates
from stabctl.simulate.events import contingency

REPORTS = Path("reports")
STUDIES = {  # case, fault, circuit opened, classical machines, storage
    "ieee39, classical": ("ieee39", "16", "16-17", True, "5%mva"),
    "two_area, classical": ("two_area", "7", "7-8", True, "50MW"),
    "two_area": ("two_area", "7", "7-8", False, "50MW"),
    "wnaps": ("wnaps", "83", "83-33", False, "5%mva"),
}
CURVES = ("two_area", "wnaps")
LATENCIES, NOISES = (0, 25, 50, 75, 100, 150, 200), (0.5, 2, 5, 10, 20)
SEEDS, DRIVEN = range(1, 6), Driven(engine="batched")


def start(case: str, classical: bool, storage: str) -> Point:
    """The operating point with a storage device at every machine."""
    loaded = read.load(case)
    loaded = loaded.classical() if classical else loaded
    return equilibrium.solve(loaded.with_storage(fleet.everywhere(loaded, storage)))


def main() -> None:
    """Estimate, search, print, draw."""
    REPORTS.mkdir(exist_ok=True)
    console = Console(highlight=False, width=120)
    compiled.announce()
    points = {name: start(case, classical, size) for name, (case, _, _, classical, size) in STUDIES.items()}
    table = Table("", "clearing, cycles", "RMSE, mHz", "99 %, mHz", "delay, ms", "wrong, %", "opposite, %")
    ideal, drawn = {}, {}
    for name, (_, fault, trip, _, _) in STUDIES.items():
        ideal[name] = clearing_time(points[name], fault, [trip], BangBang()).cycles
        table.add_row(name, f"{ideal[name]:g}", "", "", "", "", "")
        clear = int(0.9 * ideal[name]) / points[name].case.frequency_hz
        for kind in ("frequency", "kinematic", "kalman"):
            driven = replace(DRIVEN, kind=kind)
            cycles = clearing_time(points[name], fault, [trip], driven).cycles
            found = watch(points[name], contingency(fault, clear, [trip]), clear + 6, driven, SEEDS)
            s = found.after(1 + clear, clear + 6)
            numbers = (s.rmse_mhz, s.p99_mhz, s.delay_ms, 1e2 * s.wrong_command_share, 1e2 * s.opposite_command_share)
            table.add_row(
                f"  {kind}", f"{cycles:g}", *(f"{n:.1f}" for n in numbers[:3]), *(f"{n:.2f}" for n in numbers[3:])
            )
        drawn[name] = found
    console.print(table)

    def cycles(name: str, pmu: Pmu) -> float:
        _, fault, trip, _, _ = STUDIES[name]
        return clearing_time(points[name], fault, [trip], replace(DRIVEN, pmu=pmu)).cycles

    late = {name: [cycles(name, Pmu(latency_ms=ms)) for ms in LATENCIES] for name in CURVES}
    noisy = {name: [cycles(name, Pmu(angle_mrad=a, magnitude=1e-3 * a)) for a in NOISES] for name in CURVES}
    panels = {"latency of remote signals, ms": (LATENCIES, late), "phasor noise, mrad and per mille": (NOISES, noisy)}
    figures = {
        "estimator_speeds.png": estimates.speeds(drawn["two_area"]),
        "estimator_commands.png": estimates.commands(drawn["two_area"]),
        "estimator_clearing.png": estimates.clearing(panels, {name: ideal[name] for name in CURVES}),
    }
    for name, figure in figures.items():
        figure.savefig(REPORTS / name, dpi=130)
        console.print(f"wrote {REPORTS / name}")


if __name__ == "__main__":
    main()
