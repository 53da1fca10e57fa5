"""What a command does by default is what the function does that it calls."""

import inspect
from importlib import import_module

import pytest

import stabctl as st
from stabctl.cli.parameters import command

CALLED = {
    "simulate.simulate": st.Case.simulate, "clearing.clearing_time": st.Case.clearing_time,
    "clearing.screen": st.Case.screen, "study.study": st.study, "place.place": st.place,
    "estimate.estimate": st.Case.estimate,
    "linear.weak_grid": st.Case.weak_grid, "design.pod": st.design.pod, "design.lqr": st.design.lqr,
    "design.lqg": st.design.lqg, "design_law.law": st.design.law, "design_optimum.optimum": st.design.optimum,
    "design_tune.tune": st.design.tune, "design_tune.pss": st.design.pss, "listings.importing": st.import_report,
}  # fmt: skip
OTHERWISE = {  # None stands for the default of the function; the help of `design tune` says what differs
    ("clearing.screen", "faults"), ("study.study", "faults"), ("linear.weak_grid", "scr"), ("linear.weak_grid", "gain"),
    ("design_tune.tune", "outages"), ("design_tune.tune", "levels"), ("estimate.estimate", "estimator"),
}  # fmt: skip


def defaults(function, groups=True):
    """Name -> default of every parameter; of a group of options, those in it."""
    found = {}
    for name, parameter in inspect.signature(function).parameters.items():
        if groups and hasattr(parameter.annotation, "_field_defaults"):
            own = {} if parameter.default is parameter.empty else parameter.default._asdict()
            found |= parameter.annotation._field_defaults | own
        elif parameter.default is not parameter.empty:
            found[name] = parameter.default
    return found


@pytest.mark.parametrize("name", [name for name in CALLED if "damping" in defaults(CALLED[name])])
def test_a_damping_ratio_may_be_in_percent(name):
    module, _, function = name.partition(".")
    made = command(getattr(import_module(f"stabctl.cli.{module}"), function), function)
    (option,) = (one for one in made.params if one.name == "damping")
    assert option.type("5%") == option.type("0.05") == 0.05
    assert option.metavar == "RATIO"


def plain(value):
    """A default as numbers: 10MW is 10, 0s is 0, 20ms is 0.02, 0.7,1.3 are two."""
    if isinstance(value, str) and value[:1].isdigit():
        text = value.removesuffix("MW")
        parts = [1e-3 * float(p[:-2]) if p.endswith("ms") else p.removesuffix("s") for p in text.split(",")]
        try:
            value = tuple(map(float, parts))
        except ValueError:
            return value
    return value[0] if isinstance(value, tuple) and len(value) == 1 else value


@pytest.mark.parametrize("command", CALLED)
def test_a_command_has_the_defaults_of_its_function(command):
    module, _, name = command.partition(".")
    given = defaults(getattr(import_module(f"stabctl.cli.{module}"), name))
    wanted = defaults(CALLED[command], groups=False)
    both = [key for key in given if key in wanted and (command, key) not in OTHERWISE]
    assert {key: plain(given[key]) for key in both} == {key: plain(wanted[key]) for key in both}
    assert both
