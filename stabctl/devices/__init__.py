"""One device per file: Par (constants), State, Input as NamedTuples; `output` and `flow` as scalar kernels.

ALL lists every device with states that comes from a case's tables; the file name is the name of its table.
"""

from types import ModuleType

from .exciters import exdc2, exst3, sexs
from .governors import tgov
from .machines import gencls, genrou
from .stabilizers import pss

ALL: dict[str, ModuleType] = {m.__name__.rpartition(".")[2]: m for m in (gencls, genrou, sexs, exst3, exdc2, pss, tgov)}
