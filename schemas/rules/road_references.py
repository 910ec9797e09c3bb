"""Roads that positions name exist."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import unknown
from schemas.checks.registry import Finding, rule


@rule("xosc.toolchain:xosc:1.0.0:reference_control.road_exists_in_road_network", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """A roadId must be the id of a road in the road network."""
    network = document.road_network
    if network is None:
        return
    for element, attribute, road in document.values("roadId"):
        if road not in network.roads:
            yield Finding(element, f"{attribute}: {unknown('road', road, network.roads)} in {network.path.name}")
