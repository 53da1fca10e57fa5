"""What --help shows beside the meaning of options: panels, and of every command a short line and two examples."""

from typing import NamedTuple


class Guide(NamedTuple):
    """What a command does in one short line, and two examples without `stabctl` and its name."""

    short: str
    examples: tuple[str, str]


PANELS = {  # of options, in this order; all others come first
    "Fault": "fault clear trip at until open trip-machine load-step fault-impedance",
    "Storage": "storage storage-at characteristic lag storage-model storage-mva converter",
    "Control": "control controller deadband min-voltage",
    "PMU": "estimator engine pmu-rate pmu-noise-mrad latency-ms loss",
    "Search": "resolution limit observe longest scan step",
    "Criterion": "criteria max-angle min-frequency max-frequency frequency-delay coi",
    "Case": "set device classical verbose dyr loads machines frequency missing missing-controls motor-share "
    "conventions",
    "Running": "workers store scheduler retry seed",
    "Output": "json report out plot channels every angle-reference csv dyr-out help",
}
PANEL = {f"--{name}": panel for panel, names in PANELS.items() for name in names.split()}

GUIDES = {
    "cases": Guide("List the packaged cases.", ("", "--json")),
    "tables": Guide("List the columns of the tables of a case.", ("genrou", "genrou --csv")),
    "models": Guide("List the device models, or describe one.", ("", "genrou")),
    "import": Guide(
        "Read PSS/E, PST or MATPOWER files and report on them.",
        ("x.raw x.dyr", "x.raw --missing injection --out folder"),
    ),
    "check": Guide("List unusual data of a case.", ("wnaps", "x.raw --json")),
    "powerflow": Guide("Solve the power flow.", ("ieee39", "x.m --branches")),
    "scr": Guide("Compute short-circuit powers and ratios.", ("ieee39", "ieee39 --trip 16-17")),
    "simulate": Guide(
        "Simulate a fault, a trip or a load step.",
        ("two_area --fault 7-8@0.4 --clear 6cyc --plot run.png", "wnaps --trip-machine 14@1s --storage 5%mva"),
    ),
    "clearing-time": Guide(
        "Find the critical clearing time of a fault.",
        ("two_area --fault 7 --trip 7-8", "ieee39 --fault 26 --trip 26-29 --storage 5%mva"),
    ),
    "screen": Guide(
        "Find the clearing times of faults at all lines.", ("ieee39 --below 8cyc", "wnaps --report out --store jobs")
    ),
    "study": Guide(
        "Study the stability of a system.",
        ("ieee39 --clear 6cyc --report out", "x.raw --clear 100ms --faults lines --store jobs --out study.xlsx"),
    ),
    "place": Guide(
        "Find the cheapest storage for required clearing times.",
        ("ieee39 --classical --report out", "wnaps --sites 3 --cap 500MW"),
    ),
    "estimate": Guide(
        "Estimate rotor speeds from PMU reports.",
        ("two_area --fault 7 --clear 6cyc", "two_area --fault 7 --clear 6cyc --storage 50MW --plot speeds.png"),
    ),
    "modes": Guide("Compute modes, damping and mode shapes.", ("two_area --report out", "wnaps --band 0.1 1.0")),
    "weak-grid": Guide(
        "Map where a converter is stable in weak grids.",
        ("case --converter 3", "case --converter 3 --scr 1.2,1.5,2 --plot map.png"),
    ),
    "verify": Guide("Compare known numbers with ours.", ("", "wscc9_sauer_pai")),
    "optimum": Guide(
        "Find the best schedule of storage orders.",
        ("two_area --fault 7 --trip 7-8 --storage 50MW", "two_area --fault 7 --storage 50MW --out orders.csv"),
    ),
    "law": Guide(
        "Design the control law of storage devices.",
        ("two_area --fault 7 --trip 7-8 --storage 50MW", "ieee39 --from-screen 4 --storage 5%mva --out law.toml"),
    ),
    "tune": Guide(
        "Tune stabilizers and dampers over all networks.",
        ("two_area_thyristor --n-1 --gain 10 --fast 120", "ieee39 --n-1 --gain 20 --fast 1000 --report out"),
    ),
    "pss": Guide(
        "Tune power system stabilizers together.",
        ("two_area_thyristor --damping 0.1", "ieee39 --damping 0.05 --n-1 --out stabilizers"),
    ),
    "pod": Guide(
        "Design a power-oscillation damper.",
        (
            "two_area_thyristor --storage 50MW --input deviation:1 --output order:1@5",
            "two_area_thyristor --storage 50MW --input deviation:1 --output order:1@5 --rate 60 --delay 100ms",
        ),
    ),
    "lqr": Guide(
        "Design a linear-quadratic regulator.",
        ("two_area --storage 50MW", "two_area --storage 50MW --speed 20mHz --out k.toml"),
    ),
    "lqg": Guide(
        "Design a regulator with a state estimator.",
        ("two_area --storage 50MW --input deviation", "two_area --storage 50MW --input deviation --delay 50ms"),
    ),
    "live": Guide("Open a page that simulates as you change it.", ("wnaps", "x.raw --no-browser --port 8000")),
    "linearize": Guide(
        "Export a linear model.", ("two_area --out model.npz", "two_area --inputs vref --outputs speed --out model.mat")
    ),
    "table1": Guide("Angle and speed at clearing.", ("", "--H 5 --plot plane.png")),
    "equal-area": Guide("Critical clearing by equal areas.", ("", "--Pc 0.2 --plot areas.png")),
    "feedback": Guide("Compare four feedback laws for one fault.", ("", "--cycles 12")),
    "minimum-time": Guide("Minimum-time control of two machines.", ("", "--Pc 0.2")),
    "run": Guide(
        "Run the jobs of a study.", ("study.toml --out results.db", "study.toml --out results.db --workers 4")
    ),
    "show": Guide("Print the results of a sweep.", ("results.db", "results.db --csv rows.csv")),
}
