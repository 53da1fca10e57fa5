"""Events that end an integration."""

from typing import Any


def stops(event: Any, direction: float = 0.0, *, when: bool = True) -> None:
    """Let an event of `solve_ivp` end the integration: rising (1), falling (-1) or either (0), if `when`."""
    event.terminal, event.direction = when, direction
