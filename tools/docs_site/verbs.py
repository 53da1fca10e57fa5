"""What mkdocstrings does not know of the package: methods declared with `verb`, and the meaning of annotated fields."""

from importlib import import_module
from typing import Any

import griffe

from docs_site.interface import documented, where


class Verbs(griffe.Extension):
    """Turns an attribute `verb("package.module:function")` into a method, and gives annotated fields their meaning."""

    def on_package(self, *, pkg: griffe.Module, loader: griffe.GriffeLoader, **_: Any) -> None:
        """Look through the classes of the package once it is loaded."""
        _fill(pkg, pkg, documented())


def _fill(of: Any, package: griffe.Module, listed: frozenset[str]) -> None:
    for name, member in list(of.members.items()):
        if member.is_alias:
            continue
        if member.is_attribute and str(member.value).startswith("verb("):
            module, _, function = str(member.value)[6:-2].partition(":")
            place = where(getattr(import_module(module), function)).removeprefix(f"{package.name}.")
            of.members[name] = _method(name, of, package[place], listed)
        elif member.is_attribute and of.canonical_path in listed and not _described(of):
            annotations = getattr(import_module(of.module.path), of.name).__annotations__
            unit, meaning, *_ = (*getattr(annotations.get(name), "__metadata__", ()), "", "")
            if isinstance(meaning, str) and meaning:
                text = meaning + f" ({unit})" * (unit != "-")
                member.docstring = griffe.Docstring(text, parent=member, parser="numpy")
        elif member.is_module or member.is_class:
            _fill(member, package, listed)


def _described(of: Any) -> bool:
    """Whether the text of a class has a section on its parameters or attributes."""
    return bool(of.docstring) and any(word in of.docstring.value for word in ("\nParameters\n", "\nAttributes\n"))


def _method(name: str, of: griffe.Class, function: Any, listed: frozenset[str]) -> griffe.Function:
    """The function as a method of a class, with its text only if it has no place of its own."""
    system, *others = function.parameters
    method = griffe.Function(name, parameters=griffe.Parameters(*others), parent=of)
    doc = function.docstring
    text = doc.value
    if function.canonical_path in listed:
        text = f"{text.partition(chr(10) * 2)[0]} See [`{function.name}`][{function.canonical_path}]."
    method.docstring = griffe.Docstring(text, parent=function, parser=doc.parser, parser_options=doc.parser_options)
    for section in method.docstring.parsed:
        if section.kind is griffe.DocstringSectionKind.parameters:
            section.value = [p for p in section.value if p.name != system.name]
    return method
