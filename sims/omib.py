"""Sections 2 and 3 on one machine: phase plane, equal area, a lost fault in time, and the four feedback laws."""

import sys
from pathlib import Path

from stabctl.report.swing_figures import fault_in_time, feedback, phase_plane, power_angle, save
from stabctl.swing.equal_area import critical, equal_area, simulated_critical_time
from stabctl.swing.feedback import compare
from stabctl.swing.omib import OMIB, during_fault
from stabctl.swing.phase import portrait
from stabctl.swing.trajectory import simulate

m = OMIB()
reports = Path(sys.argv[1] if len(sys.argv) > 1 else "reports")
reports.mkdir(exist_ok=True)

# Figure 3 and Table 1: the 15-cycle fault leaves the stability region.
faults = portrait(m)
print(faults)
save(phase_plane(faults), reports / "figure03_phase_plane.png")

# Figure 4: a fault that is survived, and the longest one.
longest = critical(m)
print(longest, f"; simulated {simulated_critical_time(m):.6f} s")
save(power_angle(equal_area(m, during_fault(m, m.seconds(12))[0])), reports / "figure04_equal_area.png")

# Figure 5: after 15 cycles there is too little decelerating area.
clearing = m.seconds(15)
lost = equal_area(m, during_fault(m, clearing)[0])
print(lost)
save(fault_in_time(lost, simulate(m, clearing, until=0.8)), reports / "figure05_lost.png")

# Figure 7: all four laws save that fault.
laws = compare(m)
print(laws)
second, third = (r.max_speed - r.min_speed for r in laws.responses[1:3])
print(f"The third law swings {third:.2f} rad/s wide, the second {second:.2f}; the text has the third narrower.")
save(feedback(laws), reports / "figure07_feedback.png")
