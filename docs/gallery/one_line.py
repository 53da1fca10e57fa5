"""One-line diagram: voltages as colors, loading as width."""

import stabctl as st

st.load("ieee39").plot()
