"""Speeds after a fault, without and with storage at every machine."""

import stabctl as st
from stabctl.view.figures import style

base = st.load("two_area").initialize()
fault = st.Contingency("7-8@0.4", clear="21cyc")
figure, axes = style.subplots(9, 3.2, 1, 2, sharey=True)
base.simulate(fault).plot("speed", ax=axes[0, 0])
base.simulate(fault, storage="50MW", control=st.BangBang()).plot("speed", ax=axes[0, 1])
axes[0, 0].set_title("without storage")
axes[0, 1].set_title("with 50 MW at every machine")
