"""Critical clearing time with estimated speeds against the latency of remote signals and the noise of the phasors."""

from dataclasses import replace
from pathlib import Path

from reproduction.console import present
from reproduction.study import Study, draw
from stabctl import io
from stabctl.clearing import clearing_time
from stabctl.controllers import BangBang
from stabctl.dynamics import operating_point
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.pmu import Pmu
from stabctl.model import fleet
from stabctl.plotting import clearing_time as figures
from stabctl.simulation.contingency import Contingency

FULL = True
STUDIES = {"two_area": ("7", "7-8", "50MW"), "wnaps": ("83", "83-33", "5%mva")}
LATENCIES, NOISES = (0, 25, 50, 75, 100, 150, 200), (0.5, 2, 5, 10, 20)
CONTROL = EstimatorControl(engine="batched")
ALT = "Clearing time against latency and against noise, two cases: level at first, then lower."


def study(reports: Path) -> Study:
    """Two curves for every case, with the clearing time by true speeds beside."""
    ideal, late, noisy = {}, {}, {}
    for name, (fault, trip, size) in STUDIES.items():
        case = io.load(name)
        one = Contingency(fault, trip=trip)
        point = operating_point.solve(case.with_storage(fleet.everywhere(case, size)))
        ideal[name] = clearing_time(point, one, control=BangBang()).cycles
        pmus = [Pmu(latency_ms=ms) for ms in LATENCIES], [Pmu(angle_mrad=a, magnitude=1e-3 * a) for a in NOISES]
        late[name], noisy[name] = (
            [clearing_time(point, one, control=replace(CONTROL, pmu=pmu)).cycles for pmu in group] for group in pmus
        )
    panels = {"latency of remote signals, ms": (LATENCIES, late), "phasor noise, mrad and per mille": (NOISES, noisy)}
    figure = figures.panels(panels, ideal)
    picture = draw(figure, reports / "estimator_clearing.png", "Clearing time against latency and noise", alt=ALT)
    return Study("What latency and noise cost", pictures=(picture,))


if __name__ == "__main__":
    present(study)
