"""Eigenvalues of the Western system, with lines of constant damping ratio."""

import stabctl as st

st.load("wnaps").modes(band="0.1..2Hz").plot()
