"""Critical clearing time with estimated speeds, against the latency and the noise of the PMU signals."""

from dataclasses import replace
from pathlib import Path

import stabctl as st
from reproduction.study import Study, draw, present
from stabctl.view.figures import clearing

FULL = True
SYSTEMS = {
    "two_area": (st.Contingency("7", trip="7-8"), "50MW"),
    "wnaps": (st.Contingency("83", trip="83-33"), "5%mva"),
}
LATENCIES = 0, 25, 50, 75, 100, 150, 200  # ms
NOISES = 0.5, 2, 5, 10, 20  # mrad, and per mille of the magnitude
CONTROL = st.EstimatorControl()


def study(reports: Path) -> Study:
    """Two curves for each system, with the clearing times with true speeds."""
    ideal, late, noisy = {}, {}, {}
    for name, (fault, storage) in SYSTEMS.items():
        base = st.load(name).initialize(storage)

        def cycles(pmu: st.Pmu, base: st.OperatingPoint = base, fault: st.Contingency = fault) -> float:
            return base.clearing_time(fault, control=replace(CONTROL, pmu=pmu)).cycles

        ideal[name] = base.clearing_time(fault, control=st.BangBang()).cycles
        late[name] = [cycles(st.Pmu(latency=1e-3 * ms)) for ms in LATENCIES]
        noisy[name] = [cycles(st.Pmu(angle=1e-3 * noise, magnitude=1e-3 * noise)) for noise in NOISES]
    sweeps = {"latency of remote signals (ms)": (LATENCIES, late), "phasor noise (mrad and per mille)": (NOISES, noisy)}
    picture = draw(
        clearing.panels(sweeps, ideal),
        reports / "estimator_clearing.png",
        "Clearing time against latency and noise",
        alt="Clearing time against latency and against noise, two systems: constant at first, then lower.",
    )
    return Study("The cost of latency and noise", pictures=(picture,))


if __name__ == "__main__":
    present(study)
