"""Every option of a command that computes changes what the library is asked for, or is refused."""

import importlib
import shlex

import click
import pytest
from cli.test_terminal import walked

import stabctl as st
from stabctl._util.content import content
from stabctl.cli import app

LINES = {  # a call of every command, and the function that it ends in
    "simulate": ("two_area --fault 7 --clear 6cyc", "simulation.simulate:simulate"),
    "clearing-time": ("two_area --fault 7", "clearing:clearing_time"),
    "screen": ("two_area", "clearing:screen"),
    "study": ("two_area", "assessment:study"),
    "place": ("two_area --contingencies faults.toml", "placement.place:place"),
    "estimate": ("two_area --fault 7 --clear 6cyc", "estimation.estimate:estimate"),
    "modes": ("two_area", "smallsignal:analyze"),
    "weak-grid": ("two_area --converter 3", "smallsignal.weak_grid:weak_grid"),
    "linearize": ("two_area --storage 50MW --out model.npz", "smallsignal:linearize"),
    "scr": ("two_area", "model.short_circuit:short_circuit"),
    "design optimum": ("two_area --fault 7 --storage 50MW", "design.optimum:optimum"),
    "design law": ("two_area --fault 7 --storage 50MW", "design:law"),
    "design tune": ("two_area_thyristor", "design:tune"),
    "design pss": ("two_area_thyristor", "design:pss"),
    "design pod": ("two_area_thyristor --storage 50MW", "design:pod"),
    "design lqr": ("two_area --storage 50MW", "design:lqr"),
    "design lqg": ("two_area --storage 50MW", "design:lqg"),
    "swing table1": ("", "theory.omib:table1"),
    "swing equal-area": ("", "theory.equal_area:equal_area"),
    "swing feedback": ("", "theory.feedback_laws:compare"),
    "swing minimum-time": ("", "theory.minimum_time:by_shooting"),
    "sweep run": ("jobs.toml --out rows.db", "sweep.sweep:run_sweep"),
}
VALUES = dict(  # where it is not another choice, a number twice as large, or a flag
    one.split(" ", 1)
    for one in """\
--also two_area_manual; --angle 0.2rad; --at 2s; --band 0.2 2; --below 9cyc; --candidates sites.csv; --cap 40MW;
--check-levels 0.8; --clear 9cyc; --contingencies others.toml; --controller gain.toml; --converter Imax=1.3;
--cost-mwh 4; --cost-site 3; --criteria wecc-tpl-001; --cycles 8; --damper deviation:1,order:1@5; --damping 0.07;
--deadband 0.2; --delay 0.03; --disk-margin 0.4; --disturbance 20; --energy 20kWh; --every 0.1s; --fault 8;
--fault-impedance 0.01,0.02; --faults buses; --final-voltage 0.9; --frequency-delay 0.5s; --gain 15;
--gains 0.6,1.4; --input deviation:1; --inputs vref; --lag 30ms; --latency-ms 70; --levels 0.9,1; --limit 30cyc;
--load-level 0.9; --load-step 7:+50MW@2s; --longest 12s; --machine 2; --max-angle 3; --max-coi 1Hz;
--max-energy 20kWh; --max-frequency 63; --min-deadband 0.03; --min-frequency 58.5; --mode 0.5Hz;
--monitored watched.mon; --noise 0.5; --noise-filter 30ms; --observe 7s; --open 8-9@2s; --order 3; --output order:1;
--outputs angle; --pmu-noise-mrad 3; --prices prices.toml; --rate 30; --remedies storage; --reserve 0.8;
--resolution 0.5cyc; --return-within 60s; --scan 12; --scheduler tcp://nowhere:1; --scr 2,3; --set machines.1.p=650;
--sites 2; --speed 0.2; --spread 0.1; --step 4ms; --storage 70MW; --storage-at 3=40MW; --storage-energy 20kWh;
--storage-model regc; --storage-mva 90MVA; --store jobs; --subsystems elsewhere.sub; --tolerance 0.05;
--training 0.4; --trip 8-9; --trip-machine 2@2s; --until 7s; --value pss.1.K; --window 2s; --workers 1""".replace(
        "\n", " "
    ).split("; ")
)
OF_DEVICES = ["--deadband", "--min-voltage", "--characteristic", "--lag", "--storage-model", "--storage-energy"]
WITH = {  # what else an option needs
    **dict.fromkeys(
        [
            "--deadband",
            "--min-voltage",
            "--characteristic",
            "--lag",
            "--storage-model",
            "--storage-energy",
            "--control",
        ],
        "--storage 50MW",
    ),
    "--storage-mva": "--storage 50MW --storage-model regc",
    "--converter": "--storage 50MW --storage-model regc",
    **dict.fromkeys(
        ["--estimator", "--seed", "--pmu-rate", "--pmu-noise-mrad", "--latency-ms", "--loss"],
        "--storage 50MW --estimator kinematic",
    ),
    "--every": "--out run.csv",
    "--subsystems": "--contingencies statements.con --subsystems areas.sub",
    "--trip": "--fault 7",
}
OWN = {  # values and what else is needed, of one command
    ("clearing-time", "--open"): ("8-9@2s", ""),
    ("modes", "--open"): ("7-8#1", ""),
    ("scr", "--trip"): ("8-9", ""),
    ("place", "--seed"): ("5", "--validate kinematic"),
    ("design tune", "--seed"): ("5", ""),
    ("design pss", "--seed"): ("5", ""),
    ("design law", "--seed"): ("5", ""),
    ("weak-grid", "--gain"): ("15,25", ""),
    ("swing equal-area", "--Pc"): ("0.1", ""),
    ("swing minimum-time", "--Pc-min"): ("-0.3", ""),
    ("swing minimum-time", "--Pm"): ("0.4", ""),
    ("swing minimum-time", "--X"): ("0.9", ""),
    ("weak-grid", "--converter"): ("4", ""),
    **{("place", one): (VALUES.get(one), "") for one in OF_DEVICES},
    **{("place", one): (VALUES[one], "--storage-model regc") for one in ("--storage-mva", "--converter")},
    **{(name, "--storage-at"): ("3=40MW", "") for name in ("place", "linearize")},
}
OUTPUT = [
    "--help",
    "--json",
    "--out",
    "--report",
    "--plot",
    "--channels",
    "--angle-reference",
    "--dyr-out",
    "--verbose",
]
OF_THE_CASE = [  # all in one record
    *("--device", "--dyr", "--machines", "--frequency", "--missing", "--missing-controls", "--motor-share"),
    *("--conventions", "--verbose"),
]
LATER = {  # beside or after what the library is asked for first
    *(("modes", name) for name in ("--band", "--areas", "--sensitivity", "--controller")),
    *((f"design {name}", "--fault") for name in ("tune", "pss", "pod", "lqr", "lqg")),
    ("design pod", "--rank"),
    *(("design law", name) for name in ("--from-screen", "--contingencies")),  # instead of a fault
    ("clearing-time", "--at"),  # of controls with instants of their own
}


