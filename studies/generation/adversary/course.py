"""Courses of many episodes at once: an ego with its system under test beside an actor that the
caller moves.

The ego moves, and its system is asked, as in runs in arrays (`runner.engine.storyboard.array_run`);
everything that is found here is run on SUMO before it is reported.
"""

from __future__ import annotations

from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from runner.engine.compile.compiler import Scenario
from runner.engine.motion.on_roads import Roads
from runner.engine.participants.outlines import box_distance
from runner.engine.participants.rows import EntityRows, LastLoaded
from runner.engine.positions.lane import lane_placement
from runner.engine.positions.world import Orientation
from runner.engine.storyboard.array_run import move
from runner.engine.worlds.surroundings import Environment
from runner.judging.execution import prepare, run
from runner.judging.measures.relations import MotionRows
from runner.judging.settings import RunSettings
from runner.systems.array_systems import open_arrays
from runner.systems.drivers import ArraySystemDriver, find_ego
from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.errors import Unsupported
from xodr.model.road import Road

if TYPE_CHECKING:
    from runner.engine.participants.entity import Entity

START = 100.0
"""Initial station (s, m) of the ego"""
_CHANGED = 1e-3


@dataclass(frozen=True, eq=False)
class Scene:
    """Setting of episodes: a manoeuvre scenario of one actor on a straight road.

    Attributes:
        scenario: compiled. road: its road. lanes: t of the lanes' centres by id, m.
        ego, actor: the participants. lane: of the ego at the start. start: t of the actor there, m.
        side: +1 where the actor begins to the left of the ego, else −1.
    """

    scenario: Scenario
    road: Road
    lanes: dict[int, float]
    ego: Entity
    actor: Entity
    lane: int
    start: float
    side: float

    @classmethod
    def of(cls, path: Path, settings: RunSettings | None = None) -> Scene:
        """Read the scene of a scenario with settings of runs.

        Raises:
            Unsupported: it is no manoeuvre of one actor who begins in a lane beside the ego's, on a
                straight road.
            InvalidFile: it is malformed.
        """
        scenario = prepare(path, settings=settings).scenario
        ego, network = find_ego(scenario, None), scenario.network
        others = [each for each in scenario.entities.values() if each is not ego]
        roads = [] if network is None else [*network.roads.values()]
        refusal = Unsupported(
            "an adversary needs one actor, who begins in a lane beside the "
            "ego's on a straight road",
            path=path,
        )
        if ego is None or len(others) != 1 or len(roads) != 1 or not roads[0].line.straight:
            raise refusal
        began = run(path, RunSettings(sut="none", world="kinematic", max_time=0.1)).recording
        lane, other = (
            int(began.tracks[each.name].columns["lane_id"][0]) for each in (ego, others[0])
        )
        if lane == other:
            raise refusal
        road = roads[0]
        lanes = {each: float(road.lane_t(START, each)) for each in road.lane_ids(START)}
        lanes = {each: t for each, t in lanes.items() if each * lane > 0}
        side = float(np.sign(lanes[other] - lanes[lane]))
        return cls(scenario, road, lanes, ego, others[0], lane, lanes[other], side)

    @property
    def between(self) -> float:
        """Distance (m) of the reference points of two that touch bumper to
        bumper, the actor ahead.
        """
        a, b = self.ego.box, self.actor.box
        return a.x + a.length / 2 + b.length / 2 - b.x

    def inside(self, t: FloatArray) -> BoolArray:
        """Return a mask of lateral positions (m) between the middles of the outermost lanes, or up
        to half a metre beyond (n,)."""
        lanes = list(self.lanes.values())
        return (t >= min(lanes) - 0.5) & (t <= max(lanes) + 0.5)


