"""A lead compensator from speed to voltage reference, designed with python-control on the linear model."""

import control

import stabctl as st

base = st.load("two_area_thyristor").initialize()
plant = base.linearize(inputs="vref:2", outputs="speed:2").to_control()
washout = control.tf([10, 0], [10, 1])
lead = control.tf([0.05, 1], [0.02, 1]) * control.tf([3, 1], [5.4, 1])
for gain in (0, 10, 20):
    loop = control.feedback(plant, gain * washout * lead, sign=1)
    swing = min((p for p in loop.poles() if 2 < p.imag < 6), key=lambda p: -p.real / abs(p))
    print(f"gain {gain}: {swing:.3f} 1/s, damping ratio {-swing.real / abs(swing):.3f}")
