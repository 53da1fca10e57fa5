"""Effect of power system stabilizers and their gain on the modes of the two-area system."""

import stabctl as st

print(st.load("two_area_thyristor").modes(band="0.1..2Hz").df)  # without stabilizers
case = st.load("two_area_pss")
for gain in (10, 20, 40):
    tuned = case.set({f"pss.{machine}.K": gain for machine in (1, 2, 3, 4)})
    modes = tuned.modes(band="0.1..2Hz")
    print(gain, modes, modes.df, sep="\n")
