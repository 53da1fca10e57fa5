"""Critical clearing times of line faults, on the lines."""

import stabctl as st

base = st.load("ieee39").classical().initialize()
base.plot(base.screen(below="12cyc"))
