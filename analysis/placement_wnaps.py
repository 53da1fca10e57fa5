"""Where storage belongs in the reduced Western system, for 20 % longer clearing times."""

from pathlib import Path

from placement import Task, sitings

from reproduction.study import Study, present

FULL = True
TEXT = (
    "Eight contingencies from the screen of all line faults. Each must be stable at a clearing time 20 % longer than "
    "its critical clearing time without storage."
)


def study(reports: Path) -> Study:
    """The optimized fleet, also with a Kalman filter."""
    task = Task("wnaps", "eight", case="wnaps", classical=False, contingencies=8, estimated=True)
    return sitings("Placement of storage, Western system", TEXT, (task,), reports)


if __name__ == "__main__":
    present(study)
