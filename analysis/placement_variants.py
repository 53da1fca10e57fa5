"""Where storage belongs on the classical 39-bus system when less is asked, or fewer sites are allowed."""

from pathlib import Path

from placement import TEXT, Asked, sitings

from reproduction.console import present
from reproduction.study import Study

FULL = True


def study(reports: Path) -> Study:
    """Six of the nine contingencies; all nine, with at most three and at most two sites, and under a Kalman filter."""
    asked = (
        Asked("ieee39_classical_six", "classical, six", contingencies=6),
        Asked("ieee39_classical_three_sites", "classical, nine, at most 3 sites", sites=3, estimated=True),
        Asked("ieee39_classical_two_sites", "classical, nine, at most 2 sites", sites=2),
    )
    return sitings("Placement of storage, variants", TEXT, asked, reports)


if __name__ == "__main__":
    present(study)
