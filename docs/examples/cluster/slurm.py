"""A screen on SLURM: starts a Dask scheduler here and workers as jobs, runs the screen, and ends them.

Run it where jobs may be submitted, in a session that lasts: python slurm.py CASE FOLDER [NUMBER OF JOBS].
"""

import subprocess
import sys

from dask_jobqueue import SLURMCluster


def cluster(host: str | None = None) -> SLURMCluster:
    """Jobs with 16 workers each, of one thread and 2 GB; the scheduler listens at `host`, everywhere by default."""
    return SLURMCluster(
        cores=16,
        processes=16,
        memory="32GB",
        walltime="04:00:00",
        job_script_prologue=["source $HOME/stabctl/bin/activate", "export OMP_NUM_THREADS=1"],
        job_extra_directives=["--requeue"],
        scheduler_options={"dashboard": False, "host": host},
    )


def main() -> None:
    """Run the screen; run it again to continue."""
    case, folder, *number = sys.argv[1:]
    with cluster() as jobs:
        jobs.scale(jobs=int(number[0]) if number else 4)
        jobs.wait_for_workers(1)
        command = ["stabctl", "screen", case, "--store", folder, "--scheduler", jobs.scheduler_address]
        sys.exit(subprocess.run(command).returncode)


if __name__ == "__main__":
    main()
