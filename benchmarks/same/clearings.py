"""Some 200 clearing times with storage, laws and controllers: python clearings.py OUT.json."""

from collections.abc import Iterator
from typing import Any

from scenarios import MVA, damper, point, write

import stabctl as st

PLAIN = {"storage": "50MW"}
CONTROLS: dict[str, tuple[dict[str, Any], Any]] = {
    "none": ({}, None),
    "bang-bang": (PLAIN, st.BangBang()),
    "full": ({"storage": "100MW", "energy": 0.05, "lag": 0.05}, st.BangBang()),
    "surface": (PLAIN, st.StorageLaw(angle_gain=1.0, slope=0.2)),
    "sampled": (PLAIN, st.BangBang().sampled(60, "50ms")),
    "feedback": (PLAIN, st.Feedback(1.0, 0.01)),
    "regc": (PLAIN | {"storage_model": "regc"} | MVA, st.BangBang()),
    "regfm": (PLAIN | {"storage_model": "regfm"} | MVA, st.StorageLaw(slope=0.3)),
    "controller": ({}, damper),
}
CASES = {"two_area": tuple(CONTROLS), "wscc9": tuple(CONTROLS)[:-1], "ieee39": ("none", "bang-bang", "feedback")}


def searches() -> Iterator[tuple[str, st.OperatingPoint, st.Contingency, Any]]:
    """Every search: name, operating point, contingency without clearing time, and control."""
    for case, controls in CASES.items():
        branches = [b for b in st.load(case).branches if b.tap == 1.0 and b.r + b.x > 0.0]
        lines = list(dict.fromkeys((b.from_bus, b.to_bus) for b in branches))[:12]
        for label in controls:
            options, control = CONTROLS[label]
            at = point(case, **options)
            if control is damper:
                control = damper(3, at.case.machines[0].machine)
            for a, b in lines:
                yield f"{case}, {label}, {a} trip {a}-{b}", at, st.Contingency(str(a), trip=f"{a}-{b}"), control


def found(at: st.OperatingPoint, fault: st.Contingency, control: Any) -> str:
    """The clearing time in words, or the error."""
    try:
        return str(at.clearing_time(fault, control=control))
    except st.StabctlError as error:
        return f"{type(error).__name__}: {error}"


if __name__ == "__main__":
    write((name, found(*search)) for name, *search in searches())
