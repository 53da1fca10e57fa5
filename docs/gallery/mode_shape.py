"""Shape of the slowest swing mode on the one-line diagram."""

import stabctl as st

base = st.load("ieee39").initialize()
modes = base.modes()
slowest = min(map(modes.mode, modes.swings()), key=lambda mode: mode.frequency_hz)
base.plot(slowest)
