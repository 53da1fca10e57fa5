"""Studies of linear models and designs: tuning, dampers, regulators, loci, reduced models, weak grids."""

import control
from described import drawn
from mixed import mixed_point, second
from recordings.studies import LOOSE, SLOW, STUDIES, command, dampers, recorded, second_point

import stabctl as st
from stabctl import design
from stabctl.design.lqg import response
from stabctl.smallsignal import analyze, areas, feedback_locus, parameter_locus
from stabctl.smallsignal.contributions import contributions
from stabctl.smallsignal.nonlinear import nonlinear
from stabctl.smallsignal.reduce import balanced

FEW = {"outages": "none", "levels": [1.0], "check_levels": [], "checks": 0, "starts": 1, "workers": 1}


@recorded("tuning", slow=True, loose=1e-2)
def _():
    base = st.load("two_area_thyristor").initialize(storage="3@11=50MW")
    found = {
        "all": design.tune(
            base,
            [
                design.stabilizers([1, 3], stages=1, gain=10, fast=100),
                design.damper("deviation:3", "order:3@11", stages=1, delay="50ms"),
            ],
            damping=0.08, one_out=True, **FEW | {"checks": 1},
        ),
        "model": design.tune(base, [design.stabilizers([1, 3], model="ieeest", stages=1)], damping=0.05, **FEW),
    }  # fmt: skip
    return found | {"dyr": found["model"].dyr}


@recorded("networks of a tuning")
def _():
    case = st.load("two_area_thyristor")
    devices = [
        design.stabilizers([1, 3], model="pss2b", stages=3, gain=-4, limits=(-0.04, 0.06)),
        design.damper("flow:7-8", "order:3@11", gain=0.3, fast=1, notch=(2, 6), delay=("50ms", "150ms"), noise=0.001),
        design.pi("voltage:7", "vref:2", gain=-5, reset=(0.2, 30), limits=0.2),
        design.values("sexs.KA"),
    ]
    return {"devices": devices, "outages": design.outages(case)}


@recorded("dampers and regulators", loose=1e-3)
def _():
    base = st.load("two_area_thyristor").initialize(storage="3@11=50MW")
    found = design.pod(base, "deviation:1, deviation:3", "order:3@11", damping=0.05, rate=60, delay="50ms", order=2)
    return {
        "pod": found,
        "held": design.pod(base, "deviation:3", "order:3@11", damping=0.04, spread="30%", limits=0.5, washout="5s"),
        "lqr": design.lqr(second_point(), "order:21@2", "deviation", angle="4deg", speed=0.2, limits=0.6),
        "pairs": design.pairs(base, "deviation", delay="100ms", availability={"deviation:1": 0.8}).df,
    }


@recorded("an own estimator", loose=1e-3)
def _():
    found = design.lqg(second_point(), "order", "deviation, flow:2-5", rate=50, delay="40ms", order=9, noise=2.0)
    return {
        "says": str(found).splitlines(),
        "margins": [found.full, found.own],
        "after": found.after,
        "response": [response(found.controller, w) for w in (0.2, 3.0, 30.0)],  # its states are as rounding has them
    }


@recorded("linear models", loose=1e-5)
def _():
    point = second_point()
    modes = point.modes()
    linear = point.linearize("storage, vref:21", "speed, voltage:2, flow:2-5")
    least = modes.least_damped()
    moved = nonlinear(point, ["vref:21"], ["speed:21"])
    return {
        "linear": [linear.states, linear.inputs, linear.outputs, linear.A, linear.B, linear.C, linear.D],
        "figure": drawn(linear.plot(band=(0.3, 3.0))),
        "locus": feedback_locus(linear, linear.outputs[0], linear.inputs[0], [0, 3, 7]),
        "parameter": parameter_locus(second(), "pss", "K", [1, 4, 9], [21]),
        "areas": areas(modes, 2),
        "contributions": contributions(modes).df.head(4),
        "reduced": balanced(analyze(linear), 6).hankel,
        "shape": drawn(modes.mode(modes.swings()[0]).plot()),
        "labels": [modes.label(k) for k in least],
        "nonlinear": moved.dynamics(0.0, [0.001] * moved.nstates, [0.01]),
    }


@recorded("margins and closed loops", loose=1e-4)
def _():
    one, two = dampers()
    point = mixed_point()
    found = point.margins(one)
    relay = st.Controller.from_control(
        control.tf([40.0], [1.0, 3.0]), "deviation:1024", "order:1024@1005", name="third"
    )
    return {
        "one": found,
        "figure": drawn(found.plot()),
        "scaled": point.closed_loop(one.scaled(0.4), two).modes("0.3..2.5Hz"),
        "third": point.closed_loop(relay).modes(),
        "text": [str(one), str(two), str(relay)],
    }


def weak_grid(folder):
    """The map of a converter in place of a machine."""
    st.write(st.load("two_area").with_device("regc_c", 3), folder / "weak")
    return command("weak-grid weak --converter 3 --scr 1.5,3 --gain 1,3", page=True)(folder)


TUNE = (
    "design tune two_area_thyristor --machine 1 --machine 3 --stages 1 --gain 10 --fast 100 --damping 0.06 --checks 0"
    " --starts 1 --levels 1 --gains none --check-levels none"
)
POD = "design pod two_area_thyristor --storage 50MW --input deviation:1 --output order:1@5 --rate 60 --delay 100ms"
COMMANDS = {
    "weak-grid": weak_grid,
    "design tune": command(TUNE, as_json=False, page=True),
    "design pod": command(POD + " --damping 0.1 --out pod.toml", "pod.toml", page=True),
    "design pss": command("design pss two_area_thyristor --machine 1 --machine 3 --damping 0.05"),
    "design law": command(
        "design law two_area --classical --fault 7 --trip 7-8 --storage 40MW --observe 2 --resolution 2cyc --longest 0"
        " --workers 1 --out law.toml", "law.toml", page=True,
    ),
    "clearing-time with converters": command(
        "clearing-time two_area --classical --fault 7 --trip 7-8 --storage 40MW --resolution 2cyc --observe 1.5"
        " --longest 0 --limit 20cyc --storage-model regc --storage-mva 120%"
    ),
    "place": command(
        "place two_area --classical --contingencies wanted.toml --observe 2 --cap 150MW --workers 1",
        page=True,
    ),
}  # fmt: skip
STUDIES |= COMMANDS
SLOW |= {*COMMANDS} - {"clearing-time with converters"}
LOOSE |= dict.fromkeys(COMMANDS, 1e-3)
