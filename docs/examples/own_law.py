"""A custom storage control law: proportional to the speed deviation, idle at low voltage."""

import stabctl as st


def damper(seen):
    return 500 * seen.deviation * (seen.voltage > 0.8)  # ratings, positive when absorbing


base = st.load("two_area").initialize(storage="50MW")
fault = st.Contingency("7-8@0.4", clear="21cyc")
print(base.simulate(fault, control=st.Controller(damper, rate=60)))
print(base.clearing_time(fault, control=st.Controller(damper, rate=60)))
