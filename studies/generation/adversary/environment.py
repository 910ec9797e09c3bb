"""The adversary's side of many episodes at once: what it sees, how its accelerations move it, what
it is after."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from generation.search.outcomes import JUDGES
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from studies.generation.adversary import OBJECTIVES
from studies.generation.adversary.actions import DECISIONS, INTERVAL, STATE
from studies.generation.adversary.course import Course, Scene, replayed
from studies.generation.adversary.driving import Driving
from studies.generation.adversary.shape import shape

OBSERVED = len(STATE) + 3
"""Numbers that the policy sees: the state, the ego's acceleration, the time, and what likelihood is
left to spend"""
_SPENT, _BRAKING = 10.0, 5.0
"""Log-density, and acceleration of the ego (m/s²), that the policy sees as 1"""
_UNPREVENTED = 0.1
"""Value of a collision that no careful driver prevents, relative to a finding"""


@dataclass(frozen=True, eq=False)
class Episodes:
    """Episodes that are over.

    Attributes:
        starts: gap (m), speed of the actor and of the ego (m/s) (n, 3).
        ways: positions of the actor's reference point (n, steps + 1, 2), m, at each time step.
        contact: step of the first contact (n,); −1 for none.
        foreseeable: as likely as recorded driving, up to the contact or the end (n,).
        preventable: a collision that one of the judges does not have on the same way of the actor
            (n,).
        log_density: mean log-density of the decisions up to the contact (n,).
        clearance: least distance of the boxes (n,), m.
    """

    starts: FloatArray
    ways: FloatArray
    contact: IntArray
    foreseeable: BoolArray
    preventable: BoolArray
    log_density: FloatArray
    clearance: FloatArray

    @property
    def failing(self) -> BoolArray:
        """Foreseeable and preventable collisions (n,)."""
        return self.foreseeable & self.preventable

    def take(self, rows: IntArray | BoolArray) -> Episodes:
        """Subset of the episodes."""
        return Episodes(**{name: values[rows] for name, values in vars(self).items()})


class Transitions(NamedTuple):
    """Training data of a policy: rows of observation, action (−1 to 1), reward, next observation,
    and end flag."""

    seen: FloatArray
    done: FloatArray
    reward: FloatArray
    then: FloatArray
    over: FloatArray


class Environment:
    """Plays episodes of a policy.

    Args:
        scene: place and entities. driving: of recorded drivers. sut: the system under test. dt:
            time step, s.
        discount: of what comes later, for the shape of the reward.
        objective: shapes it, a name in `studies.generation.adversary.OBJECTIVES`.

    Raises:
        UsageError: there is no such objective.
    """

    def __init__(
        self,
        scene: Scene,
        driving: Driving,
        sut: Any,
        dt: float,
        discount: float,
        objective: str = OBJECTIVES[0],
    ) -> None:
        self._near = shape(objective)
        self._scene, self._driving, self._sut, self._dt, self._discount = (
            scene,
            driving,
            sut,
            dt,
            discount,
        )
        self._steps = round(INTERVAL / dt)

    def play(self, starts: FloatArray, policy: Any) -> tuple[Episodes, Transitions]:
        """Play episodes from starts (n, 3) to their ends.

        Args:
            policy: gives actions (n, 2), −1 to 1, for what is observed (n, `OBSERVED`).
        """
        with Course(self._scene, self._sut, starts, self._dt) as course:
            return self._played(
                starts, policy, _Adversary(self._scene, self._driving, course, self._steps)
            )

    def _played(
        self, starts: FloatArray, policy: Any, driver: _Adversary
    ) -> tuple[Episodes, Transitions]:
        seen, done, near, density, contacts = (
            [driver.observed()],
            [],
            [self._near(driver.course)],
            [],
            [driver.course.contact],
        )
        for _ in range(DECISIONS):
            done.append(driver.act(policy(seen[-1])))
            seen.append(driver.observed())
            near.append(self._near(driver.course))
            density.append(driver.density)
            contacts.append(driver.course.contact)
        episodes = self._judged(starts, driver, np.array(density))
        return episodes, self._transitions(
            episodes, np.array(seen), np.array(done), np.array(near), np.array(contacts)
        )

    def _judged(self, starts: FloatArray, driver: _Adversary, density: FloatArray) -> Episodes:
        course, ways = driver.course, np.stack(driver.ways, axis=1)
        hit = course.contact >= 0
        decisions = np.where(hit, -(-course.contact // self._steps), DECISIONS).clip(1)
        sums = np.cumsum(density, axis=0)[decisions - 1, np.arange(len(starts))]
        likely = np.array(
            [
                self._driving.foreseeable(total, count)
                for total, count in zip(sums, decisions, strict=True)
            ]
        )
        prevented = np.zeros(len(starts), bool)
        for judge in JUDGES:
            left = np.flatnonzero(hit & ~prevented)
            if left.size:
                prevented[left] = (
                    replayed(self._scene, judge, starts[left], ways[left], self._dt).contact < 0
                )
        return Episodes(
            starts, ways, course.contact, likely & driver.inside(), prevented, sums / decisions,
            course.clearance
        )  # fmt: skip

    def _transitions(
        self,
        episodes: Episodes,
        seen: FloatArray,
        done: FloatArray,
        near: FloatArray,
        contacts: IntArray,
    ) -> Transitions:
        """Return the transitions up to each contact, with shaped rewards."""
        before, after = contacts[:-1] < 0, contacts[1:] < 0
        worth = np.where(episodes.failing, 1.0, _UNPREVENTED * episodes.foreseeable)
        hit = before & ~after
        reward = (
            self._discount * np.where(hit, 0.0, near[1:]) - near[:-1] + np.where(hit, worth, 0.0)
        )
        over = hit.astype(np.float64)
        over[-1] = 1.0
        return Transitions(
            seen[:-1][before], done[before], reward[before], seen[1:][before], over[before]
        )


class _Adversary:
    """An actor under way: accelerations that change evenly between decisions."""

    def __init__(self, scene: Scene, driving: Driving, course: Course, steps: int) -> None:
        n = len(course.contact)
        self.course, self._scene, self._driving, self._steps = course, scene, driving, steps
        self._velocity = np.stack([course.actor.speed, np.zeros(n)], axis=1)
        self._acceleration, self._sums, self._count = np.zeros((n, 2)), np.zeros(n), 0
        self.density = np.zeros(n)
        self.ways = [np.stack([course.actor.s, course.actor.t], axis=1)]
        self._turn = np.array([1.0, scene.side])

    @property
    def state(self) -> FloatArray:
        """The columns of `studies.generation.adversary.actions.STATE` (n, 7)."""
        ego, actor, side = self.course.ego, self.course.actor, self._scene.side
        aside, drift = side * (actor.t - ego.t), side * self._velocity[:, 1]
        own = self._acceleration * self._turn
        speed = self._velocity[:, 0]
        return np.stack(
            [self.course.gap, aside, drift, ego.speed - speed, speed, own[:, 0], own[:, 1]], axis=1
        )

    def observed(self) -> FloatArray:
        """Observations of the policy (n, `OBSERVED`), about −1 to 1."""
        driving, count = self._driving, min(self._count, DECISIONS - 1)
        left = self._sums - driving.least[count] * self._count
        time, likely = (
            np.full(len(left), self._count / DECISIONS),
            np.clip(left / _SPENT, -1.0, 1.0),
        )
        state = np.clip((self.state - driving.mean) / (2.0 * driving.spread), -3.0, 3.0)
        return np.hstack(
            [state, np.stack([self.course.ego.acceleration / _BRAKING, time, likely], axis=1)]
        )

    def act(self, wanted: FloatArray) -> FloatArray:
        """Do what is nearest to the wanted (n, 2), −1 to 1, that is foreseeable; what is done, on
        the same scale."""
        limits, state = self._driving.limits, self.state
        middle, half = 0.5 * (limits.high + limits.low), 0.5 * (limits.high - limits.low)
        action, self.density = self._driving.kept(
            state, middle + half * wanted, self._sums, self._count
        )
        self._sums, self._count = self._sums + self.density, self._count + 1
        self._move(action * self._turn)
        return (action - middle) / half

    def _move(self, then: FloatArray) -> None:
        """Move for an interval at the end of which the accelerations are these (n, 2), m/s²."""
        begin, dt = self._acceleration, self.course.dt
        for step in range(self._steps):
            middle = begin + (then - begin) * (step + 0.5) / self._steps
            before = self._velocity
            self._velocity = before + middle * dt
            self._velocity[:, 0] = np.maximum(self._velocity[:, 0], 0.0)
            self.ways.append(self.ways[-1] + 0.5 * (before + self._velocity) * dt)
            self.course.advance(*self.ways[-1].T)
        self._acceleration = then

    def inside(self) -> BoolArray:
        """Mask of actors that kept to the road (n,), up to the contact."""
        inside = np.array([self._scene.inside(way[:, 1]) for way in self.ways])
        steps, contact = np.arange(len(inside))[:, None], self.course.contact
        return np.asarray(np.all(inside | ((contact >= 0) & (steps > contact)), axis=0), bool)
