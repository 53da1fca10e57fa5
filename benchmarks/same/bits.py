"""Hashes of the records, instants and outcomes of every run of `scenarios.py`: python bits.py OUT.json."""

import hashlib

import numpy as np
from scenarios import RUNS, write

import stabctl as st


def found(name: str) -> list[object]:
    """Hash, shape and outcome of a run, or the error."""
    try:
        run = RUNS[name]()
    except st.StabctlError as error:
        return ["error", str(error)]
    kept = b"".join(np.ascontiguousarray(array).tobytes() for array in (run.rows, run.time, run.peak))
    return [hashlib.sha256(kept).hexdigest()[:16], *run.rows.shape, str(run.outcome)]


if __name__ == "__main__":
    write((name, found(name)) for name in RUNS)
