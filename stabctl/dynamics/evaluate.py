"""The compiled evaluation of the exact derivatives, in a separate file because it does not depend on any device."""

from stabctl._util.jit import entry

from .perform import perform, perform_local


@entry
def evaluate(p, starts, s, f, on):
    """Update the outputs in s (complex) and write the derivative blocks of all devices to f."""
    perform(p.sweep, p.w, p.k, s, f, on)
    perform_local(p.step, starts, p.w, p.k, s, f, on)
