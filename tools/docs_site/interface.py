"""The pages of the Python reference: which name of the public interface stands where."""

import stabctl

PAGES = {
    "systems": (
        "Systems and operating points",
        "load cases Case Storage write read_psse read_matpower read_pst import_report ImportReport check UnusualData "
        "replicate register "
        "power_flow PowerFlow short_circuit ShortCircuit short_circuit_ratio ShortCircuitRatio "
        "initialize OperatingPoint verify Verification StabctlError",
    ),
    "simulation": (
        "Simulation and sweeps",
        "simulate Contingency Fault Clear Open TripMachine LoadStep SwitchShunt Criterion Trajectory "
        "run_sweep read_sweep SweepResults",
    ),
    "clearing": (
        "Clearing times and studies",
        "clearing_time ClearingTime screen Screen read_contingencies study Study Remedy Prices criteria Criteria "
        "Judged",
    ),
    "linear": (
        "Linear models and modes",
        "linearize modes closed_loop ClosedLoop DelayedModes margins Margins limit_cycles LimitCycles "
        "weak_grid WeakGrid",
    ),
    "control": ("Controllers and storage laws", "Controller Gate BangBang Feedback StorageLaw load_controller"),
    "design": ("Design", "design"),
    "estimation": ("Estimation", "estimate Estimates EstimatorControl Pmu BadPmu ProcessNoise"),
    "placement": ("Placement", "place Siting Costs SiteOption"),
}  # stem -> title, names
RESULTS = {
    "linear": (
        "smallsignal.model.Linear", "smallsignal.modes.Modes", "smallsignal.modes.Mode",
        "smallsignal.sensitivity.sensitivity", "smallsignal.sensitivity.Sensitivity", "smallsignal.sensitivity.Effect",
        "smallsignal.contributions.contributions", "smallsignal.contributions.Contributions",
        "smallsignal.contributions.Contribution",
    )
}  # fmt: skip


def where(found: object) -> str:
    """The dotted path at which a class or function is defined, such as `stabctl.model.case.Case`."""
    return f"{found.__module__}.{found.__qualname__}"  # type: ignore[attr-defined]


def page(stem: str) -> str:
    """The Markdown of a page, with a directive of mkdocstrings for every name."""
    title, names = PAGES[stem]
    parts = [f"# {title}\n"]
    for name in names.split():
        if name == "design":
            parts += [_directive(stabctl.design.__dict__[one], f"design.{one}") for one in stabctl.design.__all__]
        else:
            parts.append(_directive(getattr(stabctl, name), name))
    parts += [f"::: stabctl.{path}\n" for path in RESULTS.get(stem, ())]
    return "\n".join(parts)


def names() -> list[str]:
    """All names that have a place, in the order of the pages."""
    return [name for _, text in PAGES.values() for name in text.split()]


def _directive(of: object, name: str) -> str:
    return f'::: {where(of)}\n    options:\n      heading: "stabctl.{name}"\n      toc_label: "{name}"\n'


def documented() -> frozenset[str]:
    """The dotted paths of all names that have a place."""
    return frozenset(line[4:] for stem in PAGES for line in page(stem).splitlines() if line.startswith("::: "))
