"""Who is on the road, and what is said of an ego that leaves it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runner.interpreter.simulation import Simulation
    from runner.participants.entity import Entity


def is_off_road(entity: Entity, sim: Simulation) -> bool:
    """Whether an entity's reference point is on no lane of the road network; never where there is no road network."""
    if entity.on_lane and entity.section is not None:
        lane = entity.section.lanes[entity.lane]
        if lane.type != "none" and abs(entity.offset) <= lane.width(entity.s) / 2:
            return False
    point = sim.road_point(entity)
    return point is not None and sim.network is not None and not sim.network.on_road(point)


class Departures:
    """Notes in the event log when the ego leaves the road, is back on it, and stops where it ends; to be called once a step."""

    def __init__(self, ego: Entity | None) -> None:
        self._ego = ego
        self._off = self._ended = False
        self._first: dict[str, str] = {}

    @property
    def remarks(self) -> tuple[str, ...]:
        """One sentence on the first time that it left the road, and one on the first time that it came to its end."""
        return tuple(self._first.values())

    def __call__(self, sim: Simulation) -> None:
        """Look at the ego, if there is one."""
        ego = self._ego
        if ego is None or not (ego.active and ego.placed):
            return
        off, ended = is_off_road(ego, sim), ego.at_road_end
        if off and not self._off:
            self._remark(sim, ego, "offRoad", "has left the road")
        elif self._off and not off:
            sim.note("onRoad", ego.name, "is back on the road")
        if ended and not self._ended:
            self._remark(sim, ego, "roadEnd", "has come to the end of the road")
        self._off, self._ended = off, ended

    def _remark(self, sim: Simulation, ego: Entity, kind: str, text: str) -> None:
        sim.note(kind, ego.name, text)
        self._first.setdefault(kind, f"{ego.name} {text} at {sim.time:.2f} s")
