"""Weather, time of day and road condition as EnvironmentActions set them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from types import MappingProxyType
from typing import Any

from schemas.values import typed
from xosc.node import Node


@dataclass(frozen=True, slots=True)
class Environment:
    """State of the surroundings; every part keeps its last value until an action sets it.

    Args:
        name: of the last Environment applied.
        friction: RoadCondition frictionScaleFactor, 1 for a dry road.
        weather: attributes of Weather and its children, as `Precipitation.precipitationType`, as the file has them.
        day: the time of day set last, if any; `set_at` (s) is when that was, `running` whether it moves with the simulation.
    """

    name: str = ""
    friction: float = 1.0
    weather: Mapping[str, str] = field(default_factory=dict)
    day: datetime | None = None
    set_at: float = 0.0
    running: bool = False

    def after(self, node: Node, time: float) -> Environment:
        """Return the state after applying an Environment element at a simulation time (s)."""
        changes: dict[str, Any] = {"name": node.get("name")}
        clock = node.find("TimeOfDay")
        if clock is not None:
            changes |= {"day": read_date(clock, "dateTime"), "set_at": time, "running": clock.bool("animation")}
        weather = node.find("Weather")
        if weather is not None:
            changes["weather"] = MappingProxyType(
                {
                    (str(key) if part.tag == weather.tag else f"{part.tag}.{key!s}"): str(value)
                    for part in weather.iter()
                    for key, value in part.element.attrib.items()
                }
            )
        road = node.find("RoadCondition")
        if road is not None:
            changes["friction"] = road.finite("frictionScaleFactor")
            if changes["friction"] < 0.0:
                raise road.invalid("frictionScaleFactor must not be negative")
        return replace(self, **changes)

    def time_of_day(self, time: float) -> datetime | None:
        """The date and time at a simulation time (s); None while no action has set any."""
        if self.day is None or not self.running:
            return self.day
        return self.day + timedelta(seconds=time - self.set_at)


def read_date(node: Node, attribute: str) -> datetime:
    """An attribute of type dateTime; without a time zone it is UTC."""
    try:
        value = typed("dateTime", node.get(attribute))
    except ValueError as error:
        raise node.invalid(f"{attribute}: {error}") from None
    assert isinstance(value, datetime)
    return value