class Course:
    """Episodes under way; they are runs in arrays to the driver of the ego.

    Args:
        scene: of all of them.
        sut: the system under test.
        starts: gap from the ego's front to the actor's rear (m), the actor's and the ego's speed
            (m/s) (n, 3).
        dt: time step, s.

    Attributes:
        ego, actor: in all episodes.
        steps: done so far.
        contact: step of the first contact (n,); −1 for none so far.
        clearance: least distance of the boxes so far (n,), m. near: the distance now.
    """

    def __init__(self, scene: Scene, sut: Any, starts: FloatArray, dt: float) -> None:
        self.n = n = len(starts)
        gap, speed, ego_speed = starts.T
        self.scene, self.dt, self.steps, self.time = scene, dt, 0, 0.0
        self.environment, self.going = Environment(), np.ones(n, bool)
        scenario, loaded = scene.scenario, LastLoaded()
        scenario.reset()
        self._roads = Roads(scenario.network)
        self.ego, self.actor = (
            EntityRows(each, n, self._roads.lane_motion, loaded)
            for each in (scene.ego, scene.actor)
        )
        self.entities = {each.name: each for each in (self.ego, self.actor)}
        self._begin(ego_speed)
        self._put(START + scene.between + gap, np.full(n, scene.start))
        for each, own in ((self.ego, ego_speed), (self.actor, speed)):
            each.speed, each.target_speed, each.placed[:] = own.copy(), own.copy(), True
            each.vx, each.vy = own * np.cos(each.h), own * np.sin(each.h)
        self._ended = ExitStack()
        self._driver = None
        if (system := open_arrays(sut)) is not None:
            self._ended.enter_context(closing(system))
            self._driver = ArraySystemDriver(system, scenario, scene.ego, n, dt, 0)
            runs: Any = self
            self._driver.begin(runs)
        self.contact, self.clearance = np.full(n, -1), np.full(n, np.inf)
        self._look()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.close()

    def _begin(self, speed: FloatArray) -> None:
        """Put the ego on its lane."""
        scene, network = self.scene, self._roads.network
        assert network is not None
        point = network.lane_point(scene.road.id, scene.lane, START, 0.0)
        ego = self.ego.load(0)
        self._roads.place(ego, lane_placement(network, point, Orientation()))
        self.ego.store(0, ego)
        self.ego.copy(0, np.ones(self.n, bool))

    def _put(self, s: FloatArray, t: FloatArray) -> None:
        """Put the actor at s and t (n,) of the road, facing along it."""
        pose, actor = self.scene.road.pose(0.0, 0.0), self.actor
        c, sin = np.cos(pose.h), np.sin(pose.h)
        actor.s, actor.t = np.array(s), np.array(t)
        actor.x, actor.y = pose.x + s * c - t * sin, pose.y + s * sin + t * c
        if not self.steps:
            actor.h = np.full(self.n, pose.h)

    def leave(self, rows: BoolArray) -> None:
        """End episodes that arrays can't play: none with systems that decide in arrays."""
        self.going &= ~rows

    def advance(self, s: FloatArray, t: FloatArray) -> None:
        """One step, in which the actor moves to s and t of the road (n,), m, and the ego as its
        driver decides."""
        ego, actor, dt = self.ego, self.actor, self.dt
        runs: Any = self
        speed = ego.target_speed if self._driver is None else self._driver.decide(runs, ego)
        move(self._roads, ego, speed, dt, self.going)
        x, y, h, vx, vy = actor.x, actor.y, actor.h, actor.vx, actor.vy
        self.steps += 1
        self.time = round(self.steps * dt, 9)
        self._put(s, t)
        actor.vx, actor.vy = (actor.x - x) / dt, (actor.y - y) / dt
        actor.ax, actor.ay = (actor.vx - vx) / dt, (actor.vy - vy) / dt
        speed = np.hypot(actor.vx, actor.vy)
        actor.h = np.where(speed > _CHANGED, np.arctan2(actor.vy, actor.vx), h)
        actor.acceleration, actor.speed = (speed - actor.speed) / dt, speed
        self._look()

    @property
    def gap(self) -> FloatArray:
        """From the ego's front to the actor's rear along the road (n,), m; negative once it is past
        that."""
        gap: FloatArray = self.actor.s - self.ego.s - self.scene.between
        return gap

    def motions(self) -> tuple[MotionRows, MotionRows]:
        """Rows of ego and actor for the measures, one for each episode."""
        road = np.full(self.n, None, object)
        ego, actor = (
            MotionRows(
                each.name,
                each.box,
                np.zeros(self.n),
                each.x,
                each.y,
                each.z,
                each.h,
                each.speed,
                road,
                each.s,
                each.t,
            )
            for each in (self.ego, self.actor)
        )
        return ego, actor

    def _look(self) -> None:
        self.near = box_distance(*self.motions())
        self.clearance = np.minimum(self.clearance, self.near)
        self.contact = np.where((self.near <= 0.0) & (self.contact < 0), self.steps, self.contact)


def replayed(scene: Scene, sut: Any, starts: FloatArray, ways: FloatArray, dt: float) -> Course:
    """The episodes in which the actor goes the same ways (n, steps + 1, 2), m, whatever the ego
    does, at their ends."""
    with Course(scene, sut, starts, dt) as course:
        for step in range(1, ways.shape[1]):
            course.advance(ways[:, step, 0], ways[:, step, 1])
    return course
