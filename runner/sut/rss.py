"""`rss`: a driver that keeps the distances of Responsibility-Sensitive Safety."""

from __future__ import annotations

from dataclasses import dataclass, field

from runner.measures.rss import RssParameters, lateral_distance, longitudinal_distance, parameter_set
from runner.sut.encounters import Encounter
from runner.sut.reference import Moving, ReferenceDriver

SYSTEM = ("rss", "SafeDistance")


@dataclass
class SafeDistance(ReferenceDriver):
    """Reacts while the longitudinal and the lateral gap to a participant are both less than RSS asks for.

    The ego keeps its lane, so that laterally only the other one moves within its response time.

    Args:
        reaction: time before it brakes, s.
        parameters: name of the RSS parameter set.
    """

    reaction: float = 0.75
    parameters: str = "r157"
    _set: RssParameters = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._set = parameter_set(self.parameters)

    def dangerous(self, found: Encounter, ego: Moving) -> bool:
        """Less than both safe distances away."""
        aside = lateral_distance(abs(found.approach), 0.0, self._set.response, 0.0, self._set)
        near: bool = (found.aside < aside) & (found.gap < longitudinal_distance(ego.speed, found.speed, self._set))
        return near
