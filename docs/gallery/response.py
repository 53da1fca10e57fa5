"""Frequency response of a linear model, from voltage references to a speed."""

import stabctl as st

base = st.load("two_area_thyristor").initialize()
base.linearize(inputs="vref:1, vref:2", outputs="speed:1").plot()
