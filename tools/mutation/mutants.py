"""Faults at one place of a source file, put into a copy of the tree.

An operator, a number, a condition, a call or a statement is changed.
"""

import ast
import hashlib
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

OPERATORS: dict[type, type] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv,
    ast.Pow: ast.Mult,
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.And: ast.Or,
    ast.Or: ast.And,
    ast.USub: ast.UAdd,
}
OPPOSITES: dict[type, type] = {ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt}
SYMMETRIC = "min", "max", "minimum", "maximum", "hypot", "union1d"  # functions whose arguments may be swapped
PAIRS = ("min", "max"), ("any", "all"), ("sin", "cos"), ("argmin", "argmax"), ("floor", "ceil"), ("real", "imag")
NAMES = {a: b for pair in PAIRS for a, b in (pair, pair[::-1])}
DROPPED = ast.Expr, ast.AugAssign, ast.Raise, ast.Continue, ast.Break
TOLERANCE = 1e-5  # numbers below are tolerances: half or twice as much is as good
FIGURES = "stabctl/view/figures/"  # their numbers, unless something is computed from them, are only layout
Change = Callable[[], object]


class Mutant(NamedTuple):
    """One fault: the statement before and after, and the whole file with it."""

    path: str  # in the tree
    line: int
    last_line: int
    before: str
    after: str
    text: str

    @property
    def key(self) -> str:
        """What identifies it while other lines of the file change."""
        return f"{self.path}: {self.before} => {self.after}"


def count(root: Path, path: str) -> int:
    """Number of faults that a file can have."""
    return len(list(_places(ast.parse((root / path).read_text(encoding="utf-8")), path)))


def mutant(root: Path, path: str, number: int) -> Mutant:
    """A fault of a file, by its number from 0 in the order of the text."""
    tree = ast.parse((root / path).read_text(encoding="utf-8"))
    statement, change = list(_places(tree, path))[number]
    before, body = _head(statement), getattr(statement, "body", None)
    last = max(body[0].lineno - 1, statement.lineno) if body else statement.end_lineno or statement.lineno
    after = change()
    text = ast.unparse(ast.fix_missing_locations(tree))
    return Mutant(path, statement.lineno, last, before, "pass" if after == "dropped" else _head(statement), text)


def _head(statement: ast.stmt) -> str:
    """A statement on one line; of a compound one its first line."""
    text = ast.unparse(statement)
    return next(line for line in text.splitlines() if not line.startswith("@")) if hasattr(statement, "body") else text


def _places(tree: ast.Module, path: str) -> Iterator[tuple[ast.stmt, Change]]:
    """Every place of a file with the statement it is in and the change that makes the fault."""
    yield from _block(tree.body, path)


def _block(body: list[ast.stmt], path: str) -> Iterator[tuple[ast.stmt, Change]]:
    for i, statement in enumerate(body):
        if _left_out(statement):
            continue
        if isinstance(statement, DROPPED) or _stores(statement):
            yield statement, partial(_drop, body, i)
        for name, value in ast.iter_fields(statement):
            if name in ("decorator_list", "returns", "bases", "keywords", "type_params"):
                continue
            if name == "annotation" and not (isinstance(value, ast.Subscript) and _is(value.value, "Annotated")):
                continue
            for part in value if isinstance(value, list) else [value]:
                if isinstance(part, ast.stmt):
                    break
                if isinstance(part, ast.ExceptHandler | ast.match_case):
                    yield from _block(part.body, path)
                elif isinstance(part, ast.AST):
                    yield from ((statement, change) for change in _expression(part, path, statement))
            if isinstance(value, list) and value and isinstance(value[0], ast.stmt):
                yield from _block(value, path)
        if isinstance(statement, ast.If | ast.While):
            yield statement, partial(_negate, statement)


def _left_out(statement: ast.stmt) -> bool:
    """Docstrings, imports, what is for type checkers only, and lists of names."""
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant | ast.Yield):
        return True
    if isinstance(statement, ast.If) and _is(statement.test, "TYPE_CHECKING"):
        return True
    return isinstance(statement, ast.Assign) and _is(statement.targets[0], "__all__")


def _is(node: ast.AST, name: str) -> bool:
    return isinstance(node, ast.Name) and node.id == name


def _is_float(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, float)


def _stores(statement: ast.stmt) -> bool:
    """Whether it assigns to a part of something, which can be forgotten without a name being missing."""
    return isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Attribute | ast.Subscript)


