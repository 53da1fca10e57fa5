"""Methods implemented in a package above their class: declared by name, imported at first use."""

from collections.abc import Callable
from importlib import import_module
from types import MethodType
from typing import Any


class verb:
    """A method that is a function in another package, `verb("stabctl.clearing.screen:screen")`.

    The instance is the first argument of the function. Accessed on an instance, this gives the bound method with the
    signature and docstring of the function; accessed on the class, the function.
    """

    def __init__(self, where: str) -> None:
        self.where = where

    def __set_name__(self, owner: type, name: str) -> None:
        self.__doc__ = f"See `{self.where.replace(':', '.')}`."

    def __get__(self, instance: object, owner: type | None = None) -> Callable[..., Any]:
        module, _, name = self.where.partition(":")
        function = getattr(import_module(module), name)
        return function if instance is None else MethodType(function, instance)
