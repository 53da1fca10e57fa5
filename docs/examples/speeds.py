"""Speeds after a fault with and without storage, and the table of the most critical line faults."""

import matplotlib.pyplot as plt

import stabctl as st

base = st.load("two_area").initialize()
fault = st.Contingency("7-8@0.4", clear="21cyc")
_, axes = plt.subplots(1, 2, figsize=(10, 4), sharey=True)
base.simulate(fault).plot("speed", ax=axes[0])
base.simulate(fault, storage="50MW", control=st.BangBang()).plot("speed", ax=axes[1])
plt.savefig("speeds.png")
print(base.screen(below="12cyc").df)
