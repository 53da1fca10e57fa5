"""What studies say and compute, beside what was recorded of them: every word, count and number.

A law says more than a recording. This is for what no law covers: sentences, columns, keys, the second of everything.
If a change is meant, record it again and read the difference:

    python tests/recordings/test_recordings.py ["modes" ...]        # all, or those with these names
    git diff tests/recordings/recorded
"""

import json
import math
import os
import re
import sys
import tempfile
import time
from pathlib import Path

if __name__ == "__main__":
    sys.path[:0] = [str(Path(__file__).parents[k]) for k in (2, 1, 0)]
    import environment  # noqa: F401

import pytest
from recordings import (  # noqa: F401, they add their studies
    answers,
    commands,
    damaged,
    designs,
    devices_and_laws,
    features,
    given_files,
    linear,
    one_machine,
    outage_files,
    outcomes,
    plans,
    sites,
)
from recordings.studies import LOOSE, SLOW, STUDIES, prepared

RECORDED = Path(__file__).parent / "recorded"
NUMBER = re.compile(r"(?<![\w.])-?\d+\.\d+(?:e[+-]?\d+)?")  # with decimals; whole ones are compared as text
ZERO = 1e-9  # below it, numbers are rounding errors
MOST = 12  # differences that are shown


def differences(old, new, rel, where=""):
    """Where two plain values differ, one line each."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in [*old, *(k for k in new if k not in old)]:
            if key not in new or key not in old:
                yield f"{where}.{key}: {'not there any more' if key in old else 'new'}"
            elif key == "sums" and isinstance(old[key][0], float):
                scale = max(abs(old[key][1]), abs(new[key][1]), 1e-3)
                if not all(abs(a - b) <= 10 * rel * scale for a, b in zip(old[key], new[key], strict=True)):
                    yield f"{where}.{key}: {old[key]} is now {new[key]}"
            else:
                yield from differences(old[key], new[key], rel, f"{where}.{key}")
    elif isinstance(old, list) and isinstance(new, list):
        if len(old) != len(new):
            yield f"{where}: {len(old)} entries, now {len(new)}"
        scale = max((abs(x) for x in old if isinstance(x, float)), default=0.0)
        for k, (a, b) in enumerate(zip(old, new, strict=False)):
            if isinstance(a, float) and isinstance(b, float) and abs(a - b) <= rel * scale:
                continue
            yield from differences(a, b, rel, f"{where}[{k}]")
    elif isinstance(old, float) and isinstance(new, float):
        if not math.isclose(old, new, rel_tol=rel, abs_tol=ZERO):
            yield f"{where}: {old!r} is now {new!r}"
    elif isinstance(old, str) and isinstance(new, str):
        if not alike(old, new, rel):
            yield f"{where}:\n    {old}\n    {new}"
    elif type(old) is not type(new) or old != new:
        yield f"{where}: {old!r} is now {new!r}"


def alike(old, new, rel):
    """Whether two texts are the same but for the last digit of numbers with decimals."""
    if old == new:
        return True
    if NUMBER.sub("#", old) != NUMBER.sub("#", new):
        return False
    pairs = zip(NUMBER.findall(old), NUMBER.findall(new), strict=True)
    return all(math.isclose(float(a), float(b), rel_tol=10 * rel, abs_tol=1.1 * last_digit(a)) for a, b in pairs)


def last_digit(text):
    """What the last digit of a number counts."""
    digits, _, power = text.partition("e")
    return 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))


def path_of(name):
    return RECORDED / f"{name.replace(' ', '_')}.json"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the files that commands read."""
    there = tmp_path_factory.mktemp("studies")
    prepared(there)
    return there


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n in SLOW)) for n in STUDIES])
def test_a_study_gives_what_was_recorded(name, folder, monkeypatch):
    monkeypatch.chdir(folder)
    found = json.loads(json.dumps(STUDIES[name](folder)))
    told = list(differences(json.loads(path_of(name).read_text(encoding="utf-8")), found, LOOSE.get(name, 1e-6)))
    more = f"\n... and {len(told) - MOST} more" if len(told) > MOST else ""
    assert not told, "\n".join([f"{name}, {len(told)} differences:", *told[:MOST]]) + more


def test_every_recording_belongs_to_a_study():
    assert {p.name for p in RECORDED.iterdir()} == {path_of(name).name for name in STUDIES}


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("2 runs, 1.250 s", "2 runs, 1.251 s", True),
        ("2 runs, 1.250 s", "2 runs, 1.259 s", False),
        ("2 runs", "3 runs", False),
        ({"a": 1.0}, {"a": 1.0 + 1e-8}, True),
        ({"a": 1.0}, {"a": 1.0 + 1e-4}, False),
        ({"a": 1}, {"a": 1, "b": 2}, False),
        ([1, 2], [1, 2, 3], False),
        (True, 1, False),
        ([1.0, 1e-12], [1.0, -1e-12], True),
    ],
)
def test_a_difference_is_seen(old, new, same):
    assert (not list(differences(old, new, 1e-6))) == same


def record(names):
    """Write the recordings of all studies, or of some."""
    with tempfile.TemporaryDirectory() as there:
        os.chdir(there)
        prepared(Path(there))
        for name in names or STUDIES:
            began = time.process_time()
            text = json.dumps(rounded(STUDIES[name](Path(there))), ensure_ascii=False, indent=1)
            short = re.sub(
                r"\[\s+((?:-?[\d.e+-]+|null|true|false)(?:,\s+(?:-?[\d.e+-]+|null|true|false))*)\s+\]", one_line, text
            )
            path_of(name).write_text(short + "\n", encoding="utf-8")
            print(f"{time.process_time() - began:6.2f} s  {name}", flush=True)


def one_line(found):
    """A list of numbers on one line."""
    return f"[{' '.join(found[1].split())}]"


def rounded(value):
    """Numbers with nine digits."""
    if isinstance(value, dict):
        return {k: rounded(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(v) for v in value]
    return float(f"{value:.9g}") if isinstance(value, float) else value


if __name__ == "__main__":
    record(sys.argv[1:])
