"""What a worked-out scenario says about its entities before it runs: the lane and the speed with which each starts.

That is enough to say relatively or absolutely, by time or by distance, what an entity's first action of a kind does; what a
later one does is known only when the scenario runs.
"""

from __future__ import annotations

from typing import NamedTuple

from xosc.node import Node


class Start(NamedTuple):
    """How an entity starts.

    road, lane, s (m): None, 0 and 0 where its position does not name them. speed: m/s; None where none is set.
    """

    road: str | None = None
    lane: int = 0
    s: float = 0.0
    speed: float | None = None


def starts(scenario: Node) -> dict[str, Start]:
    """How the entities start, by name.

    Args:
        scenario: root of a document whose attributes are literals.
    """
    privates = {node.get("entityRef"): node for node in scenario.need("Storyboard", "Init").iter("Private")}
    return {name: Start(*_lane(name, privates, ()), _speed(node)) for name, node in privates.items()}


def _lane(name: str, privates: dict[str, Node], inside: tuple[str, ...]) -> tuple[str | None, int, float]:
    teleports = list(privates[name].iter("TeleportAction")) if name in privates and name not in inside else []
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
    """The lane id `steps` lanes towards +t (the centre lane is not counted); 0 from where there is no lane."""
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
        [node.get("entityRef")] if node.tag == "Private" else [each.get("entityRef") for each in node.need("Actors").children()]
    )


def first(action: Node, tag: str, scenario: Node) -> bool:
    """Whether an entity does nothing of that kind in the story besides this action, so that it still is as it started."""
    story = [each for story in scenario.need("Storyboard").children("Story") for each in story.iter(tag)]
    return sum(set(actors(each)) & set(actors(action)) != set() for each in story) <= 1