def _expression(node: ast.AST, path: str, parent: ast.AST) -> Iterator[Change]:
    """Changes of an expression and of its parts."""
    if isinstance(node, ast.arguments):
        for default in (*node.defaults, *(d for d in node.kw_defaults if d)):
            yield from _expression(default, path, node)
        return
    yield from _own(node, path, parent)
    for name, value in ast.iter_fields(node):
        if name in ("format_spec", "annotation"):
            continue
        for part in value if isinstance(value, list) else [value]:
            if isinstance(part, ast.AST) and not (isinstance(part, ast.keyword) and part.arg == "strict"):
                yield from _expression(part, path, node)


def _own(node: Any, path: str, parent: ast.AST) -> Iterator[Change]:
    """Changes of a node itself."""
    match node:
        case ast.BinOp() | ast.BoolOp() | ast.UnaryOp() if type(node.op) in OPERATORS:
            yield partial(setattr, node, "op", OPERATORS[type(node.op)]())
        case ast.Compare():
            continuous = any(_is_float(part) for part in (node.left, *node.comparators))
            changed = OPERATORS | OPPOSITES if continuous else OPERATORS  # equality of such numbers never happens
            for i, op in enumerate(node.ops):
                yield partial(node.ops.__setitem__, i, changed[type(op)]())
        case ast.Constant(value=bool() | int() | float()):
            layout = path.startswith(FIGURES) and not isinstance(parent, ast.BinOp)
            if not layout and not 0 < node.value < TOLERANCE:
                yield partial(setattr, node, "value", _other(node.value))
        case ast.IfExp():
            yield partial(_negate, node)
        case ast.comprehension():
            for i in range(len(node.ifs)):
                yield partial(node.ifs.__setitem__, i, ast.Constant(True))
        case ast.Attribute(attr=name) if name in NAMES:
            yield partial(setattr, node, "attr", NAMES[name])
        case ast.Name(id=name) if name in NAMES:
            yield partial(setattr, node, "id", NAMES[name])
        case ast.Call():
            first = [ast.dump(a) for a in node.args[:2] if not isinstance(a, ast.Starred)]
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            if len(first) == 2 and first[0] != first[1] and name not in ("isinstance", *SYMMETRIC):
                yield partial(_swap, node.args)
            for i, word in enumerate(node.keywords):
                if word.arg not in (None, "strict", "encoding"):
                    yield partial(node.keywords.__delitem__, i)


def _other(value: float) -> float:
    """Another number: the other truth value, the next integer, twice the number (1 for 0)."""
    if isinstance(value, bool):
        return not value
    return value + 1 if isinstance(value, int) else 2 * value or 1.0


def _negate(node: ast.If | ast.While | ast.IfExp) -> None:
    test = node.test
    inverted = isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not)
    node.test = test.operand if inverted else ast.UnaryOp(ast.Not(), test)  # type: ignore[union-attr]


def _swap(arguments: list[ast.expr]) -> None:
    arguments[:2] = arguments[1], arguments[0]


def _drop(body: list[ast.stmt], i: int) -> str:
    body[i] = ast.copy_location(ast.Pass(), body[i])
    return "dropped"


class Scratch:
    """A copy of the tree, in which one file at a time has a fault: `folder/tree`; its machine code: `folder/cache`."""

    def __init__(self, root: Path, folder: Path) -> None:
        self.root, self.folder, self.tree, self.cache = root, folder, folder / "tree", folder / "cache"
        self._stamp = 0

    def update(self) -> None:
        """Make the copy equal to the tree, without touching the files that are equal already."""
        listed = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            cwd=self.root,
            check=True,
            capture_output=True,
            text=True,
        ).stdout.split("\0")
        names = {name for name in listed if name and (self.root / name).is_file()}
        for name in names:
            source, target = self.root / name, self.tree / name
            if not target.exists() or digest(source) != digest(target):
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(source, target)
        for path in [*self.tree.rglob("*")]:
            known = "__pycache__" in path.parts or str(path.relative_to(self.tree)) in names
            if path.is_file() and not known:
                path.unlink()
        (self.cache / "stabctl").mkdir(parents=True, exist_ok=True)

    @contextmanager
    def fault(self, mutant: Mutant) -> Iterator[None]:
        """The copy with the fault; the machine code compiled meanwhile is removed afterwards."""
        path, compiled = self.tree / mutant.path, self._compiled()
        before, stat = path.read_bytes(), path.stat()
        self._stamp += 1
        try:
            path.write_text(mutant.text, encoding="utf-8")
            os.utime(path, (self._stamp, self._stamp))  # never that of other bytecode or machine code
            yield
        finally:
            path.write_bytes(before)
            os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
            for new in self._compiled() - compiled:
                shutil.rmtree(new) if new.is_dir() else new.unlink()

    def _compiled(self) -> set[Path]:
        return {*(self.cache / "stabctl").iterdir()}


def digest(path: Path) -> str:
    """Hash of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]
