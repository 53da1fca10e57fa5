"""Any result as plain lists, mappings, numbers and texts: what it says, its tables, all that it has, and its figure.

Of a long array there are the shape, some entries and three sums, which no exchange of two entries leaves alone.
"""

import dataclasses
import enum
import math
import re
from functools import cached_property
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import scipy.sparse as sp
import xarray as xr

from stabctl._util.errors import StabctlError

SHORT = 12  # entries of an array that are all shown
MANY = 8  # records from which on only four are shown
LEAST = 1e-6  # of a mode shape
FIRST = 5  # rows of sensitivities; the last ones are zero, in any order
DEEP = 5  # results within results
ELSEWHERE = "case", "base", "point", "contingencies", "stages", "linear", "dataset"  # the same, or of another study
VECTORS = (
    "right",
    "left",
    "speeds",
    "participation",
    "shares",
)  # of modes: of equal eigenvalues, they are as rounding has it
CLOCKED = "cpu_ms_per_frame", "ms_per_frame", "worker", "finished", "run_s", "wall_s"  # differ from run to run
BYTECODE = ("content",)  # differs from Python to Python


def described(value, deep=DEEP, seen=frozenset()):
    """A value as JSON has it."""
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, str):
        return timeless(value)
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, float | np.floating):
        return number(float(value))
    if isinstance(value, complex | np.complexfloating):
        return [number(value.real), number(value.imag)]
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return array(value, deep, seen)
    if isinstance(value, sp.spmatrix | sp.sparray):
        return array(value.toarray(), deep, seen)
    if isinstance(value, pd.DataFrame):
        return {str(name): array(value[name].to_numpy(), deep, seen) for name in value}
    if isinstance(value, xr.DataArray):
        return {"dims": list(value.dims), "values": array(value.to_numpy(), deep, seen)}
    if isinstance(value, xr.Dataset):
        return {str(name): described(value[name], deep, seen) for name in value.variables}
    if isinstance(value, Path):
        return value.name
    if isinstance(value, range | set | frozenset):
        return [described(v, deep, seen) for v in sorted(value)]
    if hasattr(value, "items"):
        return {str(k): described(v, deep, seen) for k, v in value.items()}
    if isinstance(value, list | tuple) and not hasattr(value, "_fields"):
        if len(value) > MANY and not isinstance(value[0], int | float | str):
            kept = [value[k] for k in (0, 1, len(value) // 2, -1)]
            return {"number": len(value), "some": [described(v, deep, seen) for v in kept]}
        return [described(v, deep, seen) for v in value]
    if not type(value).__module__.startswith("stabctl") or callable(value) or deep == 0 or id(value) in seen:
        return None
    return having(value, deep - 1, seen | {id(value)})


def number(x):
    """A number; JSON has neither infinities nor NaN."""
    return x if math.isfinite(x) else str(x)


def array(a, deep, seen):
    """All of a short array; of a long one its shape, some entries, and sums."""
    if a.size <= SHORT or a.dtype.kind not in "fciub":
        return [
            described(v, deep, seen) for v in (a.tolist() if a.size <= 4 * SHORT else a.ravel()[:: a.size // SHORT])
        ]
    flat, weights = np.nan_to_num(a.ravel(), posinf=1e9, neginf=-1e9), np.cos(np.arange(a.size))
    some = [described(v) for v in flat[np.linspace(0, a.size - 1, 6).astype(int)]]
    sums = [described(v) for v in (flat.sum(), abs(flat).sum(), flat @ weights)]
    return {"shape": list(a.shape), "some": some, "sums": sums}


def having(value, deep, seen):
    """What an object says and has: fields and properties without an underscore."""
    cls = type(value)
    names = (
        [f.name for f in dataclasses.fields(value)]
        if dataclasses.is_dataclass(value)
        else list(getattr(value, "_fields", ()))
    )
    for c in cls.__mro__:
        names += [n for n, v in vars(c).items() if isinstance(v, property | cached_property) and n not in names]
    found = {"is": cls.__name__}
    if cls.__str__ is not object.__str__ and not hasattr(value, "_fields"):
        found["says"] = timeless(str(value)).splitlines()
    for name in names:
        if name.startswith("_") or name in (*CLOCKED, *BYTECODE, *ELSEWHERE, *VECTORS):
            continue
        try:
            inner = getattr(value, name)
        except (StabctlError, NotImplementedError) as error:
            inner = str(error)
        found[name] = described(certain(cls.__name__, name, inner), deep, seen)
    if hasattr(value, "_head"):
        found["html"] = timeless(re.sub(r"<[^>]*>", " ", value._head())).splitlines()
    return found


def certain(cls, name, value):
    """What an object has, without what rounding decides."""
    if cls == "Sensitivity" and name in ("rows", "df"):
        return value[:FIRST]
    if cls.endswith("Modes") and name == "df":  # equal real eigenvalues come in any order
        return value[value["frequency_hz"] > 1e-3]
    if cls == "Mode" and name == "shape":  # a machine that stands still has no angle
        return [one for one in value if one.magnitude > LEAST]
    return value


def timeless(text):
    """Without computing times and folders."""
    text = re.sub(r"((?:steps|ms|runs|simulations|done) in )[0-9.]+(?= s)", r"\g<1>0", text)
    text = re.sub(r"[0-9.]+(?= ms per frame)", "0", text)
    return re.sub(r"/\S*/(?=[\w.-]+)", "", text)


def drawn(ax):
    """Texts, curves and marks of a figure."""
    figure = ax if hasattr(ax, "axes") and isinstance(ax.axes, list) else ax.figure
    found = []
    for one in figure.axes:
        texts = [t.get_text() for t in one.texts] + [one.get_title(), one.get_xlabel(), one.get_ylabel()]
        legend = one.get_legend()
        found.append(
            {
                "texts": [*texts, *([t.get_text() for t in legend.get_texts()] if legend else [])],
                "ticks": [t.get_text() for t in one.get_xticklabels() + one.get_yticklabels() if t.get_text()][:40],
                "lines": [
                    [line.get_label(), *(array(np.asarray(d, float), 1, frozenset()) for d in line.get_data())]
                    for line in one.lines
                ],
                "marks": [array(np.ma.filled(c.get_offsets(), 0.0), 1, frozenset()) for c in one.collections],
                "bars": [array(np.array(p.get_path().vertices), 1, frozenset()) for p in one.patches],
            }
        )
    plt.close(figure)
    return found
