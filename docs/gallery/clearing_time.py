"""How long runs last, by the duration of the fault: the search for a critical clearing time."""

import stabctl as st

base = st.load("two_area").initialize()
base.clearing_time(st.Contingency("7-8@0.4")).plot()
