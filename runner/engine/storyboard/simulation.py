"""One run of one scenario: the tick, and what actions and conditions may ask of it.

A tick is: actions act on [t, t + dt], the system under test, motion, world step, contacts,
recording, triggers at t + dt. Actions and the system under test observe everyone at t: the ego is
driven before anyone else moves, so the order of declarations has no effect. The triggers at time 0
are part of the beginning: what they start and takes no time sets the initial state, as initial
actions do, so that a recording does not show entities where the scenario has put them only roughly.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterable, Sequence
from math import isfinite
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from runner.engine.compile.element import LATERAL
from runner.engine.motion.following import PosedMotion, SteeredMotion
from runner.engine.motion.on_roads import Roads
from runner.engine.participants.entity import Displacement
from runner.engine.participants.trailers import disconnect, line_up, tow, train
from runner.engine.storyboard.collision import Contacts
from runner.engine.worlds.surroundings import Environment
from runner.recording import LogEntry, Recorder
from schemas.common.remarks import Remarks

if TYPE_CHECKING:
    from runner.engine.compile.compiler import Scenario
    from runner.engine.compile.protocols import Rest, Running, Transition
    from runner.engine.motion.placement import Placement
    from runner.engine.participants.entity import Entities, Entity
    from runner.engine.storyboard.driver import EgoDriver
    from runner.engine.storyboard.story_elements import Element, Process, StoryboardRun
    from runner.engine.worlds.base import World

_STATE = (
    "x",
    "y",
    "z",
    "h",
    "pitch",
    "roll",
    "vx",
    "vy",
    "ax",
    "ay",
    "speed",
    "acceleration",
    "s",
    "t",
    "kept_offset",
    "kept_lane",
    "at_road_end",
)
_state = attrgetter(*_STATE)
_STANDSTILL = 1e-3
"""m/s below which an entity stands still"""


class Simulation:
    """A scenario in execution.

    Args:
        scenario: the compiled scenario; it is reset here, and one run at a time can use it.
        world: where participants live; opened and closed by the run.
        timestep: s.
        seed: of everything random in the run.
        strict: refuse repairs.
    """

    def __init__(
        self, scenario: Scenario, world: World, timestep: float, seed: int, *, strict: bool = False
    ) -> None:
        # A compiled scenario is used for many runs: what the last one has left is state, not part
        # of it.
        scenario.reset()
        self.world = world
        self.dt = timestep
        self.seed = seed
        # A generator of its own: other users of `random` in the process must not change a run.
        self.random = random.Random(seed)
        self.remarks = Remarks(strict)
        self.roads = Roads(scenario.network)
        self.entities: Entities = scenario.entities
        self.storyboard = scenario.storyboard
        self.parameters: dict[str, Any] = dict(scenario.parameters)
        self.variables: dict[str, Any] = dict(scenario.variables)
        self.monitors: dict[str, bool] = dict(scenario.monitors)
        self.environment = Environment()
        self.signals = scenario.signals
        self.observers: list[Callable[[Simulation], None]] = list(scenario.observers)
        """called at the end of each step"""
        self._driver: EgoDriver | None = None
        self._ego: Entity | None = None
        self.user_values: dict[str, str] = {}
        self.step_index = 0
        self.changes = 0
        self.time = 0.0
        self.initialising = True
        """Whether the initial actions and the events of time 0 are starting: what takes no time
        sets the initial state."""
        self.finished = False
        self.processes: list[Process] = []
        self.ended: list[Process] = []
        self.put: list[Entity] = []
        """entities that actions have put somewhere since the last row was recorded"""
        self.rests: list[str] = []
        """sentences on actions that have ended, or are under way when the run stops, short of their
        goals"""
        self.log: list[LogEntry] = []
        self.displacement = Displacement(self)
        self.contacts = Contacts(self)
        self.recorder = Recorder(self.entities, timestep, scenario.network)
        self._changed: list[Element] = []
        self._published: list[Element] = []
        self._next_step: list[Callable[[StoryboardRun], None]] = []

    # the run --------------------------------------------------------------------------------

    def begin(self) -> None:
        """Open the world, run the initial actions and the triggers at time 0, record time 0."""
        remark = self.world.open(self.roads.network, self.dt, self.seed)
        if remark:
            self.note("world", self.world.name, remark)
        self.signals.advance(self)
        # Signals first: a condition of time 0 may ask for the phase of time 0.
        self.storyboard.begin(self)
        for entity in self.entities.values():
            if entity.active and entity.placed:
                self.world.add(entity)
            elif entity.active:
                entity.active = False
                self.note(
                    "entity", entity.name, "has no position yet: absent until an action places it"
                )
        self.contacts.update()
        # Twice: the triggers at time 0 read speeds of entities that initial actions have placed,
        # and what they start may set other speeds.
        self._set_velocities()
        self._evaluate()
        self._set_velocities()
        self.initialising = False
        self.put.clear()
        self.recorder.record(self.time)

    def _set_velocities(self) -> None:
        for entity in self.entities.values():
            if entity.controls.tractor is None:
                for member in train(entity):
                    member.begin_at(entity.speed)

    def _evaluate(self) -> None:
        if self._changed or self._published or self._next_step:
            self._publish()
        self.finished = self.storyboard.evaluate(self)

    def tick(self) -> bool:
        """One step; false once the storyboard's stop trigger has ended the run
        (time then stands).
        """
        if self.finished:
            return False
        dt = self.dt
        # A copy: a process that ends leaves the list, and may end others.
        for process in tuple(self.processes):
            if process.running.step(dt):
                process.element.finished(self, process)
        # Before anyone else moves, so that its system observes all others at t.
        ego = self._ego
        if ego is not None and ego.active and ego.controls.tractor is None:
            assert self._driver is not None
            self._drive_ego(ego, self._driver)
        driven, scripted = [], []
        for entity in self.entities.values():
            controls = entity.controls
            world_driven = controls.world_driven
            if (
                entity.active
                and not world_driven
                and controls.tractor is None
                and entity is not ego
            ):
                # Trailers follow the entity that tows them (`tow`), and the ego has moved already.
                speed = controls.target_speed
                if speed or entity.speed:
                    self._move(entity, speed, dt)
                else:
                    self._stay(entity)
            if world_driven:
                driven.append(entity)
            elif entity.active:
                scripted.append(entity)
        self.step_index += 1
        # Counted, not summed: 0.05 s added 20 times is not 1 s. Rounding lets times be compared
        # with those of the file.
        self.time = round(self.step_index * dt, 9)
        # Scripted entities are shown before the world steps, so that its own traffic reacts to
        # where they are at t + dt.
        self.world.mirror(scripted)
        self.world.step()
        for entity in driven:
            self._read(entity)
        # Only now: a goal is reached at the end of the step in which its action ends.
        if self.ended:
            self._look_back()
        self.contacts.update()
        for observe in self.observers:
            observe(self)
        self.recorder.record(self.time)
        self._evaluate()
        # The row of this time was recorded before the triggers of this time moved them.
        if self.put:  # they are where an action has put them at this time, as at time 0
            self.recorder.correct(self.time, self.put)
            self.put.clear()
        return True

    def _look_back(self) -> None:
        """Log how the actions of this step have ended; a rest above its tolerance is a remark,
        except where others drive."""
        for process in self.ended:
            rest, actor = process.running.rest(), process.actor
            if rest is not None and actor is not None:
                text = f"{actor.name}: {rest}"
                self.log.append(LogEntry(self.time, "goal", process.element.path, text))
                self._say(process, actor, rest, "ends")
        self.ended.clear()

    def leave_off(self) -> None:
        """Report the rests of the running actions, because the run stops."""
        for process in self.processes:
            rest, actor = process.running.rest(), process.actor
            if rest is not None and actor is not None:
                self._say(process, actor, rest, "is under way when the run stops")

    def _say(self, process: Process, actor: Entity, rest: Rest, verb: str) -> None:
        # A system or SUMO may do otherwise than the scenario asks: their rest is no fault of the
        # runner.
        driven = actor.controls.driver is not None or actor.controls.world_driven
        if rest.left > rest.tolerance and not driven:
            element = process.element
            where = f"{element.node.where}: " if element.node is not None else ""
            subject = f"the action {element.name!r} of {actor.name}"
            self.rests.append(f"{where}{subject} {verb} at {self.time:.2f} s: {rest}")

    def drive_ego(self, ego: Entity, driver: EgoDriver) -> None:
        """Let a driver have the ego from now on."""
        self._ego, self._driver = ego, driver
        ego.controls.driver = driver

    def _drive_ego(self, ego: Entity, driver: EgoDriver) -> None:
        """One step as the driver wants it: by the world's own driver, or by the speed and steering
        decided."""
        request = driver.request(ego)
        if request is not None:
            driven = ego.controls.world_driven or self.drive(ego)
            driver.answer(driven)
            if driven:
                self.world.ask(ego, request)
                return
        if ego.controls.world_driven:
            self._take_back(ego, driver)
        self._move_ego(ego, driver)

    def _move_ego(self, ego: Entity, driver: EgoDriver) -> None:
        decision = driver.decide(ego, self)
        motion = ego.controls.motion
        if decision.pose is not None:
            # The motion is kept from step to step, and made anew when an action has given the ego
            # another one.
            posed = motion if isinstance(motion, PosedMotion) else PosedMotion(self.roads)
            posed.put(ego, decision.pose.x, decision.pose.y, decision.pose.h)
        elif decision.steering is not None:
            steered = motion if isinstance(motion, SteeredMotion) else SteeredMotion(self.roads)
            steered.steer(ego, decision.steering)
        # The system steers no longer: the lane is found again from where it has left the ego.
        elif isinstance(motion, SteeredMotion | PosedMotion):
            self.roads.back_to_lane(ego)
        self._move(ego, decision.speed, self.dt)

    def _take_back(self, ego: Entity, driver: EgoDriver) -> None:
        """Take the ego back from the world's own driver; unless an action moves it already, it
        follows its lane."""
        self.world.release(ego)
        ego.controls.world_driven = False
        if LATERAL not in ego.controls.owners:
            self.roads.back_to_lane(ego)
        # Its last speed on the world's side, since no target speed of the scenario applies to it.
        if not driver.scripted:
            ego.controls.target_speed = ego.speed

    def _move(self, entity: Entity, speed: float, dt: float) -> None:
        x, y, h, controls = entity.x, entity.y, entity.h, entity.controls
        # It waits at the end of its road if it was there before this step and has not moved in it:
        # the first step to the end still moves.
        waiting = entity.at_road_end
        speed = controls.motion.advance(entity, speed, dt)
        if entity.at_road_end:
            entity.at_road_end = not (waiting and speed)
            entity.road_end = entity.road_end + dt if waiting and not speed else 0.0
        vx, vy = (entity.x - x) / dt, (entity.y - y) / dt
        # Backward differences of the poses: they hold for each way of moving, and are what a
        # recording of the poses would give.
        entity.ax, entity.ay = ax, ay = (vx - entity.vx) / dt, (vy - entity.vy) / dt
        entity.vx, entity.vy, entity.turn = vx, vy, entity.h - h
        entity.acceleration = acceleration = (speed - entity.speed) / dt
        # A sum is infinite or NaN if one of its parts is: one test in place of three in each step.
        if not isfinite(ax + ay + acceleration):
            raise entity.declared.invalid(
                f"{entity.name!r} moves too fast for a number at {self.time:g} s"
            )
        entity.speed = speed
        distance = speed * dt
        entity.odometer += distance if distance > 0.0 else -distance
        # Comparisons, not abs(): no call in each step of each entity.
        standing = -_STANDSTILL < speed < _STANDSTILL
        entity.standstill = entity.standstill + dt if standing else 0.0
        if controls.trailer is not None:
            tow(self.roads, entity, dt)

    def _stay(self, entity: Entity) -> None:
        """One step of an entity that stands: once such a step has left all as it was, the same
        until something happens."""
        controls = entity.controls
        # Trailers settle in their own time, and lateral motion may go on at standstill; neither is
        # skipped.
        led = controls.owners or controls.target_offset is not None or controls.easing is not None
        still = controls.motion.stands and not led and controls.trailer is None
        # A whole step has changed nothing, and nothing has happened since: only the clocks go on.
        if still and entity.settled == self.changes:
            entity.standstill += self.dt
            if entity.at_road_end:
                entity.road_end += self.dt
            return
        before = repr(_state(entity))  # distinguishes 0.0 from -0.0
        pitch, roll = entity.pitch, entity.roll
        self._move(entity, controls.target_speed, self.dt)
        if still:
            entity.pitch, entity.roll = pitch, roll  # a position may have put it at an angle
        if still and repr(_state(entity)) == before:
            entity.settled = self.changes

    def _read(self, entity: Entity) -> None:
        reading = self.world.read(entity)
        if reading is None:
            self._left(entity)
            return
        dt = self.dt
        vx, vy = (reading.x - entity.x) / dt, (reading.y - entity.y) / dt
        entity.ax, entity.ay = (vx - entity.vx) / dt, (vy - entity.vy) / dt
        entity.vx, entity.vy, entity.turn = vx, vy, reading.h - entity.h
        entity.acceleration = (reading.speed - entity.speed) / dt
        entity.odometer += abs(reading.speed) * dt
        standing = abs(reading.speed) < _STANDSTILL
        entity.standstill = entity.standstill + dt if standing else 0.0
        entity.x, entity.y, entity.h, entity.speed = reading
        # The world gives a pose and no lane: the place is looked up when it is asked for.
        entity.on_lane = False
        self.roads.lift(entity)
        if entity.controls.trailer is not None:
            tow(self.roads, entity, dt)

    def _left(self, entity: Entity) -> None:
        """The world has released an entity at the end of its route: a declared entity continues as
        scripted."""
        self.note(
            "left", entity.name, f"has come to the end of the way that {self.world.name} knows"
        )
        if entity.spawned:
            self.despawn(entity)
        elif self._driver is not None:
            self._driver.answer(False)
            self._take_back(entity, self._driver)
            self.world.add(entity)
            self._move_ego(entity, self._driver)

    # for storyboard elements ----------------------------------------------------------------

    def element_changed(self, element: Element, transition: Transition, reason: str) -> None:
        """A storyboard element has made a transition; conditions see it from the next step on."""
        # Published at the next step, so that the order of elements in the file has no effect on
        # conditions.
        self._changed.append(element)
        self.storyboard.changed(element)
        self.note(transition.value, element.path, reason)

    def _publish(self) -> None:
        if self._changed or self._published:
            self.wake()
            for element in dict.fromkeys((*self._published, *self._changed)):
                element.publish()
            self._published, self._changed = self._changed, []
        if self._next_step:
            # Calls may ask for further calls: those belong to the step after.
            calls, self._next_step = self._next_step, []
            for call in calls:
                call(self)

    def element_rearmed(self, element: Element) -> None:
        """A storyboard element is back in standby without a transition; conditions see it from the
        next step on."""
        self._changed.append(element)
        self.wake()
        self.storyboard.changed(element)

    def call_next_step(self, call: Callable[[StoryboardRun], None]) -> None:
        """Have something called at the beginning of the next step."""
        self._next_step.append(call)

    def wake(self) -> None:
        """Wake all that rests: state that conditions read has changed."""
        self.changes += 1

    def note(self, kind: str, subject: str, text: str = "", time: float | None = None) -> None:
        """Write a line of the event log; it may matter to a condition, so all
        conditions are woken.
        """
        self.wake()
        self.log.append(LogEntry(self.time if time is None else time, kind, subject, text))

    # for actions and conditions -------------------------------------------------------------

    @property
    def running(self) -> Iterable[Running]:
        """The actions in execution."""
        return [process.running for process in self.processes]

    def touching(self, entity: Entity) -> Sequence[Entity]:
        """Return the entities whose boxes touch an entity's box now, sorted by name."""
        return self.contacts.of(entity)

    def set_environment(self, environment: Environment) -> None:
        """Change weather, time of day and road condition."""
        self.environment = environment

    def end_actions(self, entity: Entity, reason: str) -> None:
        """End all actions of an entity, as if newer ones had taken their control domains."""
        # A list, since overriding removes from the processes.
        for process in [process for process in self.processes if process.actor is entity]:
            process.override(reason)

    def place(self, entity: Entity, placement: Placement) -> None:
        """Place an entity at its present speed; from there it follows its lane, or drives straight
        ahead."""
        self.wake()
        self.roads.place(entity, placement)
        self.relocated(entity)
        if entity.controls.trailer is not None:
            line_up(self.roads, entity)
        if entity.controls.world_driven:
            self.drive(entity)

    def relocated(self, entity: Entity) -> None:
        """Show an entity, and its trailers, where an action has put it at this time, not only after
        the coming step."""
        # `train`: the entity and all that it tows.
        self.put += train(entity)

    def drive(self, entity: Entity) -> bool:
        """Hand an entity to the world's own driver; false if that can't drive it, and the entity
        stays scripted."""
        driven = entity.controls.world_driven = self.world.drive(entity)
        if driven:
            self.roads.leave_lane(entity)
        else:
            reason = "no lane for it, against the traffic, or hidden"
            self.note("world", entity.name, f"can't be driven by {self.world.name} here: {reason}")
        return driven

    def activate(self, entity: Entity, placement: Placement) -> None:
        """Bring an entity into the world (AddEntityAction), at the speed that it was last asked
        for, its trailers with it."""
        self.place(entity, placement)
        if not entity.active:
            self.enter(entity)

    def enter(self, entity: Entity) -> None:
        """Bring an entity that has got its first place into the world, at the speed that it was
        last asked for."""
        self.wake()
        for member in train(entity):
            # A trailer that is present already was placed by itself: it keeps its state.
            if member is entity or not member.active:
                member.active = True
                member.controls.target_speed = entity.controls.target_speed
                member.begin_at(entity.controls.target_speed)
                member.at_road_end, member.road_end, member.standstill = False, 0.0, 0.0
                member.entered = self.time
                self.world.add(member)

    def deactivate(self, entity: Entity) -> None:
        """Take an entity out of the world (DeleteEntityAction): its running actions end."""
        self.end_actions(entity, f"{entity.name} has left the scenario")
        for process in self.processes:
            if entity is process.running.follows():
                process.element.lose(self, entity)
        # The entity lets go of its trailer, and of the vehicle that tows it.
        for tractor in (entity, entity.controls.tractor):
            if tractor is not None and tractor.controls.trailer is not None:
                disconnect(self.roads, tractor)
        self.wake()
        entity.active = entity.controls.world_driven = False
        self.world.remove(entity)

    def spawn(self, entity: Entity, placement: Placement, speed: float) -> bool:
        """Bring in a participant that the scenario does not name, for the world's own driver; false
        where it can't drive."""
        self.place(entity, placement)
        entity.speed = speed
        if not self.world.drive(entity):
            return False
        self.roads.leave_lane(entity)
        entity.controls.world_driven = True
        entity.vx, entity.vy = speed * math.cos(entity.h), speed * math.sin(entity.h)
        self.entities[entity.name] = entity
        self.note("spawned", entity.name, entity.declared.category)
        return True

    def despawn(self, entity: Entity) -> None:
        """Take such a participant out again."""
        self.deactivate(entity)
        del self.entities[entity.name]
