"""Contacts between participants: which bounding boxes overlap or touch, from when to when.

A contact that is there at the end of a step begins with that instant. One that begins and ends
within a step, as at long steps or at grazed corners, begins when the boxes touch, and lasts until
the end of the step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

from runner.engine.participants.boxes import first_touch, overlap
from runner.engine.participants.entity import FEW, JUMP, Entity, Separation

if TYPE_CHECKING:
    from runner.engine.compile.protocols import Run
    from runner.engine.participants.rows import EntityRows
    from schemas.common.array_types import BoolArray, IntArray

_by_x = attrgetter("x")
_by_name = attrgetter("name")
_MARGIN = 10.0
"""Distance (m) up to which pairs are kept under observation beyond that at which they might touch
"""
_ROUNDING = 1e-6
_FASTER = 1.5
"""Displacement in a step as a multiple of the present one, up to which pairs are kept"""
_TOLERANCE = 1.01
"""Share of its Performance's greatest speed that an entity may have"""
_MARGIN_OF_REACH = 1e-3
"""Distance (m) that is no rounding of a reach"""


_Pair = tuple[Entity, Entity, float, Separation]
"""Two participants that may touch soon, and the distance of their reference points along an axis
(m) above which they do not touch, and did not within the last step"""
_Contact = tuple[Entity, Entity, float]
"""Two participants that touch, and the time from which on they do, if they did not before (s)"""


