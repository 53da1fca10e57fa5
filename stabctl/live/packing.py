"""Arrays as bytes: a header in JSON with their names and sizes, then the numbers, column by column.

A table of curves is sent as whole numbers of 16 bits, value = middle + step * number; the lowest number is no value.
"""

import json
import struct
from typing import Any

import numpy as np

NONE, MOST = -32768, 32000


def pack(head: dict[str, Any], arrays: dict[str, np.ndarray]) -> bytes:
    """A header, then vectors (rows) and tables (rows, columns)."""
    parts, listed = [], []
    for name, values in arrays.items():
        if values.ndim == 1:
            listed.append([name, 0, len(values), 0.0, 0.0])
            parts.append(values.astype("<f4").tobytes())
            continue
        known = np.isfinite(values)
        least, most = (float(values[known].min()), float(values[known].max())) if known.any() else (0.0, 0.0)
        middle, step = (least + most) / 2, max(most - least, 1e-9) / (2 * MOST)
        number = np.where(known, np.rint((values - middle) / step), NONE).astype("<i2")
        listed.append([name, values.shape[1], len(values), middle, step])
        data = np.ascontiguousarray(number.T).tobytes()
        parts.append(data + b"\0" * (-len(data) % 4))
    text = json.dumps(head | {"arrays": listed}).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<I", len(text)) + text + b"".join(parts)