KNOWN: list[list[str]] = []  # calls that ask the same when they are repeated


class Asked(Exception):
    """What the library was asked for."""


def asked(words, function, monkeypatch):
    """What a function of the library is given by a command."""
    module, _, name = function.partition(":")

    def told(*args, progress=None, each=None, said=None, **given):
        raise Asked(content([args, sorted(given.items())], None).text)

    monkeypatch.setattr(importlib.import_module(f"stabctl.{module}"), name, told)
    with app.make_context("stabctl", words) as context, pytest.raises(Asked) as found:
        context.command.invoke(context)
    return str(found.value)


def other(option, value):
    """Words with another value of an option."""
    name = option.opts[-1]
    if option.is_flag:
        return [name]
    if isinstance(option.type, click.Choice):
        return [name, next(one for one in option.type.choices if one not in (option.default, "bang-bang"))]
    if value is None:
        value = f"{2 * float(option.default):g}"
    return [name, *(value.split() if option.nargs > 1 else [value])]


@pytest.fixture(autouse=True)
def files(monkeypatch, tmp_path):
    """What options name, in the folder where the commands run."""
    monkeypatch.chdir(tmp_path)
    for name, bus in (("faults", 7), ("others", 8)):
        (tmp_path / f"{name}.toml").write_text(f'[[contingency]]\nfault = "{bus}"\nclear = "6cyc"\n')
    (tmp_path / "statements.con").write_text("SINGLE BRANCH IN SUBSYSTEM 'NORTH'\nEND\n")
    for name, bus in (("areas", 6), ("elsewhere", 8)):
        (tmp_path / f"{name}.sub").write_text(f"SUBSYSTEM 'NORTH'\nBUS 7\nBUS {bus}\nEND\nEND\n")
    (tmp_path / "sites.csv").write_text("bus,machine\n5,1\n")
    (tmp_path / "prices.toml").write_text("[prices]\nmw = 3\n")
    st.Controller("speed:1", "vref:1", [], [], [], 3.0).save(tmp_path / "gain.toml")


def every():
    for path, command in walked(app):
        name = " ".join(path)
        for option in command.params if name in LINES else ():
            one = option.opts[-1]
            if isinstance(option, click.Option) and one not in (*OUTPUT, *OF_THE_CASE) and (name, one) not in LATER:
                yield pytest.param(name, option, id=f"{name} {one}")


@pytest.mark.parametrize(("name", "option"), [*every()])
def test_an_option_reaches_the_library(name, option, monkeypatch):
    one = option.opts[-1]
    line, function = LINES[name]
    value, needed = OWN.get((name, one), (VALUES.get(one), WITH.get(one, "")))
    line = line.replace("--storage 50MW", "") if one.startswith("--storage-at") else line
    words = [*name.split(), *shlex.split(f"{line} {needed}")]
    before = asked(words, function, monkeypatch)
    assert words in KNOWN or asked(words, function, monkeypatch) == before
    KNOWN.append(words)
    assert asked([*words, *other(option, value)], function, monkeypatch) != before
