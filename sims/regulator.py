"""Storage under a linear-quadratic regulator: clearing times against its weights, with true and estimated signals."""

from pathlib import Path

import stabctl as st
from reproduction.study import Study, Table, present

FULL = True
FAULT, STORAGE = st.Contingency("83", trip="83-33"), "5%mva"
BANG_BANG = {
    "bang-bang": st.BangBang(),
    "bang-bang, 10 mHz, at any voltage": st.BangBang(deadband=0.01, min_voltage=0.0),
}
WEIGHTS = (  # speed, and angle if it is weighed
    ("300mHz", None), ("100mHz", None), ("30mHz", None), ("10mHz", None), ("3mHz", None), ("1mHz", None),
    ("100mHz", "10deg"), ("100mHz", "3deg"), ("100mHz", "1deg"), ("10mHz", "1deg"), ("3mHz", "1deg"),
)  # fmt: skip
HEADS = ("control", "true signals (cycles)", "behind PMUs (cycles)", "damping ratio", "delay withstood (ms)")
TEXT = (
    "Fault at bus 83 of wnaps, cleared by opening 83-33, with storage of 5 % of the MVA of every machine. The "
    "regulators read angles and speeds; orders are limited to the ratings. Behind PMUs the signals are estimates of "
    "Kalman filters, from 60 reports per second with 2 mrad of noise, 2 % of them lost, and those of other machines "
    "50 ms late."
)


def study(reports: Path) -> Study:
    """Clearing times without control, under bang-bang control, and under regulators with several weights."""
    base = st.load("wnaps").initialize(STORAGE)

    def cycles(control: st.Controller | st.BangBang | st.EstimatorControl | None) -> str:
        return f"{base.clearing_time(FAULT, control=control, scan=0).cycles:g}"

    rows = [("none", cycles(None), "", "", "")]
    for name, law in BANG_BANG.items():
        rows.append((name, cycles(law), cycles(st.EstimatorControl(law)), "", ""))
    for speed, angle in WEIGHTS:
        found = st.design.lqr(base, inputs="angle, speed", speed=speed, angle=angle)
        behind = st.EstimatorControl(found.controller)
        late = f"{1e3 * found.own.delay_s:.0f}" if found.own else ""
        name = f"LQR, {speed}" + (f" and {angle}" if angle else "")
        rows.append((name, cycles(found.controller), cycles(behind), f"{found.worst_after:.3f}", late))
    table = Table("Critical clearing times under bang-bang control and regulators", HEADS, tuple(rows))
    return Study("Storage under a regulator", text=(TEXT,), tables=(table,))


if __name__ == "__main__":
    present(study)
