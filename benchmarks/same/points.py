"""Hashes of outputs and derivatives of every device at random points, real and complex: python points.py OUT.json.

With them the hashes of the A matrices of the packaged cases. The sign of a zero does not count.
"""

import hashlib
import zlib
from typing import Any

import numpy as np
from scenarios import write

import stabctl as st
from stabctl import devices
from stabctl._util.schema import hints

POINTS = 50


def parameters(record: type, rng: np.random.Generator) -> Any:
    """A record of parameters: positive, some of those that may be 0 are 0; lower limits are negative."""
    values = {}
    for name, f in hints(record).items():
        limits = f.limits if f else {}
        values[name] = float(np.exp(rng.normal(-0.5, 1.0)))
        if f and f.kind is int:
            values[name] = int(rng.integers(int(limits.get("ge", 0)), int(limits.get("le", 5)) + 1))
        elif "ge" in limits and "le" in limits:
            values[name] = float(rng.integers(int(limits["ge"]), int(limits["le"]) + 1))
        elif limits.get("ge") == 0 and rng.random() < 0.2:
            values[name] = 0.0
        elif name.endswith("min"):
            values[name] *= -1
    return record(**values)


def evaluated(device: Any, rng: np.random.Generator, scalar: type) -> list[complex]:
    """Outputs and derivatives at one point."""

    def drawn() -> Any:
        z = rng.normal(0.4, 0.8)
        return complex(z, rng.normal()) if scalar is complex else z

    known: dict[str, Any] = {"p": device.prepared(parameters(device.Par, rng))}
    for name, record in (("x", "State"), ("u", "Input"), ("i", "Internal")):
        known[name] = vars(device)[record](*(drawn() for _ in device.fields(record)))
    known |= known["u"]._asdict() | {n: (drawn(), drawn()) for n in ("v", "v1", "v2")}
    y, rates = device.outputs_and_rates(known)
    return [complex(z) for z in (*y, *rates)]


def found(name: str, device: Any) -> list[object]:
    """Hash of all points of a device, and how many of them divide by zero."""
    kept, failed = hashlib.sha256(), 0
    for scalar in (float, complex):
        for k in range(POINTS):
            rng = np.random.default_rng([zlib.crc32(name.encode()), k])
            try:
                with np.errstate(all="ignore"):
                    kept.update((np.array(evaluated(device, rng, scalar)) + 0.0).tobytes())
            except (ZeroDivisionError, OverflowError, ValueError, st.StabctlError):
                failed += 1
                kept.update(b"none")
    return [kept.hexdigest()[:16], failed]


def matrix(name: str) -> list[object]:
    """Hash of the A matrix of a packaged case, and its shape."""
    A = st.load(name).initialize().linearize().A
    return [hashlib.sha256((A + 0.0).tobytes()).hexdigest()[:16], *A.shape]


if __name__ == "__main__":
    known = {n: d for n, d in sorted(devices.every().items()) if not d.has("family") and not d.has("step")}
    answers = [(name, found(name, device)) for name, device in known.items()]
    write(answers + [(f"A of {name}", matrix(name)) for name in st.cases()])
