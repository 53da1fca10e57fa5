"""stabctl linearize: named matrices A, B, C, D of a case for other tools."""

from pathlib import Path
from typing import Annotated

import typer

from . import groups, options, shared
from .grouped import grouped

Inputs = Annotated[str, typer.Option("--inputs", help="storage:33,vref:14,load_p:8; pref alone means all governors.")]
Outputs = Annotated[str, typer.Option("--outputs", help="speed,angle:14,coi_speed,voltage:33,frequency:33,flow:7-8.")]
Out = Annotated[Path, typer.Option("--out", help="File to write, FILE.npz or FILE.mat.")]


@grouped
def linearize(
    *,
    out: Out,
    inputs: Inputs = "storage",
    outputs: Outputs = "speed",
    storage: groups.StorageOptions,
    case: groups.CaseOptions,
    as_json: options.Json = False,
) -> None:
    """Linearize a case at its operating point and export the model."""
    from stabctl.smallsignal import linearize

    shared.file(out, ".npz", ".mat")
    point = storage.initialize(case.load())
    model = linearize(point, inputs, outputs)
    path = model.save(out)
    if as_json:
        labels = {k: list(getattr(model, k)) for k in ("states", "inputs", "outputs")}
        shared.print_json({"case": point.case.name, "file": str(path), **labels})
        return
    shared.console().print(f"{model}; written to {path}")
