"""Short-circuit power of the buses."""

import stabctl as st

st.load("ieee39").short_circuit().plot()
