"""What controls storage and the system in the simulations of a siting."""

from collections.abc import Mapping, Sequence
from typing import get_args

from stabctl.controllers import BangBang, Controller, Law
from stabctl.errors import StudyError
from stabctl.estimation.estimator_control import EstimatorControl
from stabctl.estimation.estimators import EstimatorName
from stabctl.simulation.control import Control, acting, with_law
from stabctl.simulation.sampled import Sampled


def acting_in(control: Control) -> list[Law | Controller]:
    """What acts in every simulation: a law, unless controllers give the orders, and the controllers."""
    parts = acting(control)
    if parts.pilots:
        raise StudyError("A fleet is sized with true speeds; give the estimator as validate='kalman', for example.")
    return with_law([*([parts.law] if parts.law else []), *parts.controllers], BangBang())


def others(
    validate: EstimatorName | Mapping[str, Sampled] | None, acts: Sequence[Law | Controller]
) -> Mapping[str, Sampled]:
    """Other controllers by name."""
    if validate is None or isinstance(validate, Mapping):
        return validate or {}
    if validate not in get_args(EstimatorName):
        raise StudyError(f"validate = {validate!r} is not an estimator; choose {', '.join(get_args(EstimatorName))}.")
    return {validate: EstimatorControl(acts, validate)}
