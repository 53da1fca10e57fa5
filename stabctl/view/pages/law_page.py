"""The page of a designed storage law: the law, its contingencies, the use of the devices."""

from collections.abc import Iterator
from pathlib import Path

from stabctl.design.law_measurement import Measured
from stabctl.design.law_result import Judged, LawDesign

from ..figures import storage_control as figures
from . import document
from .document import svg


def page(design: LawDesign) -> str:
    """Return the page of a design."""
    rows = sorted(design.contingencies, key=lambda c: (c.training, c.reference.reach))
    return (
        document.environment()
        .get_template("law.html")
        .render(
            title=f"Storage law for {design.case}",
            design=design,
            numbers=list(_numbers(design)),
            parameters=[(p.name, p.value, p.meaning) for p in design.parameters],
            clearing=[_clearing(c) for c in rows],
            duties=[_duty(c) for c in rows],
            figure=svg(figures.plot_law_design(design), "Critical clearing times without a law, with two laws"),
        )
    )


def write(design: LawDesign, folder: str | Path, name: str = "") -> Path:
    """Write the page into a folder as law_NAME.html and return its path.

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
    return document.write(folder, f"law_{name or design.case}", page(design))


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