class Contacts:
    """Current contacts between entities; start and end of each are logged as events.

    Pairs near each other are found by sweep and prune over x. These are looked at in each step
    until others may have come near (Verlet, Computer Experiments on Classical Fluids, Physical
    Review 159, 1967).

    A tractor and the trailer on its hitch do not count: their boxes may overlap by construction.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._near: list[_Pair] = []
        """pairs that may touch soon"""
        self._everyone: list[Entity] = []
        """the participants when these were found"""
        self._changes = -1
        """`Run.changes` at the last full check: entities appear and disappear only with a change"""
        self._due = -math.inf
        """total displacement at which others may touch"""
        self._total = 0.0
        """total displacement a step ago"""
        self._longest = 0.0
        """displacement of any participant in a step up to which the pairs are those that may touch
        """
        self._partners: dict[str, list[Entity]] = {}
        self.pairs: set[tuple[str, str]] = set()
        self.history: list[tuple[float, str, str]] = []
        """Beginnings of contacts: time (s) and the two names in alphabetical order."""

    def update(self) -> None:
        """Look at all present entities once a step."""
        run = self._run
        if self._changes != run.changes:
            self._changes = run.changes
            everyone = list(run.entities.values())
            # Compared by identity in document order: a change of anything else needs no new search
            # for pairs.
            if everyone != self._everyone:
                self._everyone, self._due = everyone, -math.inf
            for *_, separation in self._near:
                separation.forget()  # an action may have put one of them elsewhere
        # With few entities `_due` is infinite once all pairs are kept: no total is asked for.
        if self._due != math.inf:
            total = run.displacement.total if len(self._everyone) > FEW else math.inf
            # The second part: the pairs are complete for displacements of up to `_longest` in one
            # step only.
            if total >= self._due or total - self._total > self._longest:
                self._near = self._look_around()
            self._total = total
        found: list[_Contact] = []
        for a, b, reach, separation in self._near:
            # Boxes along x and y are the cheapest test; it ends here for most pairs.
            if not -reach <= b.x - a.x <= reach or not -reach <= b.y - a.y <= reach:
                continue
            apart = not separation.touching and separation.exceeds(_ROUNDING)
            # Its last measurement excludes a contact now and, as the way is straight, on the way
            # here.
            if not apart or separation.measured:
                self._look_at(a, b, separation, apart, found)
        if found or self.pairs:
            self._compare(found)

    def _look_at(
        self, a: Entity, b: Entity, separation: Separation, apart: bool, found: list[_Contact]
    ) -> None:
        """Add a pair to those found if it touches now, or has touched within this step.

        Args:
            apart: whether a gap in the plane is known to be there now.
        """
        separation.measured = False
        if not _counts(a, b):
            return
        run, dt, before = self._run, self._run.dt, separation.touching
        separation.touching = not apart and overlap(a, b)
        if separation.touching:
            found.append((a, b, run.time))
            return
        # They do not touch now. They can have touched within the step only if they were apart
        # before it, and no further apart than they moved towards each other.
        way = math.hypot((b.vx - a.vx) * dt, (b.vy - a.vy) * dt)
        if before or separation.exceeds(way) or not run.step_index:
            return
        # A teleport passes through nothing on its way.
        share = first_touch(a, b, dt) if not (jumped(a, dt) or jumped(b, dt)) else None
        if share is not None:
            found.append((a, b, run.time - (1.0 - share) * dt))

    def _look_around(self) -> list[_Pair]:
        """Pairs to check until an entity has moved far enough, or further in a step; every pair if
        there are few entities."""
        dt = self._run.dt
        if len(self._everyone) <= FEW:
            self._due = math.inf
            return [_pair(a, b, _longest(a, b, dt)) for a, b in combinations(self._everyone, 2)]
        # Sweep and prune: sorted by x, a search stops at the first one too far ahead.
        order = [entity for entity in self._everyone if entity.active and entity.placed]
        order.sort(key=_by_x)
        widest = max((entity.reach for entity in order), default=0.0)
        fastest = max((math.hypot(entity.vx, entity.vy) for entity in order), default=0.0)
        self._longest = _FASTER * fastest * dt
        # Two entities move towards each other at the most.
        way = 2.0 * self._longest
        margin = max(_MARGIN, way)  # with those that were near in this step
        pairs = []
        for index, a in enumerate(order):
            for b in order[index + 1 :]:
                dx = b.x - a.x
                if dx > a.reach + widest + margin:
                    break
                near = a.reach + b.reach + margin
                if dx <= near and abs(b.y - a.y) <= near:
                    pairs.append(_pair(a, b, way))
        # Half of the margin each: no pair left out can touch before both have used theirs.
        self._due = self._run.displacement.after(_MARGIN / 2)
        return pairs

    def _compare(self, found: list[_Contact]) -> None:
        pairs: dict[tuple[str, str], float] = {}
        self._partners.clear()
        for a, b, since in found:
            # Names in alphabetical order, so that the log does not depend on which one was declared
            # first.
            pairs[(a.name, b.name) if a.name < b.name else (b.name, a.name)] = since
            self._partners.setdefault(a.name, []).append(b)
            self._partners.setdefault(b.name, []).append(a)
        begun = sorted((pairs[pair], *pair) for pair in pairs.keys() - self.pairs)
        for time, first, second in begun:
            self.history.append((time, first, second))
            self._run.note("collision", first, f"touches {second}", time)
        for first, second in sorted(self.pairs - pairs.keys()):
            self._run.note("collisionEnd", first, f"no longer touches {second}")
        self.pairs = set(pairs)

    def of(self, entity: Entity) -> Sequence[Entity]:
        """Return the entities in contact with an entity, by name."""
        touched = self._partners.get(entity.name)
        return sorted(touched, key=_by_name) if touched else ()


def _pair(a: Entity, b: Entity, way: float) -> _Pair:
    return a, b, a.reach + b.reach + _MARGIN_OF_REACH + way, Separation(a, b)


def _longest(a: Entity, b: Entity, dt: float) -> float:
    """Longest way (m) of two entities towards each other in a step; a faster one makes a run
    inconclusive."""
    fastest = a.declared.performance.max_speed + b.declared.performance.max_speed
    return _TOLERANCE * fastest * dt


def jumped(entity: Entity, dt: float) -> bool:
    """Whether an entity was put elsewhere in this step: it has moved further
    than its speed allows.
    """
    fastest = max(abs(entity.speed), abs(entity.speed - entity.acceleration * dt))
    return math.hypot(entity.vx, entity.vy) * dt > fastest * dt + JUMP


def jumped_arrays(rows: EntityRows, dt: float, chosen: IntArray) -> BoolArray:
    """`jumped` in some of many runs (k,)."""
    speed = rows.speed[chosen]
    fastest = np.maximum(np.abs(speed), np.abs(speed - rows.acceleration[chosen] * dt))
    way = np.hypot(rows.vx[chosen], rows.vy[chosen]) * dt
    found: BoolArray = way > fastest * dt + JUMP
    return found


def _counts(a: Entity, b: Entity) -> bool:
    """Whether a contact of these two is one: both are there, and neither is the other's trailer."""
    there = a.active and a.placed and b.active and b.placed
    return there and a.controls.trailer is not b and b.controls.trailer is not a
