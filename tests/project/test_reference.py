"""The Python reference: every function and class has an example, which runs; parameters are those of the signatures."""

import ast
import doctest
import inspect
import re
import typing
from functools import cache
from importlib import import_module
from pathlib import Path

import griffe
import pytest
from matplotlib import pyplot
from test_docs import own_folder, tokens  # noqa: F401

import stabctl as st
from docs_site import interface
from stabctl._util.verbs import verb
from stabctl.io.psse.to_case import Missing, MissingControls
from stabctl.model.conventions import Conventions
from stabctl.model.loads import Loads

ROOT = Path(__file__).resolve().parents[2]
FILES = {"extending": "pi_exciter.py", "from-matpower": "nine.m", "from-pst": "pair.m", "sweeps": "places.toml"}
INTERNAL = {  # without an example
    "Regulator.of_cost": "called by `lqr` and `lqg` with their cost",
    "Tuned.found": "called by `tune` with the result of its search",
    "LawLimits.exceeded": "called by `law` with what it measured",
    "LawLimits.kept": "called by `law` with what it measured",
    "LawLimits.score": "called by `law` with what it measured",
    "EstimatorControl.pilot": "called by simulations",
    "StabctlError": "raised by stabctl only; the pages show how it is caught",
}
SLOW = {
    "Design.report", "LawDesign", "LawDesign.plot", "LawDesign.report", "LawDesign.save", "law",
    "Optimum", "Optimum.plot", "optimum", "Results", "run_sweep",
}  # fmt: skip
PLAIN = ("str", "int", "float", "list", "tuple", "dict", "numpy.ndarray", "stabctl.model.case.Case")
SCALARS = {str, int, float, bool, complex, Path}
NAMES = {name: getattr(st, name) for name in st.__all__} | {  # of annotations, imported for type checking only
    "Conventions": Conventions, "Loads": Loads, "Missing": Missing, "MissingControls": MissingControls,
}  # fmt: skip
TEXT = {float, typing.Any}  # what is converted from text with a unit


@cache
def reference():
    """Name -> class or function with a text of its own, such as `Case` and `Case.set`."""
    listed = sorted(interface.documented())
    found, seen = {}, set(listed)
    for path in listed:
        module, _, name = path.rpartition(".")
        one = getattr(import_module(module), name)
        found["load_controller" if module == "stabctl.io.control_files" else name] = one
        for own, member in vars(one).items() if inspect.isclass(one) else ():
            method = getattr(one, own) if isinstance(member, verb) else getattr(member, "__func__", member)
            if own[0] == "_" or not inspect.isfunction(method) or _of_base(one, own, method):
                continue
            if interface.where(method) not in seen:
                seen.add(interface.where(method))
                found[f"{name}.{own}"] = method
    return found


def _of_base(one, name, method):
    """Whether a method is described by the class below it, and needs a sentence only."""
    described = (getattr(vars(base).get(name), "__doc__", None) or "" for base in one.__mro__[1:])
    return "\n" not in method.__doc__ and any("Parameters\n" in text for text in described)


def parameters(one):
    """Name -> parameter of a function or class, without self, cls and names that begin with an underscore."""
    if issubclass(type(one), type) and issubclass(one, Exception):
        return {}
    found = inspect.signature(one).parameters
    return {name: found[name] for name in found if name not in ("self", "cls") and name[0] != "_"}


@cache
def written(page, file):
    """The text of a file that a page writes."""
    fences = tokens(ROOT / "docs" / f"{page}.md")
    return next(fence.content for fence in fences if fence.info.endswith(f" {file}"))


@cache
def sections(one):
    """The NumPy sections of a docstring."""
    text = griffe.Docstring(inspect.cleandoc(one.__doc__), parser="numpy")
    return {section.kind.value: section.value for section in text.parse(warnings=False)}


def annotation(one, name):
    """The type of a parameter; None if it needs names that are imported for type checking only."""
    found = parameters(one)[name].annotation
    try:
        return eval(found, vars(import_module(one.__module__)) | NAMES) if isinstance(found, str) else found
    except NameError:
        return None


