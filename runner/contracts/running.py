"""What runs while an action takes time."""

from __future__ import annotations

from typing import Protocol


class Running(Protocol):
    """An action in execution for one actor (or for none, if global)."""

    __slots__ = ()

    def step(self, dt: float) -> bool:
        """Act on the interval from now to now + dt (s); true when the action's goal is reached at its end."""
        ...

    def stop(self) -> None:
        """Give back whatever is held, by default nothing; called once, when the action ends, is overridden or stopped."""
        return
