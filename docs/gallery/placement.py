"""A fleet of storage that survives a line fault, beside the uniform one."""

import stabctl as st

base = st.load("two_area").initialize()
st.place(base, [st.Contingency("7", trip="7-8", clear="12cyc")]).plot()
