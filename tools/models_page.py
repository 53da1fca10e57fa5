"""docs/models.md: parameters, states, ports, limits and source of every device, written from the devices themselves."""

import sys
from collections.abc import Iterable, Iterator
from itertools import groupby
from pathlib import Path

from stabctl import devices
from stabctl.devices.describe import Description, describe

PAGE = Path(__file__).parent.parent / "docs" / "models.md"
INTRODUCTION = """# Device models

This page is written by `make docs` from the devices in `stabctl/devices`; do not edit it. `stabctl models NAME` shows
the same in a terminal. Parameters without an allowed range are filled from the case and are no columns of the table.
"""


def page() -> str:
    """The text of the page."""
    found = [describe(name) for name in devices.every()]
    parts = [INTRODUCTION]
    for role, group in groupby(found, key=lambda one: one.role):
        parts.append(f"## {role.capitalize()}: {devices.ROLES[role]}\n")
        parts += ["\n".join(_section(one)) for one in group]
    return "\n".join(parts)


def _section(of: Description) -> Iterator[str]:
    yield f"### {of.name}\n\n{of.title}.\n"
    if of.unverified:
        yield f"**This model is {of.unverified}.**\n"
    if of.text.strip():
        yield f"```text\n{of.text.strip(chr(10))}\n```\n"
    if of.parameters:
        rows = ((p.name, p.unit, p.meaning, p.allowed, "" if p.default is None else p.default) for p in of.parameters)
        yield from _table(("Parameter", "Unit", "Meaning", "Allowed", "Default"), rows)
    if of.states:
        yield from _table(("State", "Unit", "Meaning"), (s[:3] for s in of.states))
    if of.inputs:
        yield from _table(("Input", "Unit", "Meaning", "Reads"), of.inputs)
    if of.outputs:
        yield from _table(("Output", "Unit", "Meaning"), (s[:3] for s in of.outputs))
    if of.limits:
        yield from _table(("Limited state", "Low", "High"), of.limits)


def _table(head: tuple[str, ...], rows: Iterable[Iterable[object]]) -> Iterator[str]:
    for row in (head, ("---",) * len(head), *rows):
        yield "| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |"
    yield ""


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE, file=sys.stderr)
