"""Entities in a run: declaration, state, the owner of each control domain, and bounds on their
displacements."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol

import numpy as np

from runner.engine.participants.boxes import plane_gap, reach
from runner.engine.participants.declaration import Declaration, EntityState

if TYPE_CHECKING:
    from runner.engine.motion.dynamics import Easing
    from runner.engine.motion.placement import Placement
    from schemas.common.array_types import BoolArray, FloatArray
    from xodr.model import LaneLink, RoadPoint

LATERAL = "lateral"
"""Control domain of motion to the side; `runner.engine.compile.element` has the others"""
LONGEST = 1000.0
"""Growth (m) of `Displacement.total` when an entity appears or disappears: no conclusion reaches
further."""
FEW = 4
"""Participants up to which each pair is looked at in each step: a bound on their displacements
costs more than it spares"""
JUMP = 10.0
"""Distance (m) beyond that of its speed that an entity may be put aside within a step (a lane
change at once)"""
_ROUNDING = 1e-6


class Motion(Protocol):
    """A way of moving.

    Attributes:
        stands: whether at speed 0 it leaves entities as they are, but for their controls, and
            itself as well.
    """

    stands: bool

    def advance(self, entity: Entity, speed: float, dt: float) -> float:
        """Move the entity for dt (s) at a speed (m/s, signed), pose and road coordinates included.

        Returns the speed that it really had: less at the end of the road.
        """
        ...

    def distance_to(self, entity: Entity, placement: Placement) -> float | None:
        """Distance (m) along the entity's own path to a place, negative once passed; None where
        none leads there.

        In reverse gear what lies behind is what is still to be reached.
        """
        ...


class Guide(Protocol):
    """Guide of an entity at junctions, and to the lanes that lead there.

    Attributes:
        released: whether an action has put the entity into a lane: lanes that are only wished for
            no longer count.
    """

    released: bool

    def choose(self, point: RoadPoint, forward: bool, links: Sequence[LaneLink]) -> LaneLink | None:
        """The way on at the end of a road: one of the lanes reached; None to stop there."""
        ...

    def foresee(
        self, point: RoadPoint, forward: bool, links: Sequence[LaneLink]
    ) -> LaneLink | None:
        """The same without any effect, for a look ahead; None where it is not decided yet."""
        ...

    def lane(self, entity: Entity, forward: bool) -> tuple[int, float]:
        """The lane for an entity on the road to keep to, its own or one to change to, and the way
        (m) left for the change."""
        ...

    def waits(self, entity: Entity, lane: int, way: float) -> bool:
        """Whether an entity has to wait for a gap before it changes to a lane along a way (m)."""
        ...

    def settled(self, entity: Entity, forward: bool) -> float:
        """The s (m) up to which `lane` keeps an entity's lane as it is; the entity's own where that
        is not known."""
        ...

    def leads(self, road_id: str, forward: bool, links: Sequence[LaneLink]) -> bool:
        """Whether one of the lanes reached at a road's end continues the route."""
        ...

    def enter(self, road_id: str, forward: bool) -> None:
        """The entity has come to a road, moving towards its +s or not."""
        ...

    def distance(self, here: RoadPoint, there: RoadPoint) -> float | None:
        """Distance (m, in s) along the route from one point to another, negative backwards; None
        where it says nothing."""
        ...


class Owner(Protocol):
    """Owner of a control domain of an entity: an action in execution."""

    def override(self, reason: str) -> None:
        """End the action for this entity: a newer action takes the domain."""
        ...


class Driver(Protocol):
    """Driver of an entity in place of the scenario; `runner.systems.drivers` has the two kinds."""

    def hand_over(self, domains: Mapping[str, bool]) -> None:
        """Let it drive, or no longer drive, in control domains (ActivateControllerAction)."""
        ...


class PoseRows(Protocol):
    """Places and headings in many runs, (n,)."""

    x: FloatArray
    y: FloatArray
    h: FloatArray


class FreeMotion:
    """Straight ahead in the direction faced, off any lane."""

    stands = True

    def advance(self, entity: EntityState, speed: float, dt: float) -> float:
        """Move along the heading."""
        distance = speed * dt
        entity.x += distance * math.cos(entity.h)
        entity.y += distance * math.sin(entity.h)
        return speed

    def advance_arrays(
        self, rows: PoseRows, speed: FloatArray, dt: float, going: BoolArray
    ) -> None:
        """`advance` in many runs (n,), where they are `going`."""
        distance = np.where(going, speed * dt, 0.0)
        rows.x = rows.x + distance * np.cos(rows.h)
        rows.y = rows.y + distance * np.sin(rows.h)

    def distance_to(self, entity: EntityState, placement: Placement) -> float | None:
        """Return the distance to the place ahead."""
        dx, dy = placement.x - entity.x, placement.y - entity.y
        ahead = dx * math.cos(entity.h) + dy * math.sin(entity.h)
        return ahead if entity.speed >= 0.0 else -ahead


STRAIGHT_AHEAD = FreeMotion()
"""Motion of entities without lane, path or driver."""


@dataclass(slots=True, eq=False)
class Controls:
    """Control of an entity: its owners, and the scenario's requests for the coming step."""

    motion: Motion = STRAIGHT_AHEAD
    preferred_layer: str | None = None
    """layer of lanes that a PreferredLaneLayerAction has asked for"""
    route: Guide | None = None
    """what it follows at junctions; None for the straightest way"""
    owners: dict[str, Owner] = field(default_factory=dict)
    """control domain → the action in execution that holds it"""
    target_speed: float = 0.0
    """speed that the scenario asks for at the end of this step, m/s"""
    target_offset: float | None = None
    """lane offset that the running lateral action asks for at the end of this step, m"""
    easing: Easing | None = None
    """its way back into the lane, from beside it"""
    path_compensated: bool = True
    """whether lateral motion is taken out of the distance travelled (lane change) or added to it
    (lane offset)"""
    controllers: dict[str, Mapping[str, str]] = field(default_factory=dict)
    """the controllers assigned: name → properties"""
    activated: bool = False
    """whether an action has activated a controller of it in any domain"""
    overrides: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    """controller inputs that OverrideControllerValueAction holds"""
    driver: Driver | None = None
    """driver of the entity for the system under test, if any"""
    world_driven: bool = False
    """whether the simulator's own driver moves it"""
    tractor: Entity | None = None
    trailer: Entity | None = None


