"""A recorded interactive page, to be tried on the front page of the documentation without an installation."""

import stabctl as st
from stabctl.view.live import page
from stabctl.view.live.commands import Source
from stabctl.view.live.state import Points, State

CASE, FAULT = "two_area", State("7-8@0.4", clear=21.0)
PERCENTS = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)  # MVA   of every machine, of its storage


def html() -> str:
    """The page: a fault in the two-area system, over its clearing time and the storage of every machine."""
    load = Source(f"st.load({CASE!r})", (CASE,))
    return page.saved(page.recording(Points(st.load(CASE)), FAULT, load, {}, PERCENTS))
