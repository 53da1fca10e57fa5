"""A custom storage control law: proportional to the speed deviation, idle at low voltage."""

import stabctl as st


def damper(seen):
    return 500 * seen["deviation"] * (seen.actual("voltage") > 0.8)  # ratings, positive when absorbing


base = st.load("two_area").initialize(storage="50MW")
fault = st.Contingency("7-8@0.4", clear="21cyc")
reads = "deviation, voltage:5, voltage:6, voltage:11, voltage:10"  # voltages at the devices
law = st.Controller.from_function(damper, reads, "order", rate=60)
print(base.simulate(fault, control=law))
print(base.clearing_time(fault, control=law))
