"""Loop gain of a relay with a deadband, and the limit cycles where it meets -1/N(A)."""

import control

import stabctl as st

base = st.load("two_area").initialize(storage="100MW")
sign = control.ss([], [], [], [[1.0]])
how = {"rate": 60, "delay": "200ms", "relay": True, "deadband": 2e-5, "limits": 1, "name": "relay"}
base.limit_cycles(st.Controller.from_control(sign, "deviation:1", "order:1@5", **how)).plot()
