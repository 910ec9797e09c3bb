"""Declaration of an entity in a scenario."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from schemas.common.errors import InvalidFile, Unsupported
from xosc.node import Node


class BoundingBox(NamedTuple):
    """Box of an entity in its own frame: x forward, y left, z up from the reference point (rear axle on the ground), m."""

    x: float
    y: float
    z: float
    length: float
    width: float
    height: float


class Performance(NamedTuple):
    """Limits of a vehicle: m/s, m/s² and (jerk) m/s³; infinite where the file gives none."""

    max_speed: float = math.inf
    max_acceleration: float = math.inf
    max_deceleration: float = math.inf
    max_acceleration_rate: float = math.inf
    max_deceleration_rate: float = math.inf


@dataclass(frozen=True, slots=True)
class Declaration:
    """One participant as the scenario describes it; the same throughout every run.

    Args:
        name: its name.
        kind: vehicle, pedestrian or miscellaneous.
        category: e.g. car, truck, bicycle.
        box: its bounding box about the reference point.
        performance: its limits.
        front_axle: x of the front axle, m (0 where there is none).
        max_steering: greatest angle of the front wheels, rad (0 where it is not known).
        model: its 3D model, or else the name of its kind.
        mass: kg (0 where it is not known).
        properties: its Properties by name.
        controllers: the controllers assigned from the beginning: name → properties.
        hitch: x of the hitch that a trailer can be put on, m; None where there is none.
        coupler: x of the coupler by which this vehicle can be towed, m; None where there is none.
        node: the element that describes it, for complaints.
    """

    name: str
    kind: str
    category: str
    box: BoundingBox
    performance: Performance = field(default_factory=Performance)
    front_axle: float = 0.0
    max_steering: float = 0.0
    model: str = ""
    mass: float = 0.0
    properties: Mapping[str, str] = field(default_factory=dict)
    controllers: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    hitch: float | None = None
    coupler: float | None = None
    node: Node | None = None

    @property
    def front(self) -> float:
        """x of the front end in the own frame, m."""
        return self.box.x + self.box.length / 2

    def invalid(self, message: str) -> InvalidFile:
        """An InvalidFile at the element that describes the participant, to be raised by the caller."""
        return self.node.invalid(message) if self.node is not None else InvalidFile(message)

    def unsupported(self, message: str) -> Unsupported:
        """An Unsupported at the element that describes the participant, to be raised by the caller."""
        return self.node.unsupported(message) if self.node is not None else Unsupported(message)
