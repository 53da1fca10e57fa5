"""Modes: eigenvalues, participation, shapes, residues, root loci, coherent areas, reduced models."""

from .analysis import Mode, Modes, Part, Selected, Share, analyse
from .areas import Areas, areas, opened
from .locus import Locus, feedback_locus, parameter_locus
from .reduce import Reduced, balanced, modal

__all__ = [
    "Areas", "Locus", "Mode", "Modes", "Part", "Reduced", "Selected", "Share",
    "analyse", "areas", "balanced", "feedback_locus", "modal", "opened", "parameter_locus",
]  # fmt: skip