def types(hint):
    """Types that a parameter may be, the same with those in lists, tuples and mappings, and literals."""
    inside = typing.get_args(hint)
    if typing.get_origin(hint) is typing.Annotated:
        return types(inside[0])
    if typing.get_origin(hint) is typing.Literal:
        return {type(one) for one in inside}, {type(one) for one in inside}, set(inside)
    if not inside or not all(isinstance(one, typing.Hashable) for one in inside):
        return {hint}, {hint}, set()
    parts = [types(one) for one in inside]
    top, deep, literals = (set().union(*(part[k] for part in parts)) for k in range(3))
    is_union = typing.get_origin(hint) in (typing.Union, type(int | str))
    return top if is_union else set(), deep, literals if is_union else set()


SORTED = sorted(reference())
each = pytest.mark.parametrize("name", SORTED)
each_by_length = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in SORTED]
)


def test_exceptions_are_names_of_the_reference():
    assert len(reference()) > 200
    assert INTERNAL.keys() | SLOW <= reference().keys()


def test_everything_has_an_example():
    """Except for methods that take nothing and return a text, a number, a list or an array."""
    missing = {name for name, one in reference().items() if "examples" not in sections(one)} - INTERNAL.keys()
    for name in sorted(missing):
        assert "." in name, name
        assert not parameters(reference()[name]), name
        returned = inspect.signature(reference()[name]).return_annotation
        assert inspect.formatannotation(returned).startswith(PLAIN), name


@each_by_length
def test_example_runs_and_shows_what_comes_out(name, own_folder):  # noqa: F811
    """After `import stabctl as st`, in a folder with files that pages of the documentation write."""
    for page, file in FILES.items():
        (own_folder / file).write_text(written(page, file), encoding="utf-8")
    text = inspect.cleandoc(reference()[name].__doc__)
    test = doctest.DocTestParser().get_doctest(text, {"st": st}, name, None, None)
    report = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    runner.run(test, out=report.append)
    pyplot.close("all")
    assert not report, "".join(report)


@each
def test_parameters_are_those_of_the_signature(name):
    one = reference()[name]
    shown = [p.name for p in sections(one).get("parameters", ())]
    signature = parameters(one)
    if not shown and inspect.isclass(one):  # a result, or a record that describes each field
        fields = {p for p in signature if p in one.__annotations__}
        described = {p for p in fields if len(getattr(annotation(one, p), "__metadata__", ())) > 1}
        named = {p for given in sections(one).get("attributes", ()) for p in given.name.split(", ")}
        assert fields <= named | described
        assert {p for p in named if p not in signature and not hasattr(one, p)} <= one.__annotations__.keys()
    elif shown or name not in INTERNAL:
        stars = {inspect.Parameter.VAR_POSITIONAL: "*", inspect.Parameter.VAR_KEYWORD: "**"}
        wanted = [stars.get(p.kind, "") + p.name for p in signature.values()]
        instance = "." in name and wanted == ["case"]  # of a function that is a method only
        assert shown == wanted or (not shown and instance)


@each
def test_types_and_defaults_are_those_of_the_signature(name):
    one = reference()[name]
    headings = re.findall(r"^([*\w, ]+) : (.+)$", inspect.cleandoc(one.__doc__), re.MULTILINE)
    typed = {each: words for names, words in headings for each in names.split(", ")}
    for given in sections(one).get("parameters", ()):
        p, words = parameters(one)[given.name.lstrip("*")], typed.get(given.name, "")
        text = f"{p}: {words}; {given.description}"
        for shown in re.findall(r"(?:by default|default:?) (-?[\d.]*\d|\"\w*\"|True|False|None)(?![\w.])", text):
            value = ast.literal_eval(shown)
            assert type(value) is not type(p.default) or value == p.default, text
        if words and p.default not in ((), {}):
            assert ("optional" in words) == (p.default is None), text
        top, deep, literals = types(annotation(one, p.name))
        quoted = set(re.findall(r'"([^"]*)"', words))
        assert not (quoted and literals) or quoted == literals, text
        said = {one for one in SCALARS if re.search(rf"\b{one.__name__}\b", words)}
        if said and None not in top:
            assert top & SCALARS - ({str} if quoted else set()) <= said, text
            assert inspect.isclass(one) or said <= deep or TEXT & deep, text
