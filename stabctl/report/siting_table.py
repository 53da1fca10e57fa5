"""A siting study as a row of a table."""

from stabctl.placement.siting import Siting

HEADS = "contingencies", "uniform, MW", "linear, MW", "found, MW", "bound, MW", "of uniform, %", "sites", "runs", "s"


def row(name: str, siting: Siting) -> tuple[str, ...]:
    """Name, megawatts of the uniform fleet, of the linear stage, of the one found, of the bound; share, sites, runs."""
    found = (siting.uniform_mw, siting.linear_mw, siting.total_mw, siting.lower_bound_mw, siting.percent_of_uniform)
    numbers = ("none" if value is None else f"{value:.1f}" for value in found)
    return name, *numbers, str(len(siting.sites)), str(siting.simulations), f"{siting.wall_s:.1f}"
