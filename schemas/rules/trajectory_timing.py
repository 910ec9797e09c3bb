"""Trajectories have times where they are followed in time."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule
from schemas.xml import local_name

UID = "asam.net:xosc:1.0.0:routing.trajectory_timing_exists_if_requested"

_TIMES = {
    "Vertex": ("time",),
    "ControlPoint": ("time",),
    "Clothoid": ("startTime", "stopTime"),
    "ClothoidSpline": ("timeEnd",),
}


@rule(UID)
def check(document: Document) -> Iterator[Finding]:
    """A trajectory that is followed with a timing reference shall have a time at each vertex, control point and clothoid."""
    for action in document.elements("FollowTrajectoryAction"):
        if action.find("TimeReference/Timing") is None:
            continue
        for part in action.iter(*_TIMES):
            missing = [name for name in _TIMES[local_name(part)] if part.get(name) is None]
            if missing:
                yield Finding(part, f"the {local_name(part)} has no {missing[0]}, which the action's Timing asks for")
                break
