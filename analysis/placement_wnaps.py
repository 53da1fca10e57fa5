"""Where storage belongs on the reduced Western system: eight contingencies, each survived 20 % longer."""

from pathlib import Path

from placement import Asked, sitings

from reproduction.console import present
from reproduction.study import Study

FULL = True
TEXT = (
    "Eight contingencies that storage can cure, from the screen of all line faults, each to be survived at a clearing "
    "time 20 % above that without storage.",
)


def study(reports: Path) -> Study:
    """The fleet found beside the uniform fleet, and under a Kalman filter; its page."""
    asked = Asked("wnaps", "eight", case="wnaps", classical=False, contingencies=8, estimated=True)
    return sitings("Placement of storage, Western system", TEXT, (asked,), reports)


if __name__ == "__main__":
    present(study)
