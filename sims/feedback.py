"""Section 3 on one machine (Figure 7): four feedback laws on the 15-cycle fault that is lost without them."""

from pathlib import Path

from stabctl.plotting import phase_plane
from stabctl.report import paper
from stabctl.report.study import Study, Table, draw
from stabctl.report.study_console import present
from stabctl.theory.feedback_laws import FeedbackResponse, compare
from stabctl.theory.omib import OMIB

TEXT = "The 15-cycle fault of section 2, with a device that absorbs P_C by one of four laws from clearing on."
HEADS = "law", "angle, rad", "speed, rad/s", "damping ratio"


def study(reports: Path) -> Study:
    """The four laws compared in the words of section 3."""
    laws = compare(OMIB())
    first, second, third, _ = laws.responses
    damped = max((r for r in laws.responses if r.stable), key=lambda r: r.damping)
    remark = (
        f"In angle the third law swings least of the three; in speed it swings {speed(third):.2f} rad/s, the second "
        f"{speed(second):.2f}. With acceleration fed back the machine is lighter, so it returns faster."
    )
    rows = (
        paper.FEEDBACK.beside(f"{sum(r.stable for r in laws.responses)} of {len(laws.responses)}"),
        paper.FEEDBACK_WIDEST.beside(max(laws.responses, key=lambda r: r.peak_angle).name),
        paper.FEEDBACK_SECOND_SPEED.beside(width(speed(second), speed(first))),
        paper.FEEDBACK_THIRD_ANGLE.beside(width(angle(third), min(angle(first), angle(second)))),
        paper.FEEDBACK_THIRD_SPEED.beside(width(speed(third), min(speed(first), speed(second))), remark),
        paper.FEEDBACK_NARROWEST.beside(min(laws.responses, key=angle).name),
        paper.FEEDBACK_DAMPED.beside(damped.name),
    )
    numbers = tuple(
        (
            r.name,
            f"{r.min_angle:.3f} to {r.peak_angle:.3f}",
            f"{r.min_speed:.2f} to {r.max_speed:.2f}",
            f"{r.damping:.3f}",
        )
        for r in laws.responses
    )
    picture = draw(
        phase_plane.feedback(laws),
        reports,
        "figure07_feedback.png",
        "Four laws in the phase plane",
        "Speed against angle, a panel per law: the first circles for ever, the others spiral in, the fourth quickest.",
        "Dotted the stability region without a device.",
        "7",
    )
    tables = (Table("The swing after 15 cycles", HEADS, numbers),)
    return Study("Four feedback laws", "3", (TEXT,), rows, tables, (picture,))


def angle(r: FeedbackResponse) -> float:
    """Width of the swing in angle, rad."""
    return r.peak_angle - r.min_angle


def speed(r: FeedbackResponse) -> float:
    """Width of the swing in speed, rad/s."""
    return r.max_speed - r.min_speed


def width(one: float, other: float) -> str:
    """One swing against another."""
    return "narrower" if one < other else "wider"


if __name__ == "__main__":
    present(study)
