"""Modes without and with stabilizers designed for 10 % damping."""

import stabctl as st

base = st.load("two_area_thyristor").initialize()
st.design.pss(base, damping=0.1).plot()
