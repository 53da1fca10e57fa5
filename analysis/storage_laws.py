"""Storage laws: clearing times without a law, with the paper's law, and with a law designed for the system."""

from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import stabctl as st
from reproduction.study import Kept, Study, Table, Tell, present
from stabctl.design import LawDesign, LawLimits

FULL = True
HEADS = (
    "system",
    "storage",
    "fault",
    "lowest voltage (pu)",
    "none",
    "paper's law",
    "designed",
    "50 ms late",
    "PMU, Kalman",
    "optimum",
    "kWh",
    "COI (Hz)",
)
GAINS = ("system", "unseen", "median gain", "quartiles", "range", "below", "kWh of the paper's law", "kWh designed")
TEXT = (
    "A law is designed for one fault, with ideal signals; the column 50 ms late has the same law at 60 frames per "
    "second with a delay of 50 ms, and PMU, Kalman has it behind an estimator, to which the reports of other machines "
    "are 50 ms late. The optimum is a schedule that knows the fault. Clearing times in cycles.",
    "A law is designed with half of the 20 most critical faults of a screen (devices of 5 % of every machine's MVA); "
    "gains in cycles over the paper's law in the other half. Below: contingencies more than 0.125 cycles below the "
    "paper's law. Energies: median of the unseen.",
)


class Task(NamedTuple):
    """A system, its storage, and the fault that a law is designed for."""

    case: str
    storage: str
    fault: str
    trip: str = ""
    min_voltage: float = 0.5
    rate: int = 60  # orders per second of the optimum
    window: str = "3s"  # of the optimum, from clearing on

    @property
    def name(self) -> str:
        """The task in words."""
        return f"{self.case}, {self.storage}, {self.min_voltage:g} pu"


TASKS = (
    Task("two_area", "50MW", "7-8@0.4", min_voltage=0.8),
    Task("two_area", "50MW", "7-8@0.4"),
    Task("two_area", "27MW", "7-8@0.4"),
    Task("wnaps_paper", "5%mva", "83", "83-33", rate=30, window="2s"),
    Task("wnaps_paper", "15%mva", "83", "83-33", rate=30, window="2s"),
)
SCREENED = "ieee39", "wnaps"


def study(reports: Path) -> Study:
    """Single faults, and the unseen halves of two screens."""
    kept = Kept(__file__, reports)
    single = Table("Laws for one fault", HEADS, tuple(_single(task, kept) for task in TASKS))
    screened = {name: _screened(name, kept) for name in SCREENED}
    pages = {f"storage law for {name}": found.report(reports).name for name, found in screened.items()}
    tables = single, Table("Gain in unseen contingencies", GAINS, tuple(map(_gains, screened.values())))
    return Study("Storage laws", text=TEXT, tables=tables, pages=pages)


def _single(task: Task, kept: Kept) -> tuple[str, ...]:
    """The row of a law for one fault."""
    fault = st.Contingency(task.fault, trip=task.trip or ())
    base = st.load(task.case).initialize(storage=task.storage)
    gated, limits = st.BangBang(min_voltage=task.min_voltage), LawLimits(min_voltage=task.min_voltage)
    found = st.design.law(base, fault, limits=limits, store=kept.folder)
    (c,) = found.contingencies

    def cleared(control: Any, tell: Tell) -> float:
        done = base.clearing_time(fault, control=control, observe="10s", progress=lambda ran: tell(f"{ran.cycles:g}"))
        return done.cycles or 0.0

    def optimal(tell: Tell) -> float:
        options: Any = {"law": gated, "rate": task.rate, "window": task.window}
        return st.design.optimum(base, fault, **options, progress=lambda one: tell(f"{one.cycles:g} cycles")).cycles

    estimated = st.EstimatorControl(found.law)
    late = kept(f"{task.name}, 50 ms late", partial(cleared, found.law.sampled(60, "50ms")))
    behind = kept(f"{task.name}, Kalman", partial(cleared, estimated))
    best = kept(f"{task.name}, optimum", optimal)
    use = f"{c.designed.energy_kwh:.0f}", f"{c.designed.duty.coi_hz:.3f}"
    cycles = (f"{x:g}" for x in (c.none.reach, c.reference.reach, c.designed.reach, late, behind, best))
    where = f"{task.fault} {task.trip}".strip()
    return task.case, task.storage, where, f"{task.min_voltage:g}", *cycles, *use


def _screened(name: str, kept: Kept) -> LawDesign:
    """A law for half of the most critical faults of a screen."""
    base = st.load(name).initialize(storage="5%mva")
    return st.design.law(base, base.screen(store=kept.folder), store=kept.folder)


def _gains(found: LawDesign) -> tuple[str, ...]:
    """The row of a law for the faults of a screen."""
    gain, unseen = found.gain, found.df[~found.df["training"]]
    energy = (f"{unseen[f'{name}_kwh'].median():.0f}" for name in ("paper", "designed"))
    spread = f"{gain.lower:+g} to {gain.upper:+g}", f"{gain.least:+g} to {gain.most:+g}"
    return found.case, str(gain.number), f"{gain.median:+g}", *spread, str(gain.below), *energy


if __name__ == "__main__":
    present(study)
