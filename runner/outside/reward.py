"""What a learner is rewarded for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from runner.sut.base import Participant

_STRONG = 8.0
"""m/s², with which `effort` is measured: a fully pressed brake"""


class Transition(NamedTuple):
    """One step of the ego.

    Args:
        ego: as it is at the end of the step.
        target_speed: speed that the scenario asks of it, m/s.
        dt: length of the step, s.
        collided: whether it has touched somebody.
        departed: whether it has left the road.
    """

    ego: Participant
    target_speed: float
    dt: float
    collided: bool
    departed: bool


class RewardFunction(Protocol):
    """Gives the reward of a step."""

    def __call__(self, step: Transition) -> float: ...


@dataclass(frozen=True)
class Reward:
    """Drive at the speed that is asked for, gently, and touch nobody.

    A step of dt seconds is worth

        dt · (progress · min(v, v*) / v* − effort · (a / 8 m/s²)²) − collision − departure

    with the ego's speed v along its heading, the target speed v* (without one there is no progress to reward) and acceleration
    a; the last two count in the step in which the ego touches somebody or leaves the road.

    Args:
        progress: of a second at the target speed.
        effort: of a second at 8 m/s².
        collision, departure: of the end.
    """

    progress: float = 1.0
    effort: float = 0.5
    collision: float = 20.0
    departure: float = 20.0

    def __call__(self, step: Transition) -> float:
        """The reward of a step."""
        target = step.target_speed
        share = min(step.ego.speed / target, 1.0) if target > 0.0 else 0.0
        rate = self.progress * share - self.effort * (step.ego.acceleration / _STRONG) ** 2
        return step.dt * rate - self.collision * step.collided - self.departure * step.departed
