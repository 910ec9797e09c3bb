"""Roads that positions name exist."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.messages import unresolved
from schemas.checks.registry import Finding, rule


@rule("xosc.toolchain:xosc:1.0.0:reference_control.road_exists_in_road_network", kinds=("scenario",))
def check(document: Document) -> Iterator[Finding]:
    """A roadId must be the id of a road in the road network."""
    network = document.road_network
    return unresolved(document, "road", network.roads, "roadId", where=f" in {network.path.name}") if network else iter(())
