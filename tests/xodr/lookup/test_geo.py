"""Geographic coordinates through the map's projection."""

from __future__ import annotations

import math

import pyproj
import pytest

from schemas.common.errors import InvalidFile, Unsupported
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
    x, y, _ = reference.to_world(Geodetic(0.0, 9.001, 12.0))
    assert math.hypot(x, y) == pytest.approx(111.3, abs=0.1)
    assert math.atan2(y, x) == pytest.approx(-heading), (
        "east in a world that is turned to the left is to the right"
    )


def test_a_place_off_the_meridian_is_where_the_projection_says(files) -> None:
    reference = GeoReference(
        files.load(files.road(), header=UTM + '<offset x="690000" y="5336000" z="0" hdg="0.2"/>')
    )
    x, y, z = reference.to_world(Geodetic(48.15, 11.57, 520.0))
    back = (
        math.cos(0.2) * x - math.sin(0.2) * y + 690_000,
        math.sin(0.2) * x + math.cos(0.2) * y + 5_336_000,
        z,
    )
    projection = pyproj.Proj(proj="utm", zone=32, ellps="WGS84")
    assert back == pytest.approx((*projection(11.57, 48.15), 520.0), abs=1e-6)


def test_without_a_projection_geographic_positions_are_refused(files) -> None:
    with pytest.raises(Unsupported, match="geoReference"):
        GeoReference(files.load(files.road()))


def test_a_projection_that_makes_no_sense_is_refused(files) -> None:
    with pytest.raises(InvalidFile, match="not understood"):
        GeoReference(files.load(files.road(), header="<geoReference>somewhere</geoReference>"))
