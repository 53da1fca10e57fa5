"""Speeds estimated from noisy phasors by a Kalman filter, and the commands that follow from them."""

import stabctl as st

base = st.load("two_area").initialize(storage="50MW")
fault = st.Contingency("7", trip="7-8", clear="11cyc")
base.estimate(fault, "4s", control=st.EstimatorControl(st.BangBang())).plot()
