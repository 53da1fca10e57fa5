"""Speeds, angles, voltages and powers of one run."""

import stabctl as st
from stabctl.view.figures import trajectory

base = st.load("two_area").initialize(storage="50MW")
run = base.simulate(st.Contingency("7-8@0.4", clear="21cyc"), control=st.BangBang())
trajectory.overview(run)
