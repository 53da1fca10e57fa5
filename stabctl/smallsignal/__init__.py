"""Linear models and modes: exact linearization with names, eigenvalues, participation, root loci, reduction."""

from stabctl.dynamics.signal_kinds import INPUTS, OUTPUTS
from stabctl.dynamics.signals import Signal

from .analysis import analyze
from .areas import Areas, areas, opened
from .descriptor import Descriptor, descriptor
from .locus import Locus, feedback_locus, parameter_locus
from .mode import Mode, Part, Share
from .model import Linear, Model, linearize
from .modes import Modes
from .nonlinear import nonlinear
from .reduce import Reduced, balanced, modal
from .some_modes import Selected

__all__ = [
    "INPUTS", "OUTPUTS", "Areas", "Descriptor", "Linear", "Locus", "Mode", "Model", "Modes", "Part", "Reduced",
    "Selected", "Share", "Signal", "analyze", "areas", "balanced", "descriptor", "feedback_locus", "linearize", "modal",
    "nonlinear", "opened", "parameter_locus",
]  # fmt: skip
