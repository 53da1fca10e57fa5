"""The compiled evaluation behind the exact derivatives, in a file of its own: no device is part of it."""

from stabctl._util.jit import entry

from .perform import perform, perform_local


@entry
def evaluate(p, starts, s, f, on):
    """Bring the outputs of s (complex) up to date and write the blocks of all devices into f."""
    perform(p.sweep, p.w, p.k, s, f, on)
    perform_local(p.step, starts, p.w, p.k, s, f, on)
