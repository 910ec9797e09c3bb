"""Ways across a junction for pedestrians: cross paths join lanes of two roads
between their ends (OpenDRIVE 1.8).
"""

from __future__ import annotations

import pytest

import xodr
from schemas.common.errors import InvalidFile
from tests.xodr.conftest import Files
from xodr.graph.network import RoadNetwork

CROSS_PATH = (
    '<crossPath id="6" crossingRoad="75" roadAtStart="1" roadAtEnd="2">'
    '<startLaneLink s="{start}" from="2" to="1"/><endLaneLink s="{end}" from="-2" '
    'to="1"/></crossPath>'
)


def lanes(side: str, *lanes: tuple[int, str, float], offset: float = 0.0) -> str:
    """One lane section with lanes (id, type, width) on one side."""
    inner = "".join(
        f'<lane id="{i}" type="{kind}"><width sOffset="0" a="{width}"/></lane>'
        for i, kind, width in lanes
    )
    shift = f'<laneOffset s="0" a="{offset}" b="0" c="0" d="0"/>' if offset else ""
    return (
        f'{shift}<laneSection s="0"><{side}>{inner}</{side}><center><lane id="0" '
        'type="none"/></center></laneSection>'
    )


def roads(
    files: Files, cross_path: str = CROSS_PATH, start: float = 30.0, end: float = 30.0
) -> tuple[str, ...]:
    """Two roads along x, 60 m long and 30 m apart, with the cross path between
    their inner sidewalks at x = 30.

    y = 30   2 ───────────────────────────
    y = 25.5   · · · · · sidewalk · · · ·
                           │ 75, 21 m
    y = 4.5    · · · · · sidewalk · · · ·
    y = 0    1 ───────────────────────────
    """
    junction = f'<junction id="10" name="">{cross_path.format(start=start, end=end)}</junction>'
    sidewalk = (2, "walking", 2.0)
    return (
        files.road(
            "1", length=60.0, junction="10", lanes=lanes("left", (1, "driving", 3.5), sidewalk)
        ),
        files.road(
            "2",
            length=60.0,
            start=(0.0, 30.0, 0.0),
            junction="10",
            lanes=lanes("right", (-1, "driving", 3.5), (-2, "walking", 2.0)),
        ),
        files.road(
            "75",
            length=21.0,
            start=(start, 4.5, 1.5707963267948966),
            junction="10",
            lanes=lanes("left", (1, "walking", 3.0), offset=-1.5),
        ),
        junction,
    )


@pytest.fixture(scope="module")
def crosswalk(files: Files) -> RoadNetwork:
    return files.load(*roads(files))


@pytest.mark.parametrize(("x", "towards"), [(10.0, 50.0), (10.0, 20.0), (50.0, 20.0), (50.0, 55.0)])
def test_a_route_takes_the_cross_path_from_either_side(
    crosswalk: RoadNetwork, x: float, towards: float
) -> None:
    start, goal = crosswalk.lane_point("1", 2, x), crosswalk.lane_point("2", -2, towards)
    path = crosswalk.route([start, goal])
    assert path is not None
    assert [leg.road_id for leg in path.legs] == ["1", "75", "2"]
    assert sum(leg.length for leg in path.legs) == pytest.approx(
        abs(30.0 - x) + 21.0 + abs(towards - 30.0)
    )
    forward = x < 30.0
    on_the_crossing = crosswalk.travel(start, abs(30.0 - x) + 7.0, forward, path.choose).point
    assert crosswalk.pose(on_the_crossing)[:2] == pytest.approx((30.0, 11.5))
    assert crosswalk.travel(
        start, abs(30.0 - x) + 21.0 + abs(towards - 30.0), forward, path.choose
    ).point[:2] == ("2", towards)


def test_the_way_back_is_the_same(crosswalk: RoadNetwork) -> None:
    path = crosswalk.route(
        [crosswalk.lane_point("2", -2, 50.0), crosswalk.lane_point("1", 2, 10.0)]
    )
    assert path is not None
    assert [(leg.road_id, leg.forward) for leg in path.legs] == [
        ("2", False),
        ("75", False),
        ("1", False),
    ]


def test_without_a_route_a_pedestrian_walks_on(crosswalk: RoadNetwork) -> None:
    assert crosswalk.travel(crosswalk.lane_point("1", 2, 10.0), 45.0, True).point[:2] == ("1", 55.0)


def test_the_carriageway_does_not_lead_onto_the_cross_path(crosswalk: RoadNetwork) -> None:
    path = crosswalk.route(
        [crosswalk.lane_point("1", 2, 10.0), crosswalk.lane_point("2", -2, 50.0)]
    )
    assert path is not None
    driven = crosswalk.travel(crosswalk.lane_point("1", 1, 10.0), 45.0, True, path.choose).point
    assert driven[:2] == ("1", 55.0)


def test_a_cross_path_at_the_end_of_a_road_is_a_link(files: Files) -> None:
    network = files.load(*roads(files, start=60.0, end=60.0))
    assert [(link.road_id, link.lane_id) for link in network.links("1", 2, True)] == [("75", 1)]
    assert [(link.road_id, link.lane_id) for link in network.links("75", 1, True)] == [("2", -2)]


TURNED = '<startLaneLink s="{end}" from="-2" to="1"/><endLaneLink s="{start}" from="2" to="1"/>'


def test_lane_links_of_the_wrong_ends_are_exchanged_with_a_remark(files: Files) -> None:
    wrong = (
        f'<crossPath id="6" crossingRoad="75" roadAtStart="2" roadAtEnd="1">{TURNED}</crossPath>'
    )
    network = files.load(*roads(files, wrong))
    (remark,) = network.remarks
    assert remark.message.endswith(
        "ends 20 m beside a lane that it links; its lane links are exchanged, which fits better"
    )
    with pytest.raises(InvalidFile, match="its lane links are exchanged"):
        xodr.load(network.path, strict=True)
    path = network.route([network.lane_point("1", 2, 10.0), network.lane_point("2", -2, 50.0)])
    assert path is not None
    assert [(leg.road_id, leg.forward) for leg in path.legs] == [
        ("1", True),
        ("75", True),
        ("2", True),
    ]


@pytest.mark.parametrize(
    ("found", "instead", "outcome"),
    [
        ('from="-2"', 'from="0"', "ends 4.5 m beside a lane that it links; road users jump there"),
        ('from="-2"', 'from="-5"', "links a lane that does not exist; it leads nowhere there"),
    ],
)
def test_a_cross_path_that_misses_its_lane_is_reported(
    files: Files, found: str, instead: str, outcome: str
) -> None:
    (remark,) = files.load(*roads(files, CROSS_PATH.replace(found, instead))).remarks
    assert remark.message.endswith(outcome)


@pytest.mark.parametrize(
    ("found", "instead", "complaint"),
    [
        ('roadAtEnd="2"', 'roadAtEnd="7"', "roadAtEnd='7' does not exist"),
        ("endLaneLink", "laneLink", "the element endLaneLink is missing"),
    ],
)
def test_a_cross_path_to_nowhere_is_named(
    files: Files, found: str, instead: str, complaint: str
) -> None:
    with pytest.raises(InvalidFile, match=complaint):
        files.load(*roads(files, CROSS_PATH.replace(found, instead)))
