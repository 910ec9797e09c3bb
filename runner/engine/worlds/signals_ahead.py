"""Traffic lights on the way ahead, and the lines at which they hold.

A signal holds at its s, on the lanes of its validity, else in the direction of its orientation. On
the connecting roads of a junction, to which signal references point that stand for the whole
junction, it holds where the junction is entered. Drivers and criteria read the lines here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from runner.engine.worlds.aspects import STOPS, Aspect

if TYPE_CHECKING:
    from runner.engine.participants.entity import Guide
    from xodr.graph.network import RoadNetwork
    from xodr.model import RoadPoint, Signal
    from xodr.model.road import Road

_FOR_WALKERS = "1000002"
"""OpenDRIVE's type of lights for pedestrians"""
_FAR = 300.0
"""Distance (m) within which lights are seen"""
_COMFORTABLE = 4.0
"""Deceleration (m/s²) up to which a stop at a yellow light is safe"""
_SHORTEST = 1e-3
"""Length (m) that each road counts at least, so that a circle of roads without length ends"""


class SignalAhead(NamedTuple):
    """A traffic light on the way ahead.

    Args:
        signal: its id in the road network.
        kind: its type in the road network (`1000001`: three lamps).
        distance: from the reference point to its stop line, along the lane, m.
        state: as the scenario writes it; None without one.
        aspect: meaning of the state; None without one, or where it is not understood.
    """

    signal: str
    kind: str
    distance: float
    state: str | None
    aspect: Aspect | None


class StopLine(NamedTuple):
    """Stop line at which a light forbids to go on: its id, and the distance (m) from the reference
    point along the lane."""

    signal: str
    distance: float


class SignalLine(NamedTuple):
    """Line of a signal, or of a reference to one, on a road."""

    signal: Signal
    s: float
    orientation: str
    validity: tuple[tuple[int, int], ...]

    def holds(self, lane_id: int, forwards: bool) -> bool:
        """Whether it is for traffic on a lane in a direction; lanes that a file names say more than
        an orientation."""
        if self.validity:
            return any(
                low <= lane_id <= high or high <= lane_id <= low for low, high in self.validity
            )
        return self.orientation not in ("+", "-") or (self.orientation == "+") == forwards


def is_light(signal: Signal) -> bool:
    """Whether a signal is a light for vehicles."""
    return signal.dynamic and signal.type != _FOR_WALKERS


def signal_lines(
    network: RoadNetwork, road: Road, wanted: Callable[[Signal], bool]
) -> Iterator[SignalLine]:
    """Lines of certain signals and of references to them on a road."""
    for signal in road.signals:
        if wanted(signal):
            yield SignalLine(signal, signal.s, signal.orientation, signal.validity)
    for reference in road.signal_references:
        referred = network.signals.get(reference.signal_id)
        if referred is not None and wanted(referred):
            yield SignalLine(referred, reference.s, reference.orientation, reference.validity)


def stop_line(signals: Sequence[SignalAhead], speed: float) -> StopLine | None:
    """The nearest line at which a light forbids to pass at a speed (m/s); None without one.

    A yellow light does where a comfortable stop is possible.
    """
    for signal in signals:
        safe = signal.distance >= speed * speed / (2.0 * _COMFORTABLE)
        if signal.aspect in STOPS or (signal.aspect is Aspect.YELLOW and safe):
            return StopLine(signal.signal, signal.distance)
    return None


class _Ahead(NamedTuple):
    """A light ahead; `at` (m) is its distance plus the progress on the present road."""

    signal: Signal
    at: float


class SignalHorizon:
    """Finds the traffic lights ahead of one road user, and remembers them while it is on one lane
    of one road.

    Args:
        network: the roads.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network
        self.empty = not any(is_light(signal) for signal in network.signals.values())
        """Whether the roads have no light at all"""
        self._key: tuple[object, ...] = ()
        self._found: list[_Ahead] = []

    def ahead(
        self,
        point: RoadPoint,
        forward: bool,
        guide: Guide | None,
        states: Mapping[str, str],
        aspects: Mapping[str, Aspect | None],
    ) -> list[SignalAhead]:
        """The lights within some 300 m, the nearest first.

        Args:
            point: where the reference point is.
            forward: whether it moves towards +s.
            guide: decides at junctions; without one the straightest way is meant.
            states, aspects: by signal.
        """
        key = (point.road_id, point.lane_id, point.layer, forward, guide)
        if key != self._key:
            self._key, self._found = (
                key,
                sorted(self._look(point, forward, guide), key=lambda signal: signal.at),
            )
        gone = point.s if forward else -point.s
        return [
            SignalAhead(
                signal.id, signal.type, at - gone, states.get(signal.id), aspects.get(signal.id)
            )
            for signal, at in self._found
            if 0.0 <= at - gone <= _FAR
        ]

    def _look(self, point: RoadPoint, forward: bool, guide: Guide | None) -> Iterator[_Ahead]:
        """All lights on the present road, and within reach of its end."""
        network = self._network.on(point.layer)
        choose = guide.foresee if guide is not None else network.straightest
        road, began = network.road(point.road_id), True
        begin = 0.0 if forward else -road.length
        reach = begin + road.length + _FAR
        while begin < reach:
            for line in signal_lines(network, road, is_light):
                inside = road.junction_id is not None
                if inside and began:  # its line was where the junction was entered
                    continue
                lane = _lane_at(network, point, line.s, forward)
                if line.holds(lane, forward) and (road.direction(lane, line.s) > 0) == forward:
                    way = 0.0 if inside else line.s if forward else road.length - line.s
                    yield _Ahead(line.signal, begin + way)
            end = road.length if forward else 0.0
            lane = _lane_at(network, point, end, forward)
            link = choose(
                network.lane_point(road.id, lane, end),
                forward,
                network.links(road.id, lane, forward),
            )
            if link is None:
                return
            begin += road.length + _SHORTEST
            began, forward, road = False, link.at_start, network.road(link.road_id)
            point = network.lane_point(link.road_id, link.lane_id, 0.0 if forward else road.length)


def _lane_at(network: RoadNetwork, point: RoadPoint, s: float, forward: bool) -> int:
    """The lane that a point's lane leads to at another s of its road; its own behind the point."""
    road = network.road(point.road_id)
    if len(road.sections) == 1 or ((s > point.s) != forward and s != point.s):
        return point.lane_id
    inside = min(max(s, 0.0), road.length)
    start = network.lane_point(point.road_id, point.lane_id, point.s)
    reached = network.travel(start, abs(inside - point.s), forward).point
    return reached.lane_id if reached.road_id == road.id else point.lane_id
