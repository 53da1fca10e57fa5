"""A study of siting that needs storage: its figures, and its page."""

from described import drawn
from recordings.studies import GIVEN, recorded, words_of

import stabctl as st
from stabctl.view.figures import one_line, siting
from stabctl.view.pages import siting_page


@recorded("sites that are needed", slow=True, loose=1e-2)
def _():
    base = st.load("two_area").classical().initialize()
    wanted = [
        st.Contingency("7-8@0.4", clear="17.5cyc", name="first"),
        st.Contingency("9", clear="18.5cyc", trip="8-9", name="second"),
    ]
    found = st.place(base, wanted, candidates=GIVEN / "sites.csv", observe="2s", outages=False)
    return {
        "sites": [[s.machine, s.bus] for s in found.sites],
        "cost": drawn(siting.convergence(found)),
        "page": words_of(siting_page.page(found, base).html()),
        "marks": [len(c.get_offsets()) for c in one_line.plot(base, found).collections],
    }
