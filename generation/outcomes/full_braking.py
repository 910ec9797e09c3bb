"""The bound of what braking can do, full braking from the instant at which a manoeuvre begins."""

from __future__ import annotations

from dataclasses import dataclass, field

from runner.sut.base import Control, Observation, Participant

_CHANGED = 1e-3
"""Change of a speed (m/s) or of a place in the lane (m) from which somebody is doing something"""


@dataclass
class FullBraking:
    """Brakes fully from the first instant at which anyone changes speed or place in the lane, the ego itself included.

    It is no system that could be built: it knows that whatever begins will be dangerous. What it hits, braking does not avoid.

    Args:
        brake: deceleration, m/s².
    """

    brake: float = 9.0
    _before: dict[str, tuple[float, float]] = field(init=False, repr=False, default_factory=dict)
    _begun: bool = field(init=False, repr=False, default=False)

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Forget the last run."""
        self._before, self._begun = {}, False

    def control(self, observation: Observation, dt: float) -> Control:
        """Nothing until the manoeuvre begins, then full braking."""
        now = {each.name: _state(observation, each) for each in (observation.ego, *observation.others)}
        self._begun = self._begun or any(
            _changed(self._before[name], state) for name, state in now.items() if name in self._before
        )
        self._before = now
        return Control(-self.brake, reason="the manoeuvre has begun") if self._begun else Control()


def _state(observation: Observation, who: Participant) -> tuple[float, float]:
    """Speed (m/s), and offset (m) from the middle of the lane; 0 off the roads."""
    network = observation.network
    return who.speed, network.locate(who.x, who.y, who.z).offset if network is not None else 0.0


def _changed(before: tuple[float, float], now: tuple[float, float]) -> bool:
    return any(abs(a - b) > _CHANGED for a, b in zip(before, now, strict=True))
