"""Section 3: four feedback laws on one machine (Figure 7), after a 15-cycle fault that is unstable without them."""

from pathlib import Path

from reproduction import paper
from reproduction.study import Study, Table, draw, present
from stabctl.theory.feedback_laws import FeedbackResponse, compare
from stabctl.theory.omib import OMIB
from stabctl.view.figures import one_machine

TEXT = "The 15-cycle fault of section 2, with a device that absorbs P_C after clearing, according to one of four laws."
HEADS = "law", "angle (rad)", "speed (rad/s)", "damping ratio"


def study(reports: Path) -> Study:
    """The four laws, compared as in section 3."""
    found = compare(OMIB())
    laws = found.responses
    first, second, third, _ = laws
    best = max((law for law in laws if law.stable), key=lambda law: law.damping)
    remark = (
        f"The third law has the smallest swing in angle. In speed it swings {speed(third):.2f} rad/s, the second law "
        f"{speed(second):.2f} rad/s: acceleration feedback makes the machine lighter, so it returns faster."
    )
    comparisons = (
        paper.FEEDBACK.compare(f"{sum(law.stable for law in laws)} of {len(laws)}"),
        paper.FEEDBACK_LARGEST.compare(max(laws, key=lambda law: law.peak_angle).name),
        paper.FEEDBACK_SECOND_SPEED.compare(size(speed(second), speed(first))),
        paper.FEEDBACK_THIRD_ANGLE.compare(size(angle(third), min(angle(first), angle(second)))),
        paper.FEEDBACK_THIRD_SPEED.compare(size(speed(third), min(speed(first), speed(second))), remark),
        paper.FEEDBACK_SMALLEST.compare(min(laws, key=angle).name),
        paper.FEEDBACK_DAMPED.compare(best.name),
    )
    picture = draw(
        one_machine.feedback(found),
        reports / "figure07_feedback.png",
        "Four laws in the phase plane",
        alt="Speed against angle, one panel per law. With the first law the machine circles forever; with the others "
        "it spirals in, fastest with the fourth.",
        caption="Dotted: the stability region without a device.",
        of="7",
    )
    table = Table("The swing after 15 cycles", HEADS, tuple(map(row, laws)))
    return Study("Four feedback laws", "3", (TEXT,), comparisons, (table,), (picture,))


def row(law: FeedbackResponse) -> tuple[str, ...]:
    """One law in the table."""
    angles, speeds = f"{law.min_angle:.3f} to {law.peak_angle:.3f}", f"{law.min_speed:.2f} to {law.max_speed:.2f}"
    return law.name, angles, speeds, f"{law.damping:.3f}"


def angle(law: FeedbackResponse) -> float:
    """Size of the swing in angle, rad."""
    return law.peak_angle - law.min_angle


def speed(law: FeedbackResponse) -> float:
    """Size of the swing in speed, rad/s."""
    return law.max_speed - law.min_speed


def size(one: float, other: float) -> str:
    """One swing compared with another."""
    return "smaller" if one < other else "larger"


if __name__ == "__main__":
    present(study)
