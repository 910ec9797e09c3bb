"""One run of one scenario: the tick, and what actions and conditions may ask of it.

A tick is: actions act on [t, t + dt], systems under test, motion, world step, contacts, recording, triggers at t + dt.
The triggers at time 0 are part of the beginning: what they start and takes no time sets the initial state, as initial
actions do, so that a recording does not show entities where the scenario has put them only roughly.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from runner.contracts.action import LATERAL
from runner.interpreter.collision import Contacts
from runner.interpreter.environment import Environment
from runner.interpreter.event_log import LogEntry
from runner.interpreter.recorder import Recorder
from runner.motion.following import back_to_lane
from runner.motion.free import FreeMotion
from runner.motion.lane import LaneMotion
from runner.motion.placement import Placement, wrap
from runner.participants.trailers import disconnect, line_up, tow, train
from xodr.model import RoadPoint

if TYPE_CHECKING:
    from runner.interpreter.compiler import Scenario
    from runner.interpreter.elements import Element, Process, Transition
    from runner.participants.entity import Entities, Entity
    from runner.worlds.base import World
    from xodr.network import RoadNetwork

_ACROSS = math.radians(45.0)
"""Heading relative to the lane from which an entity faces across it, rad"""
_STANDSTILL = 1e-3
"""m/s below which an entity stands still"""


class Simulation:
    """A scenario in execution.

    Args:
        scenario: the compiled scenario (used up by the run).
        world: where participants live; opened and closed by the run.
        timestep: s.
        seed: of everything random in the run.
    """

    def __init__(self, scenario: Scenario, world: World, timestep: float, seed: int) -> None:
        self.scenario = scenario
        self.world = world
        self.dt = timestep
        self.seed = seed
        self.random = random.Random(seed)
        self.network: RoadNetwork | None = scenario.network
        self.entities: Entities = scenario.entities
        self.storyboard = scenario.storyboard
        self.parameters: dict[str, Any] = dict(scenario.parameters)
        self.variables: dict[str, Any] = dict(scenario.variables)
        self.monitors: dict[str, bool] = dict(scenario.monitors)
        self.environment = Environment()
        self.signals = scenario.signals
        self.user_values: dict[str, str] = {}
        self.step_index = 0
        self.time = 0.0
        self.initialising = True
        """Whether the initial actions and the events of time 0 are starting: what takes no time sets the initial state."""
        self.finished = False
        self.processes: list[Process] = []
        self.log: list[LogEntry] = []
        self.contacts = Contacts(self)
        self.recorder = Recorder(self)
        self._changed: list[Element] = []
        self._published: list[Element] = []
        self._next_step: list[Callable[[Simulation], None]] = []
        self.free_motion = FreeMotion()
        self.lane_motion = LaneMotion(self.network) if self.network is not None else None

    # the run --------------------------------------------------------------------------------

    def begin(self) -> None:
        """Open the world, run the initial actions and the triggers at time 0, record time 0."""
        told = self.world.open(self.network, self.dt, self.seed)
        if told:
            self.note("world", self.world.name, told)
        self.signals.advance(self)
        self.storyboard.begin(self)
        for entity in self.entities.values():
            if entity.active and entity.placed:
                self.world.add(entity)
            elif entity.active:
                entity.active = False
                self.note("entity", entity.name, "has no position yet: absent until an action places it")
        self.contacts.update()
        self._set_velocities()
        self._evaluate()
        self._set_velocities()
        self.initialising = False
        self.recorder.record()

    def _set_velocities(self) -> None:
        for entity in self.entities.values():
            entity.vx, entity.vy = entity.speed * math.cos(entity.h), entity.speed * math.sin(entity.h)

    def _evaluate(self) -> None:
        self._publish()
        self.finished = self.storyboard.evaluate(self)

    def tick(self) -> bool:
        """One step; false once the storyboard's stop trigger has ended the run (time then stands)."""
        if self.finished:
            return False
        dt = self.dt
        for process in tuple(self.processes):
            if process.running.step(dt):
                process.element.finished(self, process)
        for entity in self.entities.values():
            if entity.active and entity.tractor is None:
                if entity.driven and entity.system is not None:
                    entity.system.guide(entity, self)
                if not entity.driven:
                    self._move(entity, dt)
        self.step_index += 1
        self.time = round(self.step_index * dt, 9)
        self.world.mirror(entity for entity in self.entities.values() if entity.active and not entity.driven)
        self.world.step()
        for entity in [entity for entity in self.entities.values() if entity.driven]:
            self._read(entity)
        self.contacts.update()
        for observe in self.scenario.observers:
            observe(self)
        self.recorder.record()
        self._evaluate()
        return True

    def _move(self, entity: Entity, dt: float) -> None:
        speed = entity.demand
        if entity.system is not None:
            speed = entity.system.speed(entity, speed, self)
            if entity.driven:
                return
        x, y = entity.x, entity.y
        waiting = entity.at_road_end
        speed = entity.motion.advance(entity, speed, dt)
        if entity.at_road_end:
            entity.at_road_end = not (waiting and speed)
            entity.road_end = entity.road_end + dt if waiting and not speed else 0.0
        vx, vy = (entity.x - x) / dt, (entity.y - y) / dt
        entity.ax, entity.ay = (vx - entity.vx) / dt, (vy - entity.vy) / dt
        entity.vx, entity.vy = vx, vy
        entity.acceleration = (speed - entity.speed) / dt
        if not math.isfinite(entity.ax + entity.ay + entity.acceleration):
            raise entity.invalid(f"{entity.name!r} moves beyond all numbers at {self.time:g} s")
        entity.speed = speed
        distance = speed * dt
        entity.odometer += distance if distance > 0.0 else -distance
        if -_STANDSTILL < speed < _STANDSTILL:
            entity.standstill += dt
        else:
            entity.standstill = 0.0
        if entity.trailer is not None:
            tow(self, entity, dt)

    def _read(self, entity: Entity) -> None:
        reading = self.world.read(entity)
        if reading is None:
            self._left(entity)
            return
        dt = self.dt
        vx, vy = (reading.x - entity.x) / dt, (reading.y - entity.y) / dt
        entity.ax, entity.ay = (vx - entity.vx) / dt, (vy - entity.vy) / dt
        entity.vx, entity.vy = vx, vy
        entity.acceleration = (reading.speed - entity.speed) / dt
        entity.odometer += abs(reading.speed) * dt
        entity.standstill = entity.standstill + dt if abs(reading.speed) < _STANDSTILL else 0.0
        entity.x, entity.y, entity.h, entity.speed = reading
        entity.on_lane = False
        self.lift(entity)
        if entity.trailer is not None:
            tow(self, entity, dt)

    def lift(self, entity: Entity) -> None:
        """Put an entity that moves in the plane onto the road's surface."""
        point = self.road_point(entity)
        if point is None or self.network is None or self.network.roads[point.road_id].flat:
            return
        pose = self.network.pose(point)
        along = 1.0 if math.cos(entity.h - pose.h) >= 0.0 else -1.0
        entity.z, entity.pitch, entity.roll = pose.z, along * pose.pitch, along * pose.roll

    def _left(self, entity: Entity) -> None:
        """The world has let go of an entity at the end of its way: what the scenario declares goes on as scripted."""
        self.note("left", entity.name, f"has come to the end of the way that {self.world.name} knows")
        if entity.spawned:
            self.despawn(entity)
        else:
            entity.system.lost(entity, self)
            self._move(entity, self.dt)

    # for storyboard elements ----------------------------------------------------------------

    def element_changed(self, element: Element, transition: Transition, reason: str) -> None:
        """A storyboard element has made a transition; conditions see it from the next step on."""
        self._changed.append(element)
        self.note(transition.value, element.path, reason)

    def _publish(self) -> None:
        if self._changed or self._published:
            for element in dict.fromkeys((*self._published, *self._changed)):
                element.publish()
            self._published, self._changed = self._changed, []
        if self._next_step:
            calls, self._next_step = self._next_step, []
            for call in calls:
                call(self)

    def call_next_step(self, call: Callable[[Simulation], None]) -> None:
        """Have something called at the beginning of the next step."""
        self._next_step.append(call)

    def note(self, kind: str, subject: str, text: str = "") -> None:
        """Write a line of the event log at the current time."""
        self.log.append(LogEntry(self.time, kind, subject, text))

    # for actions and conditions -------------------------------------------------------------

    def place(self, entity: Entity, placement: Placement) -> None:
        """Put an entity somewhere, at its present speed; from there it follows its lane.

        It goes straight ahead where there is no lane, or where it faces across the lane (a pedestrian about to cross).
        """
        entity.x, entity.y, entity.z = placement.x, placement.y, placement.z
        entity.h, entity.pitch, entity.roll = wrap(placement.h), placement.pitch, placement.roll
        entity.placed = True
        entity.at_road_end, entity.road_end = False, 0.0
        entity.next_offset = None
        if placement.point is None or self.network is None or abs(wrap(placement.heading_offset)) > _ACROSS:
            self.leave_lane(entity)
        else:
            self.follow_lane(entity, placement.point, placement.along, placement.heading_offset)
        if entity.trailer is not None:
            line_up(self, entity)
        if entity.driven:
            self.drive(entity)

    def drive(self, entity: Entity) -> bool:
        """Hand an entity to the world's own driver; false, and it goes on as scripted, where that can't drive."""
        entity.driven = self.world.drive(entity)
        if entity.driven:
            self.leave_lane(entity)
        else:
            reason = "no lane for it, against the traffic, or hidden"
            self.note("world", entity.name, f"can't be driven by {self.world.name} here: {reason}")
        return entity.driven

    def take_back(self, entity: Entity) -> None:
        """Take an entity back from the world's own driver; unless an action moves it already, it goes on along its lane."""
        self.world.release(entity)
        entity.driven = False
        if LATERAL not in entity.controls:
            back_to_lane(self, entity)

    def follow_lane(self, entity: Entity, point: RoadPoint, along: int, heading_offset: float = 0.0) -> None:
        """Let an entity follow the lane it is on, facing along (+1) or against (−1) increasing s."""
        assert self.network is not None and self.lane_motion is not None
        entity.road = self.network.road(point.road_id)
        entity.section = entity.road.section(point.s)
        entity.lane, entity.s, entity.t, entity.offset = point.lane_id, point.s, point.t, point.offset
        entity.along, entity.heading_offset, entity.on_lane = along, heading_offset, True
        entity.motion = self.lane_motion

    def keep_to_road(self, entity: Entity) -> None:
        """Let an entity that goes straight ahead move along its road instead, facing as it does."""
        point = self.road_point(entity)
        if point is None or self.network is None or entity.motion is not self.free_motion:
            return
        turn = wrap(entity.h - self.network.pose(point).h)
        along = 1 if abs(turn) <= math.pi / 2 else -1
        self.follow_lane(entity, point, along, turn if along > 0 else wrap(turn + math.pi))

    def leave_lane(self, entity: Entity) -> None:
        """Let an entity go straight ahead, off any lane."""
        entity.on_lane = False
        entity.motion = self.free_motion

    def road_point(self, entity: Entity) -> RoadPoint | None:
        """Where an entity is on the road network; None where there is none."""
        if self.network is None:
            return None
        if entity.on_lane and entity.road is not None:
            return RoadPoint(entity.road.id, entity.s, entity.t, entity.lane, entity.offset)
        if entity.located_at != (entity.x, entity.y):
            entity.located_at = (entity.x, entity.y)
            entity.located = self.network.locate(entity.x, entity.y, entity.z, entity.h, entity.located)
        return entity.located

    def activate(self, entity: Entity, placement: Placement) -> None:
        """Bring an entity into the world, standing (AddEntityAction), its trailers with it."""
        self.place(entity, placement)
        for member in train(entity):
            if member is entity or not member.active:
                member.active = True
                member.speed = member.demand = member.acceleration = 0.0
                self.world.add(member)

    def deactivate(self, entity: Entity) -> None:
        """Take an entity out of the world (DeleteEntityAction): its running actions end."""
        for process in [p for p in self.processes if p.actor is entity]:
            process.element.override(self, process, f"{entity.name} has left the scenario")
        for tractor in (entity, entity.tractor):
            if tractor is not None and tractor.trailer is not None:
                disconnect(self, tractor)
        entity.active = entity.driven = False
        self.world.remove(entity)

    def spawn(self, entity: Entity, placement: Placement, speed: float) -> bool:
        """Bring in a participant that the scenario does not name, for the world's own driver; false where it can't drive."""
        self.place(entity, placement)
        entity.speed = speed
        if not self.world.drive(entity):
            return False
        self.leave_lane(entity)
        entity.driven = True
        entity.vx, entity.vy = speed * math.cos(entity.h), speed * math.sin(entity.h)
        entity.spawned = True
        self.entities[entity.name] = entity
        self.contacts.enter(entity)
        self.note("spawned", entity.name, entity.category)
        return True

    def despawn(self, entity: Entity) -> None:
        """Take such a participant out again."""
        self.deactivate(entity)
        del self.entities[entity.name]
