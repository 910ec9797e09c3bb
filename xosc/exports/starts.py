"""Initial lanes, speeds and positions of entities, and ways of routes, in a worked-out scenario on
its roads.

The start of an entity is enough to express its first action of a kind relatively or absolutely, by
time or by distance. The values of a later action are known only when the scenario runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, Protocol

from xosc.document.node import Node


class InitialState(NamedTuple):
    """Initial state of an entity.

    road, lane, s (m): None, 0 and 0 where its position does not name them. speed: m/s; None where
    none is set. pose: x, y, z (m) and heading (rad), where the roads are known. centred: whether it
    is in the middle of its lane and faces as the traffic there.
    """

    road: str | None = None
    lane: int = 0
    s: float = 0.0
    speed: float | None = None
    pose: tuple[float, float, float, float] | None = None
    centred: bool = False


def starts(scenario: Node) -> dict[str, InitialState]:
    """Return the initial states of the entities by name.

    Args:
        scenario: root of a document whose attributes are literals.
    """
    privates = {
        node.get("entityRef"): node for node in scenario.need("Storyboard", "Init").iter("Private")
    }
    return {
        name: InitialState(*_lane(name, privates, ()), _speed(node))
        for name, node in privates.items()
    }


def _lane(
    name: str, privates: dict[str, Node], inside: tuple[str, ...]
) -> tuple[str | None, int, float]:
    # Positions may refer to each other in a circle; of several teleports the last one counts.
    teleports = (
        list(privates[name].iter("TeleportAction"))
        if name in privates and name not in inside
        else []
    )
    position = teleports[-1].need("Position").only() if teleports else None
    if position is not None and position.tag == "LanePosition":
        return position.get("roadId"), position.int("laneId"), position.float("s")
    if position is not None and position.tag == "RelativeLanePosition" and position.has("ds"):
        road, lane, s = _lane(position.get("entityRef"), privates, (*inside, name))
        target = beside(lane, position.int("dLane")) if position.int("dLane") else lane
        return (road, target, s + position.float("ds")) if road is not None else (None, 0, 0.0)
    return None, 0, 0.0


def _speed(private: Node) -> float | None:
    speeds = [target.float("value") for target in private.iter("AbsoluteTargetSpeed")]
    return speeds[-1] if speeds else None


def beside(lane: int, steps: int) -> int:
    """The lane id `steps` lanes towards +t (the centre lane is not counted); 0 from where there is
    no lane."""
    # Ids of lanes jump over 0, the centre lane.
    target = lane + steps
    return target if (target > 0) == (lane > 0) and target else target + (1 if steps > 0 else -1)


def actors(action: Node) -> list[str]:
    """The entities that do an action of a story, or of Init."""
    node: Node | None = action
    while node is not None and node.tag not in ("ManeuverGroup", "Private"):
        node = node.parent
    if node is None:
        return []
    return (
        [node.get("entityRef")]
        if node.tag == "Private"
        else [reference.get("entityRef") for reference in node.need("Actors").children()]
    )


State = Callable[[Node, str], InitialState | None]
"""Function that returns the known state of an entity at the start of an action, by the action and
the entity's name."""


def as_started(scenario: Node, known: Mapping[str, InitialState]) -> State:
    """Return certain states: the initial one, if no earlier action can have changed it."""

    def state(action: Node, entity: str) -> InitialState | None:
        holder = next(
            ancestor.tag
            for ancestor in action.element.iterancestors()
            if ancestor.tag in ("LateralAction", "LongitudinalAction")
        )
        return known.get(entity) if first(action, str(holder), scenario) else None

    return state


def as_told(scenario: Node, known: Mapping[str, InitialState]) -> State:
    """Return expected states: lane and speed that the preceding actions in the file set."""
    stories = [
        action
        for story in scenario.need("Storyboard").children("Story")
        for action in story.iter(*_DEMANDS)
    ]

    def state(action: Node, entity: str) -> InitialState | None:
        now = known.get(entity)
        for story in stories:
            if story.element is action.element or now is None:
                break
            if entity in actors(story):
                now = _after(story, entity, now, state)
        return now

    return state


def as_expected(scenario: Node, known: Mapping[str, InitialState], during: State) -> State:
    """Return expected states; lane or speed that they leave open are taken from a run.

    Args:
        during: how an entity is when an action begins in a run.
    """
    told = as_told(scenario, known)

    def state(action: Node, entity: str) -> InitialState | None:
        now = told(action, entity)
        if now is not None and now.road is not None and now.speed is not None:
            return now
        return during(action, entity) or now

    return state


