"""Courses of many episodes at once: an ego with its system under test beside an actor that the caller moves.

The ego is that of `generation.twin`: its verdicts are SUMO's, as far as `python -m
studies.generation twin` says, and everything that is found here is run on SUMO before it is
reported.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from generation.twin.episodes import Situation, driver
from generation.twin.motion import Actor, Body, Script, driven, read
from runner.engine.participants.outlines import box_distance
from runner.judging.settings import RunSettings
from schemas.common.array_types import BoolArray, FloatArray
from schemas.common.errors import Unsupported

START = 100.0
"""Initial station (s, m) of the ego"""
_CHANGED = 1e-3


@dataclass(frozen=True)
class Scene:
    """Setting of episodes: the content of a manoeuvre scenario with one actor on a straight road.

    Attributes:
        script: of the scenario. ego, actor: the participants. side: +1 where the actor begins to
            the left of the ego, else −1.
    """

    script: Script
    ego: Actor
    actor: Actor
    side: float

    @classmethod
    def of(cls, path: Path, settings: RunSettings | None = None) -> Scene:
        """Read the scene of a scenario with settings of runs.

        Raises:
            Unsupported: it is no manoeuvre of one actor who begins in a lane beside the ego's, on a
                straight road.
            InvalidFile: it is malformed.
        """
        script = read(path, settings)
        if (
            len(script.actors) != 2
            or script.actors[1].change is None
            or script.actors[0].lane == script.actors[1].lane
        ):
            raise Unsupported(
                "an adversary needs one actor, who begins in a lane beside the ego's", path=path
            )
        ego, actor = script.actors
        return cls(
            script, ego, actor, float(np.sign(script.lanes[actor.lane] - script.lanes[ego.lane]))
        )

    @property
    def between(self) -> float:
        """Distance (m) of the reference points of two that touch bumper to bumper, the actor ahead."""
        a, b = self.ego.box, self.actor.box
        return a.x + a.length / 2 + b.length / 2 - b.x

    def inside(self, y: FloatArray) -> BoolArray:
        """Return a mask of lateral positions (m) between the middles of the outermost lanes, or up to half a metre beyond
        (n,)."""
        lanes = list(self.script.lanes.values())
        return (y >= min(lanes) - 0.5) & (y <= max(lanes) + 0.5)


class Course:
    """Episodes under way.

    Args:
        scene: of all of them.
        sut: the system under test.
        starts: gap from the ego's front to the actor's rear (m), the actor's and the ego's speed
            (m/s) (n, 3).
        dt: time step, s.

    Attributes:
        ego, actor: in all episodes.
        time: steps so far.
        contact: step of the first contact (n,); −1 for none so far.
        clearance: least distance of the boxes so far (n,), m. near: the distance now.
    """

    def __init__(self, scene: Scene, sut: Any, starts: FloatArray, dt: float) -> None:
        n = len(starts)
        gap, speed, ego_speed = starts.T
        lanes = scene.script.lanes
        self.scene, self.dt, self.steps = scene, dt, 0
        self._driver = driver(sut, n)
        self.ego = _body(scene.ego, np.full(n, START), lanes[scene.ego.lane], ego_speed)
        self.actor = _body(scene.actor, START + scene.between + gap, lanes[scene.actor.lane], speed)
        self.contact, self._returning, self._changed = (
            np.full(n, -1),
            np.zeros(n, bool),
            np.zeros(n, bool),
        )
        self.clearance = np.full(n, np.inf)
        self._look()

    def advance(self, x: FloatArray, y: FloatArray) -> None:
        """One step, in which the actor moves to positions (n,), m, and the ego as its driver decides."""
        ego, actor, dt = self.ego, self.actor, self.dt
        before = ego.speed, actor.speed, actor.y
        seen = Situation(
            ego.motion(), [actor.motion()], ego.speed, ego.acceleration, ego.target, self._changed
        )
        intervenes, wanted = self._driver.control(seen, dt)
        speed, self._returning = driven(ego, intervenes, wanted, self._returning, dt)
        ego.move(speed, np.zeros_like(speed), dt)
        _moved(actor, x, y, dt)
        self.steps += 1
        after = ego.speed, actor.speed, actor.y
        self._changed = np.any(
            [np.abs(b - a) > _CHANGED for a, b in zip(before, after, strict=True)], axis=0
        )
        self._look()

    @property
    def gap(self) -> FloatArray:
        """From the ego's front to the actor's rear along the road (n,), m; negative once it is past that."""
        gap: FloatArray = self.actor.x - self.ego.x - self.scene.between
        return gap

    def _look(self) -> None:
        self.near = box_distance(self.ego.motion(), self.actor.motion())
        self.clearance = np.minimum(self.clearance, self.near)
        self.contact = np.where((self.near <= 0.0) & (self.contact < 0), self.steps, self.contact)


def replayed(scene: Scene, sut: Any, starts: FloatArray, ways: FloatArray, dt: float) -> Course:
    """The episodes in which the actor goes the same ways (n, steps + 1, 2), m, whatever the ego does, at their ends."""
    course = Course(scene, sut, starts, dt)
    for step in range(1, ways.shape[1]):
        course.advance(ways[:, step, 0], ways[:, step, 1])
    return course


def _body(actor: Actor, x: FloatArray, y: float, speed: FloatArray) -> Body:
    n = len(x)
    return Body(
        actor,
        np.array(x),
        np.full(n, y),
        np.zeros(n),
        speed.copy(),
        np.zeros(n),
        speed.copy(),
        np.zeros(n),
    )


def _moved(body: Body, x: FloatArray, y: FloatArray, dt: float) -> None:
    """Put a participant somewhere, heading the way that leads there."""
    dx, dy = x - body.x, y - body.y
    speed = np.hypot(dx, dy) / dt
    body.h = np.where(speed > _CHANGED, np.arctan2(dy, dx), body.h)
    body.straight = False
    body.x, body.y, body.drift = x, y, dy / dt
    body.acceleration, body.speed = (speed - body.speed) / dt, speed
