"""stabctl models: the device models, with their parameters, states, inputs and outputs."""

from typing import TYPE_CHECKING, Annotated

import typer

from . import options, shared

if TYPE_CHECKING:
    from stabctl.devices.describe import Description

Name = Annotated[str | None, typer.Argument(metavar="[NAME]", help="Only this model, in full, such as genrou.")]


def models(name: Name = None, device: options.Device = None, as_json: options.Json = False) -> None:
    """List the device models by role, or the parameters, states, inputs, outputs and limits of one model."""
    from stabctl import devices
    from stabctl.devices.describe import describe

    if name is None:
        _listed([describe(one) for one in devices.every()], as_json)
        return
    found = describe(name)
    if as_json:
        parts = ("parameters", "states", "inputs", "outputs", "limits")
        rows = {part: [row._asdict() for row in getattr(found, part)] for part in parts}
        for row in (*rows["states"], *rows["inputs"], *rows["outputs"]):
            reads = row.pop("from_")
            row |= {"reads": reads} if reads else {}
        shared.print_json({"model": {**found._asdict(), **rows}})
        return
    _shown(found)


def _listed(found: "list[Description]", as_json: bool) -> None:
    if as_json:
        shared.print_json(
            {"models": [{"name": m.name, "role": m.role, "title": m.title, "unverified": m.unverified} for m in found]}
        )
        return
    from rich.table import Table

    table = Table("role", "model", "description")
    table.columns[1].no_wrap = True
    last = ""
    for m in found:
        table.add_row(m.role if m.role != last else "", m.name, m.title + f" ({m.unverified})" * bool(m.unverified))
        last = m.role
    shared.console().print(table)


def _shown(found: "Description") -> None:
    from rich.table import Table

    console = shared.console()
    if found.unverified:
        print(f"This model is {found.unverified}.\n")
    print(f"{found.title}\n\n{found.text}\n\nRole: {found.role}, {found.role_meaning}.\n")
    if found.parameters:
        table = Table("parameter", "unit", "meaning", "allowed", "default", title="Parameters", title_justify="left")
        for p in found.parameters:
            default = "required" if p.default is None else str(p.default)
            table.add_row(p.name, p.unit, p.meaning, p.allowed, default if p.allowed else "from the case")
        console.print(table)
    for title, signals in (("States", found.states), ("Inputs", found.inputs), ("Outputs", found.outputs)):
        if signals:
            columns = ("name", "unit", "meaning", *(("reads",) if title == "Inputs" else ()))
            table = Table(*columns, title=title, title_justify="left")
            for s in signals:
                table.add_row(*s[: len(columns)])
            console.print(table)
    for limit in found.limits:
        print(f"The state {limit.state} has the non-windup limits {limit.low} and {limit.high}.")
