"""Where storage belongs in the classical 39-bus system with fewer contingencies, or at fewer sites."""

from pathlib import Path

from placement import TEXT, Task, sitings

from reproduction.study import Study, present

FULL = True


def study(reports: Path) -> Study:
    """Six of the nine contingencies; all nine at no more than three sites, and at no more than two."""
    tasks = (
        Task("ieee39_classical_six", "classical, six", contingencies=6),
        Task("ieee39_classical_three_sites", "classical, nine, at most 3 sites", sites=3, estimated=True),
        Task("ieee39_classical_two_sites", "classical, nine, at most 2 sites", sites=2),
    )
    return sitings("Placement of storage, variants", TEXT, tasks, reports)


if __name__ == "__main__":
    present(study)
