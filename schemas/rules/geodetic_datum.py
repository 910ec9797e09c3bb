"""Geographic positions need a geographic reference."""

from collections.abc import Iterator

from schemas.checks.document import Document
from schemas.checks.registry import Finding, rule


@rule("asam.net:xosc:1.1.0:positioning.geodetic_datum_defined", kinds=("scenario",), since=(1, 1))
def check(document: Document) -> Iterator[Finding]:
    """A GeoPosition needs a road network with a geoReference."""
    network = document.road_network
    if network is None or network.geo_reference:
        return
    for element in document.elements("GeoPosition"):
        yield Finding(element, f"a GeoPosition needs a geoReference, the road network {network.path.name} has none")
