"""A study file of `stabctl study`: options of the command by their names, such as clear = "6cyc" for --clear 6cyc.

Options of the command line come first. A text that names a file beside the study file means that file.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click

from stabctl._util import toml_file
from stabctl._util.errors import StudyError, shown


def given(context: click.Context, files: Iterable[Path]) -> dict[str, Any]:
    """The values of parameters that a DYR file and a study file behind the case give.

    Raises `StudyError` for a file of another kind, two of one kind, and the first mistake in the study file.
    """
    by_kind: dict[str, Path] = {}
    for path in files:
        kind = path.suffix.lower()
        if kind not in (".dyr", ".toml"):
            raise StudyError(f"{path} is neither a DYR file, x.dyr, nor a study file, x.toml.")
        if kind in by_kind:
            raise StudyError(f"{by_kind[kind]} and {path} cannot be used together; give one {kind} file.")
        by_kind[kind] = path
    found = _options(context, by_kind[".toml"]) if ".toml" in by_kind else {}
    return found | ({"dyr": by_kind[".dyr"]} if ".dyr" in by_kind else {})


def _options(context: click.Context, path: Path) -> dict[str, Any]:
    """The values of options in a study file, by parameter."""
    options = {one.opts[0].removeprefix("--"): one for one in context.command.params if isinstance(one, click.Option)}
    found: dict[str, Any] = {}
    for key, value in toml_file.read(path, "study file").items():
        if key not in options:
            raise StudyError(f"{path}: {toml_file.unknown(key, options)}")
        option, values = options[key], value if isinstance(value, list) else [value]
        where = f"{path}: {key} = {shown(value)}"
        if any(isinstance(one, bool) != option.is_flag or not isinstance(one, str | int | float) for one in values):
            what = "true or false" if option.is_flag else "a text or a number"
            raise StudyError(f"{where} is not allowed; it must be {what}.")
        if isinstance(value, list) and not option.multiple:
            raise StudyError(f"{where} is not allowed; give one value, not a list.")
        read = values if option.is_flag else [_text(path.parent, one) for one in values]
        plain = read if option.multiple else read[0]
        try:
            option.type_cast_value(context, plain)
        except click.BadParameter as error:
            raise StudyError(f"{where}: {error.message.rstrip('.')}.") from None
        found[str(option.name)] = plain
    return found


def _text(folder: Path, value: object) -> str:
    """A value as on the command line; the name of a file in the folder with its folder."""
    beside = folder / str(value)
    return str(beside) if isinstance(value, str) and beside.is_file() else str(value)
