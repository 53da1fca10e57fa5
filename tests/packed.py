"""Answers of the server of `stabctl live`, unpacked."""

import json
import struct

import numpy as np


def unpacked(data):
    """Header and arrays of an answer, read as the page does."""
    (length,) = struct.unpack_from("<I", data)
    head, at, arrays = json.loads(data[4 : 4 + length]), 4 + length, {}
    for name, columns, rows, middle, step in head["arrays"]:
        if not columns and not step:
            arrays[name] = np.frombuffer(data, "<f4", rows, at)
            at += 4 * rows
            continue
        number = np.frombuffer(data, "<i2", rows * columns, at).reshape(columns, rows).T
        arrays[name] = np.where(number == -32768, np.nan, middle + step * number)
        at += 2 * rows * columns
        at += -at & 3
    assert at == len(data)
    return head, arrays
