"""Modes without and with stabilizers tuned together."""

import stabctl as st

base = st.load("two_area_thyristor").initialize()
st.design.pss(base).plot()
