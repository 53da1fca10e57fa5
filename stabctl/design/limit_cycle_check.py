"""Whether a storage law has no stable limit cycle at the operating point, by describing functions."""

from dataclasses import replace

from stabctl.controllers import Law, SampledLaw, StorageLaw
from stabctl.dynamics.operating_point import OperatingPoint
from stabctl.smallsignal.limit_cycles import limit_cycles

AT_REST = {"arm_at": 0.0, "return_time": 0.0, "max_acceleration": 0.0}  # the law as if always armed


def no_stable_limit_cycle(point: OperatingPoint, law: Law) -> bool:
    """Whether no limit cycle of 0.1 to 10 Hz is stable with a `StorageLaw`, its rate and delay included."""
    if isinstance(law, SampledLaw) and isinstance(law.law, StorageLaw):
        law = replace(law, law=replace(law.law, **AT_REST))
    elif isinstance(law, StorageLaw):
        law = replace(law, **AT_REST)
    return not any(cycle.stable for cycle in limit_cycles(point, law).cycles)
