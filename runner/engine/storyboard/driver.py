"""Driver of the ego, as the simulation asks it: in each step for a decision, or for the world's own
driver.

Drivers are kinds of it in `runner.systems.drivers`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from runner.engine.compile.protocols import Run
    from runner.engine.participants.entity import Entity
    from runner.engine.worlds.base import DriverRequest


@dataclass(frozen=True, slots=True)
class Pose:
    """Pose that a system under test with a vehicle model of its own gives the ego at the end of
    this step.

    The ego is put there as it is: no limit of its `Performance` is applied. A pose that no vehicle
    can reach makes the run inconclusive (cause `performance`). Height, pitch and roll are those of
    the road.

    Args:
        x, y: position of the reference point (vehicles: rear axle centre) in the world frame, m.
        h: heading, mathematical, rad.
        speed: along the heading, signed, m/s; None for that of the displacement.
        reason: why, for the event log, where the system intervenes.

    Example:
        >>> import xosc_toolchain as xt
        >>> xt.Pose(x=10.0, y=0.0, h=0.0, speed=12.0).speed
        12.0
    """

    x: float
    y: float
    h: float
    speed: float | None = None
    reason: str = ""


class Decision(NamedTuple):
    """Decision of a driver on the coming step.

    Args:
        speed: at its end, m/s.
        steering: angle of the front wheels, rad; None to go on along lane or path.
        pose: where it is at its end; None to move there by speed and steering.
    """

    speed: float
    steering: float | None = None
    pose: Pose | None = None


class EgoDriver(ABC):
    """Driver of the ego in its control domains.

    Args:
        handed_over: whether it drives from the beginning.
    """

    scripted = True
    """whether the scenario says how fast the ego is; if not, it keeps its speed when the world's
    own driver lets go of it"""

    def __init__(self, handed_over: bool) -> None:
        self.longitudinal = handed_over
        self.lateral = handed_over
        self.commanded = {"any": 0, "longitudinal": 0, "lateral": 0}
        """steps in which it was in command of the ego, by domain"""

    def count(self, longitudinal: bool, lateral: bool) -> None:
        """Count a step in which it was in command of these domains."""
        self.commanded["any"] += longitudinal or lateral
        self.commanded["longitudinal"] += longitudinal
        self.commanded["lateral"] += lateral

    def hand_over(self, domains: Mapping[str, bool]) -> None:
        """Let it drive, or no longer drive, in control domains (ActivateControllerAction)."""
        self.longitudinal = domains.get("longitudinal", self.longitudinal)
        self.lateral = domains.get("lateral", self.lateral)

    def request(self, ego: Entity) -> DriverRequest | None:
        """Return the request to the world's own driver; None if it does not drive the ego."""
        return None

    def answer(self, driven: bool) -> None:
        """Whether the world's own driver has the ego, as requested."""
        return

    @abstractmethod
    def decide(self, ego: Entity, run: Run) -> Decision:
        """Return the ego's motion in the coming step, unless the world's own driver has it."""
