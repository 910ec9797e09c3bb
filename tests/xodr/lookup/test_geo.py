"""Geographic coordinates through the map's projection."""

from __future__ import annotations

import pytest

from schemas.errors import InvalidFile, Unsupported
from xodr.lookup.geo import Geodetic, GeoReference

UTM = "<geoReference><![CDATA[+proj=utm +zone=32 +ellps=WGS84 +units=m +no_defs]]></geoReference>"


def test_the_projections_own_meridian_is_where_it_should_be(files) -> None:
    reference = GeoReference(files.load(files.road(), header=UTM))
    x, y, z = reference.to_world(Geodetic(0.0, 9.0, 12.0))
    assert (x, y, z) == pytest.approx((500_000.0, 0.0, 12.0), abs=1e-6)


@pytest.mark.parametrize("heading", [0.0, 0.7])
def test_the_headers_offset_is_taken_off(files, heading: float) -> None:
    offset = f'<offset x="500000" y="0" z="10" hdg="{heading}"/>'
    reference = GeoReference(files.load(files.road(), header=UTM + offset))
    assert reference.to_world(Geodetic(0.0, 9.0, 12.0)) == pytest.approx((0.0, 0.0, 2.0), abs=1e-6)
    east = reference.to_geodetic(100.0, 0.0)
    assert (east.longitude > 9.0, east.latitude > 1e-6) == (True, heading > 0.0)


def test_there_and_back(files) -> None:
    reference = GeoReference(files.load(files.road(), header=UTM + '<offset x="690000" y="5336000" z="0" hdg="0.2"/>'))
    place = Geodetic(48.15, 11.57, 520.0)
    assert reference.to_geodetic(*reference.to_world(place)) == pytest.approx(place, abs=1e-9)


def test_without_a_projection_geographic_positions_are_refused(files) -> None:
    with pytest.raises(Unsupported, match="geoReference"):
        GeoReference(files.load(files.road()))


def test_a_projection_that_makes_no_sense_is_refused(files) -> None:
    with pytest.raises(InvalidFile, match="not understood"):
        GeoReference(files.load(files.road(), header="<geoReference>somewhere</geoReference>"))
