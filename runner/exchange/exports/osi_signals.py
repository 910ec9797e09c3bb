"""Traffic signs and lights of OSI ground truth, and the lamps of vehicles.

Sources: ASAM OSI 3.8, TrafficSign, TrafficLight, MovingObject.VehicleClassification.LightState.
Each lamp of a light is a TrafficLight of its own; a light to which the scenario gives no state has
the mode unknown.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import itemgetter
from typing import Any

from runner.engine.worlds.sumo_translation import (
    GREEN,
    OFF,
    RED,
    RED_YELLOW,
    YELLOW,
    YIELD,
    link_state,
)
from runner.recording import LogEntry, light_states, signal_states
from xodr import RoadNetwork
from xodr.lookup.lanelets import Key
from xodr.lookup.signals import SignalPlace, arrow, for_walkers, lamps, signal_places

LIT: Mapping[str, tuple[str, ...]] = {
    RED: ("red",),
    RED_YELLOW: ("red", "yellow"),
    YELLOW: ("yellow",),
    YIELD: ("yellow",),
    GREEN: ("green",),
    OFF: (),
}
"""Lit lamps by link state; the yellow one flashes in `YIELD`."""

_SIGN_TYPES = {
    "101": "DANGER_SPOT", "102": "RIGHT_BEFORE_LEFT_NEXT_INTERSECTION", "123": "ROAD_WORKS",
    "131": "ATTENTION_TRAFFIC_LIGHT",
    "133": "PEDESTRIANS", "136": "CHILDREN_CROSSING", "201": "RAILWAY_TRAFFIC_PRIORITY",
    "205": "GIVE_WAY", "206": "STOP",
    "208": "PRIORITY_TO_OPPOSITE_DIRECTION", "215": "ROUNDABOUT", "267": "DO_NOT_ENTER",
    "274": "SPEED_LIMIT_BEGIN",
    "274.1": "SPEED_LIMIT_ZONE_BEGIN", "274.2": "SPEED_LIMIT_ZONE_END",
    "275": "MINIMUM_SPEED_BEGIN",
    "276": "OVERTAKING_BAN_BEGIN", "278": "SPEED_LIMIT_END", "280": "OVERTAKING_BAN_END",
    "282": "ALL_RESTRICTIONS_END",
    "301": "RIGHT_OF_WAY_NEXT_INTERSECTION", "306": "RIGHT_OF_WAY_BEGIN", "307": "RIGHT_OF_WAY_END",
    "308": "PRIORITY_OVER_OPPOSITE_DIRECTION", "310": "TOWN_BEGIN", "311": "TOWN_END",
    "325": "LIVING_STREET_BEGIN",
    "326": "LIVING_STREET_END", "330": "HIGHWAY_BEGIN", "331": "EXPRESSWAY_BEGIN",
    "350": "ZEBRA_CROSSING",
}  # fmt: skip
"""OSI's sign types by the number of the sign, German and of country OpenDRIVE; all others are
`OTHER`, with their code."""
_GERMAN = {"", "OPENDRIVE", "DE", "DEU", "GERMANY"}
_COUNTRIES = {"DEU": "DE", "GERMANY": "DE", "USA": "US"}
_UNITS = {
    "km/h": "KILOMETER_PER_HOUR", "mph": "MILE_PER_HOUR", "m": "METER", "km": "KILOMETER",
    "ft": "FEET", "mile": "MILE",
    "kg": "NO_UNIT", "t": "METRIC_TON", "%": "PERCENTAGE",
}  # fmt: skip
_ICONS = {
    "left": "ICON_ARROW_LEFT",
    "right": "ICON_ARROW_RIGHT",
    "straight": "ICON_ARROW_STRAIGHT_AHEAD",
    "": "ICON_NONE",
}
_WALKER_ICONS = {"red": "ICON_DONT_WALK", "green": "ICON_WALK"}
_LAMP = 0.3
"""Size (m) of a lamp whose light has no size"""


def link_at(history: Sequence[tuple[float, str]], time: float) -> str | None:
    """Link state of a light at a time (s), as in `LIT`; None without a state, or for an unknown
    one."""
    # Times of the log are rounded: a change at this step counts.
    index = bisect_right(history, time + 1e-9, key=itemgetter(0)) - 1
    return link_state(history[index][1]) if index >= 0 else None


class Signals:
    """Signs and lights near a run.

    Args:
        network: the roads.
        near: whether a place (m) is near enough for export.
        lane_id: gives the id of the lane of a key; None where it is too far away.
        events: the event log, with the states of lights.
        first_id: ids from here on are free.
    """

    def __init__(
        self,
        network: RoadNetwork,
        near: Callable[[float, float], bool],
        lane_id: Callable[[Key], int | None],
        events: Iterable[LogEntry],
        first_id: int,
    ) -> None:
        self._path, self._lane_id = network.path.name, lane_id
        self._history = signal_states(events)
        self._signs: list[tuple[int, SignalPlace]] = []
        self._lights: list[tuple[tuple[int, ...], SignalPlace]] = []
        self.next_id = first_id
        for place in signal_places(network):
            if not near(place.x, place.y):
                continue
            if place.signal.dynamic:
                self._lights.append((self._take(len(lamps(place.signal))), place))
            else:
                self._signs.append((self._take(1)[0], place))

    def _take(self, count: int) -> tuple[int, ...]:
        self.next_id += count
        return tuple(range(self.next_id - count, self.next_id))

    def fill(self, message: Any, time: float) -> None:
        """Add signs, and lights as they are at a time (s), to a GroundTruth."""
        for number, place in self._signs:
            self._fill_sign(message.traffic_sign.add(), number, place)
        for numbers, place in self._lights:
            link = link_at(self._history.get(place.signal.id, ()), time)
            colours = lamps(place.signal)
            for index, (number, colour) in enumerate(zip(numbers, colours, strict=True)):
                self._fill_lamp(
                    message.traffic_light.add(), number, place, (index, len(colours), colour), link
                )

    def _fill_sign(self, sign: Any, number: int, place: SignalPlace) -> None:
        signal = place.signal
        sign.id.value = number
        self._refer(sign, signal.id)
        main = sign.main_sign
        _fill_base(main.base, place, signal.width or 0.0, signal.height or 0.0, place.z)
        kind = main.classification
        country = signal.country.upper()
        # Numbers of signs mean other things in other countries.
        known = _SIGN_TYPES.get(signal.type) if country in _GERMAN else None
        kind.type = kind.Type.Value(f"TYPE_{known or 'OTHER'}")
        kind.variability = (
            kind.DESCRIPTOR.file.message_types_by_name["TrafficSign"]
            .enum_types_by_name["Variability"]
            .values_by_name["VARIABILITY_FIXED"]
            .number
        )
        kind.direction_scope = kind.DirectionScope.Value("DIRECTION_SCOPE_NO_DIRECTION")
        if len(_COUNTRIES.get(country, country)) == 2:
            kind.country = _COUNTRIES.get(country, country)
        kind.code, kind.sub_code = signal.type, signal.subtype
        if signal.value is not None:
            kind.value.value = signal.value
            unit = _UNITS.get(signal.unit or "km/h", "OTHER")
            kind.value.value_unit = kind.value.Unit.Value(f"UNIT_{unit}")
        kind.value.text = signal.text
        self._assign(kind, place)

    def _fill_lamp(
        self,
        lamp: Any,
        number: int,
        place: SignalPlace,
        which: tuple[int, int, str],
        link: str | None,
    ) -> None:
        index, count, colour = which
        signal = place.signal
        lamp.id.value = number
        self._refer(lamp, signal.id, colour)
        size = (signal.height or count * _LAMP) / count
        # Lamps from top to bottom, about the middle of the light.
        z = place.z + ((count - 1) / 2 - index) * size
        _fill_base(lamp.base, place, signal.width or _LAMP, size, z)
        kind = lamp.classification
        kind.color = kind.Color.Value(f"COLOR_{colour.upper()}")
        icon = _WALKER_ICONS[colour] if for_walkers(signal) else _ICONS[arrow(signal)]
        kind.icon = kind.Icon.Value(icon)
        if link is None:
            mode = "UNKNOWN"
        elif colour in LIT[link]:
            mode = "FLASHING" if link == YIELD else "CONSTANT"
        else:
            mode = "OFF"
        kind.mode = kind.Mode.Value(f"MODE_{mode}")
        kind.is_out_of_service = False
        self._assign(kind, place)

    def _refer(self, each: Any, *identifier: str) -> None:
        source = each.source_reference.add(type="net.asam.opendrive", reference=self._path)
        source.identifier.extend(identifier)

    def _assign(self, classification: Any, place: SignalPlace) -> None:
        numbers = [self._lane_id(key) for key in place.lanes]
        for number in dict.fromkeys(number for number in numbers if number is not None):
            classification.assigned_lane_id.add(value=number)


def _fill_base(base: Any, place: SignalPlace, width: float, height: float, z: float) -> None:
    base.dimension.width, base.dimension.height = width, height
    base.position.x, base.position.y, base.position.z = place.x, place.y, z
    base.orientation.yaw = place.h


# lamps of vehicles ---------------------------------------------------------------------------


class VehicleLights:
    """Lights of all vehicles of a run over time.

    Args:
        events: the event log, with the changes.
    """

    def __init__(self, events: Iterable[LogEntry]) -> None:
        self._history: dict[str, list[tuple[float, Mapping[str, str]]]] = {}
        for name, changes in light_states(events).items():
            modes: dict[str, str] = {}
            self._history[name] = states = []
            for time, (light, mode) in changes:
                # A new mapping each time: the states before stay as they were.
                modes = {**modes, light: mode}
                states.append((time, modes))

    def at(self, name: str, time: float) -> Mapping[str, str]:
        """Modes of the lights of a vehicle that the scenario has set, at a time (s)."""
        history: Sequence[tuple[float, Mapping[str, str]]] = self._history.get(name, ())
        index = bisect_right(history, time + 1e-9, key=itemgetter(0)) - 1
        return history[index][1] if index >= 0 else {}
