"""Places on earth after conversions: those of the source, to 1e-7 degrees, in every projection."""

from __future__ import annotations

import math
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pyproj
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from xodr.builders.elements import (
    Geo,
    LaneDesign,
    PlanPose,
    RoadDesign,
    RoadMap,
    SectionDesign,
    arc,
)
from xodr.formats.maps import files as maps
from xodr.formats.maps.lane_map import LaneMap
from xodr.formats.maps.projecting import Projector
from xodr.model.geometry import Cubic

PLACES = np.array([[x, y, 3.0] for x in (-1e3, 0.0, 1e3) for y in (-1e3, 0.0, 1e3)])
ENDINGS = {
    "lanelet2": "map.osm",
    "sumo": "map.net.xml",
    "commonroad": "map.xml",
    "geojson": "map.geojson",
}
ROAD = RoadDesign(
    "1", "", PlanPose(0.0, 0.0, 0.3), (arc(40.0, 0.005),),
    (SectionDesign(0.0, {-1: LaneDesign("driving", (Cubic(0.0, 3.5, 0.0, 0.0, 0.0),))}, "none"),),
    "town", 50 / 3.6,
)  # fmt: skip


@st.composite
def projections(draw: st.DrawFn) -> Geo:
    """A projection with an offset near a place that it is meant for."""
    latitude = draw(st.floats(-75.0, 75.0))
    longitude = draw(st.floats(-179.0, 179.0))
    zone = int((longitude + 180.0) // 6.0) + 1
    south = " +south" if latitude < 0.0 else ""
    scale = draw(st.sampled_from([1.0, 0.9996]))
    projection = draw(
        st.sampled_from(
            [
                f"+proj=utm +zone={zone}{south} +datum=WGS84 +units=m +no_defs",
                f"+proj=utm +zone={zone}{south} +ellps=GRS80 +units=m +no_defs",
                (f"+proj=tmerc +lat_0={latitude:.7f} +lon_0={longitude:.7f} +k={scale} "
                "+x_0=500 +y_0=-70 +datum=WGS84 +units=m"),
                f"+proj=lcc +lat_1={latitude - 1:.3f} +lat_2={latitude + 1.5:.3f} "
                f"+lat_0={latitude:.3f} +lon_0={longitude:.3f}"
                " +ellps=GRS80 +units=m",
                f"EPSG:{(32701 if south else 32601) + zone - 1}",
                "EPSG:3857",
            ]
        )
    )  # fmt: skip
    easting, northing = pyproj.Transformer.from_crs("EPSG:4326", projection,
        always_xy=True).transform(
        longitude, latitude
    )  # fmt: skip
    heading = draw(st.sampled_from([0.0, 0.0, 1.1, -3.0]))
    return Geo(
        projection, (float(easting), float(northing)), draw(st.floats(-50.0, 900.0)), heading
    )


def away(one: LaneMap, other: LaneMap) -> float:
    """Largest difference of longitudes and latitudes (degrees) of places of equal coordinates."""
    here, there = (Projector.of(made) for made in (one, other))
    assert here is not None and there is not None
    ours, theirs = here.to_geodetic(PLACES), there.to_geodetic(PLACES)
    return max(
        max(abs(math.remainder(d, 360.0)) for d in ours[0] - theirs[0]),
        float(np.abs(ours[1] - theirs[1]).max()),
    )


@pytest.mark.parametrize("target", ENDINGS)
@settings(max_examples=4, deadline=None, derandomize=True)
@given(geo=projections())
def test_places_on_earth_are_those_of_the_source(target: str, geo: Geo) -> None:
    with TemporaryDirectory() as folder:
        source = RoadMap("geo", (ROAD,), geo=geo).write(Path(folder) / "geo.xodr")
        there = maps.convert(source, Path(folder) / ENDINGS[target])
        if target == "sumo" and geo.heading:
            assert there.result.projection is None
            assert any("SUMO can't turn coordinates" in note for note in there.notes)
            return
        back = maps.convert(there.path, Path(folder) / "back.xodr")
        assert away(there.source, there.result) < 1e-7
        assert away(there.source, back.result) < 1e-7
        kept = there.source.offset[2] == there.result.offset[2]
        assert kept or any("height of the offset" in note for note in there.notes)
