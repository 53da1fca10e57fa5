"""The parameters of a storage law in text."""

from collections.abc import Iterator
from typing import NamedTuple

from stabctl.controllers import Law, SampledLaw, StorageLaw


class Parameter(NamedTuple):
    """A parameter: what it is called, its value with the unit, what it does."""

    name: str
    value: str
    meaning: str


def parameters(law: Law) -> tuple[Parameter, ...]:
    """The parameters of a storage law that have an effect.

    Raises
    ------
    TypeError
        If it is another law.
    """
    inner = law.law if isinstance(law, SampledLaw) else law
    if not isinstance(inner, StorageLaw):
        raise TypeError(f"{type(inner).__name__} is not a StorageLaw")
    found = list(_of(inner))
    if isinstance(law, SampledLaw):
        found.append(Parameter("rate", f"{law.rate}/s", "frames per second"))
        found += [Parameter("delay", f"{1e3 * law.delay:g} ms", "time from measurement to output")] if law.delay else []
    return tuple(found)


def _of(law: StorageLaw) -> Iterator[Parameter]:
    groups = ", ".join("+".join(map(str, group)) for group in law.groups)
    yield Parameter("groups", groups or "none", "machines whose devices use the speed and angle of the group")
    yield Parameter("angle gain", f"{law.angle_gain:g} 1/s", "k of the surface w + k Δδ")
    if law.slope:
        yield Parameter("slope", f"{law.slope:g} Hz", "surface beyond the deadband at which the power is full")
    else:
        yield Parameter("relay", "yes", "full power beyond the deadband")
    yield Parameter("deadband", f"{law.deadband:g} Hz", "surface without action")
    if law.min_voltage:
        yield Parameter("lowest voltage", f"{law.min_voltage:g} pu", "voltage below which a device idles")
    if law.max_acceleration:
        yield Parameter("fastest", f"{law.max_acceleration:g} Hz/s", "rate of the deviation above which a device idles")
    if law.arm_at:
        yield Parameter("armed at", f"{law.arm_at:g} Hz", "surface beyond which the law is armed")
        yield Parameter("time-out", f"{law.timeout:g} s", "time for which it stays armed")
    if law.return_time:
        yield Parameter("return", f"{law.return_time:g} s", "time constant with which idle devices return their energy")
