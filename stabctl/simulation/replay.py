"""The compiled loop over recorded Runge-Kutta steps, which makes their stages once more."""

from stabctl._util.jit import entry
from stabctl.devices.blocks import copy
from stabctl.dynamics.perform import perform

from .method import STAGES, advance_states, clip_at_limits, freeze_disconnected, hold_at_limits
from .stepper import Cursor, at_stage
from .voltages import settle


@entry
def replay(program, places, net, run, sizes, rows, at, signals, held, clipped):
    """Make the stages of steps of the given sizes (s) that begin at recorded rows.

    Returns where it is; if steps are left, it asks for the voltages of the stage there, to be called again.
    """
    while at.step < len(sizes):
        h, step = sizes[at.step], at.step
        for stage in range(at.stage, STAGES):
            if not at.solved:
                if stage == 0:
                    for k in range(rows.shape[1]):
                        run.s[k] = rows[step, k]
                    copy(run.s, run.part.x)
                copy(run.volt, run.solve.before)
                if not settle(program, places, net, run):
                    return at_stage(stage, True, True, at)
            perform(program.sweep, program.w, program.k, run.s, run.f, net.island)
            copy(run.s, signals[step, stage])
            for k in range(len(places.limited)):
                held[step, stage, k] = run.f[places.limited[k]]
            hold_at_limits(run, places)
            for k in range(len(places.limited)):
                held[step, stage, k] = 1.0 if held[step, stage, k] != 0 and run.f[places.limited[k]] == 0 else 0.0
            if not net.whole:
                freeze_disconnected(places, net, run)
            advance_states(stage, h, run)
            for k in range(len(places.limited)):
                clipped[step, stage, k] = run.s[places.limited[k]]
            clip_at_limits(run.s, places)
            for k in range(len(places.limited)):
                free, kept = clipped[step, stage, k], run.s[places.limited[k]]
                clipped[step, stage, k] = 1.0 if free > kept else -1.0 if free < kept else 0.0
            at = at_stage(stage + 1, True, False, at)
        at = Cursor(at.step + 1, 0, begin=0.0, end=1.0, row=-1, parts=1, decided=True, solved=False)
    return at
