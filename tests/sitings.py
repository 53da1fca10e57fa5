"""Contingencies of ieee39 with classical machines, and small siting studies of it."""

from stabctl.placement.place import place
from stabctl.simulation.contingency import Contingency

CANDIDATES = ((1, 39), (6, 22), (9, 29))
NEAR_9 = Contingency("29", 4.75 / 60, "26-29")
NEAR_6 = Contingency("22", 9.5 / 60, "21-22")
AT_16 = Contingency("16", 10.625 / 60, "16-21")
AT_10 = Contingency("10", 14.125 / 60, "10-13")
HOPELESS = Contingency("29", 30 / 60, "26-29")
EASY = Contingency("29", 3 / 60, "26-29")


def study(case, *contingencies, candidates=CANDIDATES, **options):
    return place(case, contingencies, **{"candidates": candidates, "observe": 2.0} | options)