_DEMANDS = ("SpeedAction", "SpeedProfileAction", "LongitudinalDistanceAction", "SynchronizeAction",
    "LaneChangeAction",
            "TeleportAction", "FollowTrajectoryAction")  # fmt: skip


def target_speed(action: Node, state: State) -> float | None:
    """The speed (m/s) that a SpeedAction asks for; None where that is not known."""
    target = action.need("SpeedActionTarget").only()
    if target.tag == "AbsoluteTargetSpeed":
        return target.float("value")
    other = state(action, target.get("entityRef"))
    # A continuous target moves on with the other one.
    if other is None or other.speed is None or target.bool("continuous"):
        return None
    value = target.float("value")
    return (
        other.speed * value
        if target.get("speedTargetValueType") == "factor"
        else other.speed + value
    )


def _after(action: Node, entity: str, now: InitialState, state: State) -> InitialState:
    """Return the state of an entity after an action; unknown values are those of an empty
    `InitialState`."""
    if action.tag == "SpeedAction":
        return now._replace(speed=target_speed(action, state))
    if action.tag == "LaneChangeAction":
        target = action.need("LaneChangeTarget").only()
        # Relative lanes count to the left as the entity faces: against +t on lanes of the left
        # side.
        facing = 1 if now.lane < 0 else -1
        if target.tag == "AbsoluteTargetLane":
            return now._replace(lane=target.int("value"))
        if target.get("entityRef") == entity:
            return now._replace(lane=beside(now.lane, facing * target.int("value")))
        # Beside another entity, whose lane then is not known from the file.
        return now._replace(road=None)
    return (
        InitialState()
        if action.tag in ("TeleportAction", "FollowTrajectoryAction")
        else now._replace(speed=None)
    )


def first(action: Node, tag: str, scenario: Node) -> bool:
    """Whether an entity does nothing of that kind in the story besides this action, so that it
    still is as it started."""
    story = [
        other
        for story in scenario.need("Storyboard").children("Story")
        for other in story.iter(tag)
    ]
    return sum(set(actors(other)) & set(actors(action)) != set() for other in story) <= 1


class Vertex(NamedTuple):
    """A pose in the world (m, rad), and the time (s) of a vertex that has one. h: None where it is
    that of the way."""

    x: float
    y: float
    z: float
    h: float | None = None
    time: float | None = None


Pose = tuple[float, float, float, float]
"""x, y, z (m) and heading (rad)."""


class RoadGeometry(Protocol):
    """A scenario on its roads."""

    def starts(self) -> Mapping[str, InitialState]:
        """Return the initial states of the entities present at the start, by name."""
        ...

    def begins(self, element: Node) -> float | None:
        """Time (s) at which a storyboard element first begins, in a run without a system under
        test; None where it doesn't."""
        ...

    def ends(self, element: Node) -> float | None:
        """Time (s) at the end of the step in which an element first ends in that run; None where it
        doesn't, or others end it."""
        ...

    def driven(self, entity: str, begin: float, end: float) -> Sequence[Vertex]:
        """Return the positions of an entity at each step of that run between two times (s); times
        start at the first step."""
        ...

    def during(self, action: Node, entity: str) -> InitialState | None:
        """Return the state of an entity at the start of a story's action; None if the action never
        starts or the entity is absent.

        It is so in a run without a system under test.
        """
        ...

    def put(self, action: Node, entity: str) -> Vertex | None:
        """Return the position to which an action teleports an entity in that run; None if the
        action never starts."""
        ...

    def direction(self, road: str, lane: int) -> int:
        """1 where the traffic of a lane drives towards greater s, else −1.

        Raises:
            InvalidFile: there is no such road.
        """
        ...

    def place(self, position: Node) -> Vertex | None:
        """Return the place of an element Position; None if it depends on the run."""
        ...

    def track(
        self,
        trajectory: Node,
        skip: float = 0.0,
        actor: str | None = None,
        pose: Pose = (0.0, 0.0, 0.0, 0.0),
    ) -> Sequence[Vertex] | None:
        """Vertices that stand for a Trajectory from a distance (m) on; None where it depends on
        what happens.

        Args:
            actor: follower; None leaves out trajectories that begin where their actor is.
            pose: where the actor is then; the default gives places in the actor's frame.
        """
        ...

    def way(self, action: Node, entity: str) -> Sequence[Vertex]:
        """The way along lanes that a routing action leads an entity from its start; empty where it
        takes that way anyway.

        Raises:
            Unsupported: it does not start on a lane, or the way depends on what happens.
        """
        ...
