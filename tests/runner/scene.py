"""Participants on a road, without a scenario file: for tests of what looks at a simulation."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import xodr
from runner.engine.compile.compiler import Scenario
from runner.engine.motion.placement import wrap
from runner.engine.participants.declaration import BoundingBox, Declaration
from runner.engine.participants.entity import Entities, Entity
from runner.engine.positions.world import Orientation, on_road
from runner.engine.storyboard.simulation import Simulation
from runner.engine.storyboard.storyboard import Storyboard
from runner.engine.worlds.base import KinematicWorld

ROADS = Path(__file__).parents[1] / "conformance" / "roads"
CAR = BoundingBox(1.5, 0.0, 0.75, 5.0, 2.0, 1.5)
"""From 1 m behind to 4 m ahead of the reference point, 1 m to each side."""


def vehicle(name: str, box: BoundingBox = CAR, category: str = "car", **state: Any) -> Entity:
    """A vehicle with some of its state given."""
    made = Entity(Declaration(name, "vehicle", category, box))
    for attribute, value in state.items():
        setattr(made, attribute, value)
    return made


def scene(
    *names: str, road: str | None = "straight", version: tuple[int, int] = (1, 3)
) -> Simulation:
    """A simulation of cars with these names, not yet placed, on a road of the conformance tests."""
    entities = Entities({name: vehicle(name) for name in names})
    network = xodr.load(ROADS / f"{road}.xodr") if road else None
    return Simulation(
        Scenario(Path("test.xosc"), version, network, entities, Storyboard()),
        KinematicWorld(),
        0.1,
        0,
    )


def put(
    sim: Simulation,
    name: str,
    lane: int,
    s: float,
    offset: float = 0.0,
    speed: float = 0.0,
    backwards: bool = False,
) -> Entity:
    """Put a car on a lane of road 1, facing its traffic's direction or against it, with a speed."""
    entity = sim.entities[name]
    assert sim.roads.network is not None
    road = sim.roads.network.road("1")
    h = road.heading(s) + (math.pi if (road.direction(lane) < 0) != backwards else 0.0)
    point = road.lane_point(s, lane, offset)
    sim.place(entity, on_road(sim.roads.network, point, h, Orientation()))
    drive(entity, speed)
    return entity


def put_free(
    sim: Simulation, name: str, x: float, y: float, h: float = 0.0, speed: float = 0.0
) -> Entity:
    """Put a car anywhere in the world, off any lane."""
    entity = sim.entities[name]
    entity.x, entity.y, entity.h, entity.placed = x, y, wrap(h), True
    sim.roads.leave_lane(entity)
    drive(entity, speed)
    return entity


def drive(entity: Entity, speed: float) -> None:
    """Let a car have a speed along its heading."""
    entity.speed = speed
    entity.vx, entity.vy = speed * math.cos(entity.h), speed * math.sin(entity.h)
