"""Linear models and modes: exact linearization with names, eigenvalues, participation, root loci, reduction."""

from stabctl.dynamics.signals import INPUTS, OUTPUTS, Signal

from .analysis import Selected, analyze
from .areas import Areas, areas, opened
from .descriptor import Descriptor, descriptor
from .model import Linear, Model, linearize
from .modes import Mode, Modes, Part, Share
from .nonlinear import nonlinear
from .reduce import Reduced, balanced, modal
from .root_locus import Locus, feedback_locus, parameter_locus

__all__ = [
    "INPUTS", "OUTPUTS", "Areas", "Descriptor", "Linear", "Locus", "Mode", "Model", "Modes", "Part", "Reduced",
    "Selected", "Share", "Signal", "analyze", "areas", "balanced", "descriptor", "feedback_locus", "linearize", "modal",
    "nonlinear", "opened", "parameter_locus",
]  # fmt: skip
