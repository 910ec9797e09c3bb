"""Trajectories have times where they are followed in time."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.xml import local_name


@rule("asam.net:xosc:1.0.0:routing.trajectory_timing_exists_if_requested")
def check(document: Document) -> Iterator[Finding]:
    """A trajectory that is followed with a timing reference shall have a time at each vertex or control point."""
    for action in document.elements("FollowTrajectoryAction"):
        if action.find("TimeReference/Timing") is None:
            continue
        for point in action.iter("Vertex", "ControlPoint"):
            if point.get("time") is None:
                yield Finding(point, f"the {local_name(point)} has no time, which the action's Timing asks for")
                break
