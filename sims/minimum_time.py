"""Section 4 on two machines: equal area with absorbed power, and the control that stops the machine soonest."""

import sys
from pathlib import Path

from stabctl.controllers.minimum_time import by_collocation, by_shooting
from stabctl.controllers.minimum_time_convex import by_convex_programme
from stabctl.report.swing_figures import optimal_power, optimal_states, save, two_machine
from stabctl.swing.two_machine import Equivalent

pair = Equivalent()
reports = Path(sys.argv[1] if len(sys.argv) > 1 else "reports")
reports.mkdir(exist_ok=True)

# Figure 9: an eight-cycle fault is lost without the device and survived with it.
without, absorbing = pair.equal_area(8), pair.equal_area(8, Pc=0.5)
print(without, absorbing, sep="\n")
save(two_machine(without, absorbing), reports / "figure09_two_machine.png")

for power in (0.0, 0.1, 0.2, 0.3, 0.4, 0.5):
    print(f"P_C = {power:g} pu: {pair.critical(power)}")

# Figures 10 and 11: the six-cycle fault of Table 2, by three methods.
problem = pair.release(6)
control = by_shooting(problem)
print("shooting:   ", control)
print("collocation:", by_collocation(problem))
print("convex:     ", by_convex_programme(problem))
save(optimal_states(control), reports / "figure10_states.png")
save(optimal_power(control), reports / "figure11_power.png")
