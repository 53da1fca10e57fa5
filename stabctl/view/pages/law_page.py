"""The page of a designed storage law: the law, its contingencies, the use of the devices."""

from collections.abc import Iterator
from pathlib import Path

from stabctl.design.law_measurement import Measured
from stabctl.design.law_result import Judged, LawDesign

from ..figures import storage_control as figures
from . import pattern
from .pattern import Page, Section, figure, table


def page(design: LawDesign, name: str = "") -> Page:
    """Return the page of a design."""
    rows = sorted(design.contingencies, key=lambda c: (c.training, c.reference.reach))
    heads = "fault", "without a law (cycles)", "paper's law (cycles)", "designed law (cycles)", "gain (cycles)"
    duties = "fault", "energy (kWh)", "switchings per swing", "COI (Hz)", "voltage (pu)", "not returned (kWh)"
    return Page(
        f"{name or design.case}_law",
        f"Storage law for {design.case}",
        design.remarks(),
        list(_numbers(design)),
        [
            Section(
                "Law",
                [
                    pattern.made("law_diagram.svg"),
                    table(("parameter", "value", "meaning"), [(p.name, p.value, p.meaning) for p in design.parameters]),
                ],
            ),
            Section(
                "Clearing times",
                [
                    figure(
                        figures.plot_law_design(design),
                        "Critical clearing times.",
                        "The law was tuned with the training contingencies only.",
                    ),
                    table(
                        (*heads, "machines that lose synchronism"),
                        map(_clearing, rows),
                        "Without a law the devices are idle. The paper's law gives full power by the sign of the speed "
                        "of a machine against the others. Machines that lose synchronism: the group just beyond the "
                        "critical clearing time without a law.",
                    ),
                ],
            ),
            Section(
                "Operation of the devices",
                [
                    table(
                        duties,
                        map(_duty, rows),
                        "Paper's law / designed law, each cleared at its own critical time. Energy: the range of the "
                        "energy of every device, summed. Switchings: sign changes of an order between two rises of the "
                        "speed of its machine above that of the others. COI: largest deviation of the frequency of the "
                        "center of inertia. Voltage: the lowest bus voltage at the end. Not returned: energy by which "
                        f"the devices differ from the initial one {design.limits.return_within:g} s later, summed.",
                    )
                ],
            ),
        ],
    )


def write(design: LawDesign, folder: str | Path, name: str = "") -> Path:
    """Write the page into a folder as NAME_law.html and return its path.

    Parameters
    ----------
    design
        The result of a design.
    folder
        Folder of the page, created if it is missing.
    name
        Name in place of the case's.

    Raises
    ------
    StudyError
        If the folder cannot be created or written to.

    Examples
    --------
    >>> options = {"resolution": "4cyc", "scan": 0, "observe": "1s", "longest": 0}
    >>> found = st.design.law(st.load("two_area").classical(), "7-8@0.4", storage="50MW", **options)
    >>> found.report("pages").exists()
    True
    """
    return pattern.write(page(design, name), folder)


def _numbers(design: LawDesign) -> Iterator[tuple[str, str]]:
    """The numbers at the top of the page."""
    gain = design.gain
    where = "unseen" if design.unseen else "training"
    yield f"{gain.median:+.3g}", f"cycles over the paper's law, median of {gain.number} {where}"
    yield f"{gain.lower:+.3g} to {gain.upper:+.3g}", "cycles, quartiles"
    yield f"{gain.least:+.3g}", "cycles, worst contingency"


def _clearing(c: Judged) -> tuple[str, ...]:
    cycles = (_cycles(m) for m in (c.none, c.reference, c.designed))
    return figures.named(c), *cycles, f"{c.gain:+.3f}", "+".join(map(str, c.group.machines)) if c.group else ""


def _duty(c: Judged) -> tuple[str, ...]:
    after = c.designed.later
    pairs = zip(_use(c.reference), _use(c.designed), strict=True)
    left = "" if after is None else f"{after.left_kwh:.1f}" + ("" if after.stable else ", unstable")
    return figures.named(c), *(f"{one} / {other}" for one, other in pairs), left


def _use(m: Measured) -> tuple[str, ...]:
    return f"{m.energy_kwh:.1f}", str(m.duty.switchings), f"{m.duty.coi_hz:.3f}", f"{m.duty.voltage:.3f}"


def _cycles(m: Measured) -> str:
    return {"unstable_at_zero": "none", "stable_at_limit": f"over {m.reach:g}"}.get(m.status, f"{m.reach:.3f}")