class Entity(EntityState):
    """One participant of a run: a declaration, with its state (see `EntityState`) and its controls.

    Args:
        declared: what the scenario says of it.
        spawned: whether a traffic action has brought it in.
    """

    __slots__ = ("box", "controls", "declared", "name", "reach", "spawned")

    controls: Controls

    def __init__(self, declared: Declaration, spawned: bool = False) -> None:
        self.declared = declared
        self.spawned = spawned
        self.name = declared.name
        self.box = declared.box
        self.reach = reach(declared.box)
        self.reset()

    def reset(self) -> None:
        """Reset state and controls to those before a run, and detach trailers."""
        EntityState.__init__(self)
        self.controls = Controls(controllers=dict(self.declared.controllers))

    def __repr__(self) -> str:
        return f"<{self.declared.kind} {self.name}>"


class Entities(dict[str, Entity]):
    """All participants of a run by name, the declared ones in document order.

    Args:
        declared: those that the scenario declares.
    """

    def __init__(self, declared: Mapping[str, Entity] | None = None) -> None:
        super().__init__(declared or {})
        self.couplings: list[tuple[Entity, Entity]] = []
        """tractors with the trailers on their hitches at the beginning"""

    def couple(self, tractor: Entity, trailer: Entity) -> None:
        """Declare that a trailer is on a tractor's hitch at the beginning."""
        self.couplings.append((tractor, trailer))
        tractor.controls.trailer, trailer.controls.tractor = trailer, tractor

    def reset(self) -> None:
        """Reset all entities, put trailers on their hitches, and remove entities that were added in
        the run."""
        for name in [name for name, entity in self.items() if entity.spawned]:
            del self[name]
        for entity in self.values():
            entity.reset()
        for tractor, trailer in self.couplings:
            tractor.controls.trailer, trailer.controls.tractor = trailer, tractor


class Stepping(Protocol):
    """Used part of a run: its entities, and the number of steps done."""

    @property
    def entities(self) -> Entities: ...
    @property
    def step_index(self) -> int: ...


class Displacement:
    """A bound on the displacements since the beginning of a run.

    `total` (m) grows from one step in which it is asked for to the next by the greatest
    displacement of any participant: between two of these no reference point has moved further in
    the plane than it has grown. So two that are `d` apart are not nearer than `c` to each other
    before it has grown by (d - c) / 2, however they drive, and wherever actions put them.

    Args:
        run: run of the entities.
    """

    def __init__(self, run: Stepping) -> None:
        self._run = run
        self._total = self._growth = 0.0
        self._step = -1
        self._present: list[Entity] = []
        self._places: list[tuple[float, float]] = []

    @property
    def followed(self) -> bool:
        """Whether it is worth to ask for the bound in each step."""
        return len(self._run.entities) > FEW

    def reaches(self, total: float, steps: int) -> bool:
        """Whether the bound gets to a total (m) within some steps as large as the last one."""
        return self.total + steps * self._growth >= total

    @property
    def total(self) -> float:
        """The bound at the end of this step."""
        if self._step != self._run.step_index:
            self._step = self._run.step_index
            self._look()
        return self._total

    def _look(self) -> None:
        present = [
            entity for entity in self._run.entities.values() if entity.active and entity.placed
        ]
        places = [(entity.x, entity.y) for entity in present]
        if present == self._present:
            self._growth = max(map(math.dist, places, self._places), default=0.0)
            self._total += self._growth
        else:
            self._total += LONGEST
        self._present, self._places = present, places

    def after(self, way: float) -> float:
        """Total at which an entity may have covered a distance (m); the present one if that is not
        positive."""
        return self.total + min(max(way - _ROUNDING, 0.0), LONGEST)


class Separation:
    """Two participants, with their gap in the plane when it was last measured, and how they stood
    to each other then.

    Since then no point of one box has come nearer to one of the other than both reference points
    have moved relative to each other, and the boxes have turned about them.
    """

    __slots__ = ("_a", "_b", "_gap", "_ha", "_hb", "_x", "_y", "measured", "touching")

    def __init__(self, a: Entity, b: Entity) -> None:
        self._a, self._b = a, b
        self._gap = -math.inf
        self._x = self._y = self._ha = self._hb = 0.0
        self.measured = False
        """for the caller: whether it has been measured since the caller set this back"""
        self.touching = False
        """for the caller: whether they touched when it looked last"""

    def exceeds(self, distance: float) -> bool:
        """Whether the gap in the plane is certainly greater than a distance (m)."""
        a, b = self._a, self._b
        x, y, ha, hb = b.x - a.x, b.y - a.y, a.h, b.h
        left = self._gap - math.hypot(x - self._x, y - self._y)
        if ha != self._ha or hb != self._hb:
            left -= a.reach * abs(ha - self._ha) + b.reach * abs(hb - self._hb)
        if left > distance:
            return True
        self._x, self._y, self._ha, self._hb = x, y, ha, hb
        self._gap, self.measured = plane_gap(a, b), True
        return self._gap > distance

    def forget(self) -> None:
        """Measure the gap anew when it is asked for."""
        self._gap = -math.inf
