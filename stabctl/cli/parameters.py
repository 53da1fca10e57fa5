"""Commands made from functions: each parameter is `Annotated` with the `Option` or `Argument` that gives its value."""

import inspect
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from types import NoneType
from typing import Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

import click

from .guide import GUIDES, PANEL, PANELS


class Option(NamedTuple):
    """An option. It may be repeated if the parameter is a list, and has two values if that is a pair."""

    name: str  # --json, or --browser/--no-browser
    help: str
    metavar: str | None = None  # what its value is called
    parser: Callable[[Any], Any] | None = None  # reads the value; its errors are `click.BadParameter`
    min: float | None = None
    max: float | None = None
    callback: Callable[[Any], Any] | None = None  # called with the value before the command is


class Argument(NamedTuple):
    """An argument, optional if the parameter has a default; any number of them if it is a list."""

    metavar: str
    help: str
    known: Callable[[], list[str]] | None = None  # what a shell completes, beside files
    defaults: Callable[[click.Context, Any], dict[str, Any]] | None = None  # values that it gives other parameters


class Command(click.Command):
    """A command whose help has its options in panels, and two examples."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, panel by panel."""
        panels: dict[str, list[tuple[str, str]]] = {"": [], **{panel: [] for panel in PANELS}}
        for one in self.get_params(ctx):
            record = one.get_help_record(ctx) if isinstance(one, click.Option) else None
            if record:
                panels[PANEL.get(one.opts[-1], "")].append(record)
        for title, rows in panels.items():
            if rows:
                with formatter.section(title or "Options"):
                    formatter.write_dl(rows)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the examples."""
        if self.name in GUIDES:
            with formatter.section("Examples"):
                for example in GUIDES[self.name].examples:
                    formatter.write(f"{'':{formatter.current_indent}}{ctx.command_path} {example}".rstrip() + "\n")


class Commands(click.Group):
    """A group of commands, whose modules are imported when they are needed."""

    def __init__(self, help: str, where: Mapping[str, "str | click.Command"], **more: Any) -> None:
        """Create a group from the place of each command, "module.function", or the command itself."""
        super().__init__(help=help, no_args_is_help=True, **more)
        self.where = where

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the commands."""
        return list(self.where)

    def get_command(self, ctx: click.Context | None, cmd_name: str) -> click.Command | None:
        """The command of this name."""
        where = self.where.get(cmd_name)
        if isinstance(where, str):
            module, _, name = where.partition(".")
            return command(getattr(import_module(f"{__package__}.{module}"), name), cmd_name)
        return where


def command(function: Callable[..., Any], name: str) -> click.Command:
    """The command that calls a function.

    Parameters
    ----------
    function
        A parameter may be a record, a NamedTuple whose fields are `Annotated` as parameters are. It becomes one option
        for each field; their defaults are those of the record, or of the record that is the default of the parameter.
    name
        Name of the command.
    """
    records: dict[str, Any] = {}
    made: list[click.Parameter] = []
    hints = get_type_hints(function, include_extras=True)
    for key, parameter in inspect.signature(function).parameters.items():
        record = hints[key]
        if not hasattr(record, "_fields"):
            made.append(_parameter(key, record, parameter.default))
            continue
        records[key] = record
        defaults = record._field_defaults if parameter.default is parameter.empty else parameter.default._asdict()
        fields = get_type_hints(record, include_extras=True)
        made += [_parameter(field, hint, defaults.get(field, parameter.empty)) for field, hint in fields.items()]

    def call(**given: Any) -> Any:
        of_records = {key: record(*(given.pop(field) for field in record._fields)) for key, record in records.items()}
        return function(**given, **of_records)

    help, short = inspect.cleandoc(function.__doc__ or ""), GUIDES[name].short if name in GUIDES else None
    return Command(name, callback=call, params=made, help=help, short_help=short)


def _parameter(key: str, annotated: Any, default: Any) -> click.Parameter:
    """What click reads for a parameter of a function."""
    hint, about = get_args(annotated)
    if NoneType in get_args(hint):
        hint = get_args(hint)[0]
    required = default is inspect.Parameter.empty
    given = {"required": True} if required else {"required": False, "default": default}
    if isinstance(about, Argument):

        def shell(_context: click.Context, _parameter: click.Parameter, begun: str) -> list[Any]:
            item = click.shell_completion.CompletionItem
            return [item(begun, type="file"), *(item(n) for n in (about.known or list)() if n.startswith(begun))]

        def others(context: click.Context, _parameter: click.Parameter, read: Any) -> Any:
            if about.defaults:
                context.default_map = about.defaults(context, read)
            return read

        many = {"nargs": -1, "required": False} if get_origin(hint) is list else given
        return click.Argument(
            [key],
            type=_type(hint),
            metavar=about.metavar,
            help=about.help,
            shell_complete=shell,
            is_eager=about.defaults is not None,
            callback=others,
            **many,
        )
    flag, several = hint is bool, get_origin(hint) is list

    def value(context: click.Context, parameter: click.Parameter, read: Any) -> Any:
        found = (list(read) or None) if several else read
        return about.callback(found) if about.callback else found

    return click.Option(
        [about.name, key],
        type=None if flag else about.parser or _type(hint, about.min, about.max),
        is_flag=flag,
        multiple=several,
        metavar=about.metavar,
        help=about.help,
        show_default=not (flag or required or default in (None, "")),
        callback=value,
        **given,
    )


def _type(hint: Any, least: float | None = None, most: float | None = None) -> Any:
    """The type of click for a type."""
    if get_origin(hint) is Literal:
        return click.Choice(get_args(hint))
    if get_origin(hint) is list:
        return _type(*get_args(hint))
    if get_origin(hint) is tuple:
        return tuple(map(_type, get_args(hint)))
    if hint is Path:
        return click.Path(path_type=Path)
    if least is not None or most is not None:
        limited: Any = click.IntRange if hint is int else click.FloatRange
        return limited(least, most)
    return hint
