"""stabctl linearize: named matrices A, B, C, D of a case for other tools."""

from pathlib import Path
from typing import Annotated

import typer

from . import options, shared

Inputs = Annotated[str, typer.Option("--inputs", help="storage:33,vref:14,pref,load_p:8; a kind alone means all.")]
Outputs = Annotated[str, typer.Option("--outputs", help="speed,angle:14,coi_speed,voltage:33,frequency:33,flow:7-8.")]
Out = Annotated[Path, typer.Option("--out", help="File to write, FILE.npz or FILE.mat.")]


def linearize(
    case: options.CaseName,
    out: Out,
    inputs: Inputs = "storage",
    outputs: Outputs = "speed",
    storage: options.Size = None,
    storage_at: options.SizeAt = None,
    lag: options.Lag = "0s",
    settings: options.Set = None,
    device: options.Device = None,
    classical: options.Classical = False,
    verbose: options.Verbose = False,
    as_json: options.Json = False,
) -> None:
    """Linearize a case at its operating point and export the model."""
    from stabctl.smallsignal import linearize

    shared.file(out, ".npz", ".mat")
    point = shared.start(shared.load(case, classical, settings, verbose), storage, storage_at, lag=lag)
    model = linearize(point, inputs, outputs)
    path = model.save(out)
    if as_json:
        labels = {k: list(getattr(model, k)) for k in ("states", "inputs", "outputs")}
        shared.print_json({"file": str(path), **labels})
        return
    shared.console().print(f"{model}; written to {path}")
