"""Trajectories of PSS/E beside ours, from the same files, over their whole length.

What is allowed is `psse_replay.LIMITS`: 0.05 degrees, 2e-5 pu of speed, 2e-4 pu of voltage, 2e-3 pu of field voltage.
"""

import psse_replay
import pytest

RUNS = [  # row of cases.csv, largest differences measured
    ("GENROU", {"angle 102/1": 3.9e-3}),
    ("GENROU_NO_SAT", {"angle 102/1": 4.0e-3}),
    ("GENROU_HIGH_SAT", {"angle 102/1": 3.4e-3}),
    ("GENROE", {"angle 102/1": 4.6e-3}),
    ("GENSAL", {"angle 102/1": 1.6e-3}),
    ("ZIP_CONST_P", {"v 102": 6.7e-5, "bus_angle 102": 4.3e-3, "v 103": 3.7e-5, "bus_angle 103": 2.2e-3}),
    ("ZIP_CONST_I", {"v 102": 5.5e-5, "bus_angle 102": 3.9e-3, "v 103": 2.9e-5, "bus_angle 103": 1.9e-3}),
]


@pytest.mark.parametrize(("name", "measured"), RUNS)
def test_trajectory_of_psse(name, measured):
    found = psse_replay.differences(name)
    assert set(found) == set(measured)
    for signal, value in found.items():
        assert value <= min(psse_replay.limit(signal), 1.5 * measured[signal]), signal
