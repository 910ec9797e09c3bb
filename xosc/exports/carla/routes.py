"""Routes for scenario_runner, which stops at them: trajectories along the lanes, or along the way that a run shows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lxml import etree

from schemas.errors import Unsupported
from xosc.document import Document
from xosc.exports.carla.beginning import to_story
from xosc.exports.carla.driven import follow_on
from xosc.exports.carla.ways import follow
from xosc.exports.omissions import leave_out
from xosc.exports.on_roads.geometry import Geometry, Place
from xosc.exports.on_roads.starts import actors
from xosc.node import Node

ROUTES = ("AssignRouteAction", "AcquirePositionAction")
_STOPS = "scenario_runner stops at routes"


def routes(document: Document, geometry: Geometry) -> Iterator[str]:
    """Make trajectories of routes, in place; remarks.

    Raises:
        Unsupported: the way is not known before the scenario runs.
    """
    scenario = document.node
    for action in [each for tag in ROUTES for each in scenario.iter(tag)]:
        try:
            yield _from_the_beginning(action, scenario, geometry)
        except Unsupported as error:
            if _is_left_aside(action, scenario):
                raise
            yield follow_on(action, scenario, geometry, error)


def _is_left_aside(action: Node, scenario: Node) -> bool:
    """Whether its actors go beside their route, or change lanes on it: that leaves a route as it is, and ends a trajectory."""
    doing = set(actors(action))
    return any(doing & set(actors(each)) and not _is_first(each) for each in scenario.iter("LateralAction"))


def _from_the_beginning(action: Node, scenario: Node, geometry: Geometry) -> str:
    """Make a trajectory of a route that leads its actors from the beginning on; the remark."""
    ways = {entity: places for entity in actors(action) if (places := geometry.way(action, entity))}
    for entity in ways:
        _only_way(action, entity, scenario)
    for entity, places in ways.items():
        to_story(Node(_private_action(places), action.path), entity, scenario)
    leave_out(action, scenario)
    said = f"written as a trajectory from the beginning on, {_STOPS}" if ways else "left out, the lanes lead that way"
    return f"{action.where}: {action.tag}: {said}"


def _only_way(action: Node, entity: str, scenario: Node) -> None:
    others = [*scenario.iter(*ROUTES, "FollowTrajectoryAction", "LateralAction"), *_teleports(scenario)]
    for other in others:
        if other.element is not action.element and entity in actors(other):
            if other.tag == "LateralAction" and _is_first(other):
                continue
            raise action.unsupported(
                f"scenario_runner gets the route as a trajectory, which {other.tag} in line {other.line} ends"
            )


def _teleports(scenario: Node) -> list[Node]:
    return [each for story in scenario.need("Storyboard").children("Story") for each in story.iter("TeleportAction")]


def _is_first(action: Node) -> bool:
    return any(each.tag == "Init" for each in action.element.iterancestors())


def _private_action(places: Sequence[Place]) -> etree._Element:
    """An action that follows a trajectory without times."""
    action = etree.Element("PrivateAction")
    action.append(follow(places, timed=False))
    return action
