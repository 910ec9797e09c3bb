"""Small inputs with one answer by the standard: shapes of trajectories,
positions along them, orientations.

Each case names the class of the OpenSCENARIO XML reference that it tests.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from tests.conformance.scenes import TELEPORT, lane_position, other, placed_beside, play, start
from tests.conformance.support import at, track
from tests.runner.files import place, story


def world(x: float, y: float, h: float | None = None) -> str:
    heading = f' h="{h}"' if h is not None else ""
    return f'<Position><WorldPosition x="{x}" y="{y}"{heading}/></Position>'


def follow(
    shape: str, *, timed: bool = False, closed: bool = False, offset: float | None = None
) -> str:
    """A FollowTrajectoryAction in mode `position`, with relative times where `timed`."""
    timing = '<Timing domainAbsoluteRelative="relative" offset="0" scale="1"/>'
    skipped = f' initialDistanceOffset="{offset}"' if offset is not None else ""
    return (
        f"<PrivateAction><RoutingAction><FollowTrajectoryAction{skipped}><TrajectoryRef>"
        '<Trajectory name="t" '
        f'closed="{str(closed).lower()}"><Shape>{shape}</Shape></Trajectory></TrajectoryRef>'
        f"<TimeReference>{timing if timed else '<None/>'}</TimeReference>"
        "<TrajectoryFollowingMode "
        'followingMode="position"/></FollowTrajectoryAction></RoutingAction></PrivateAction>'
    )


def driven(folder: Path, action: str, speed: float = 10.0) -> dict[str, np.ndarray]:
    """Ego does an action at 0 s on its way along lane -1 from s = 100 m."""
    init = place("Ego", 100, speed) + place("Lead", 900, 0)
    return track(play(folder, init, story("Ego", [(0.0, action)])), "Ego")


def clothoid(pieces: list[tuple[float, float, float]]) -> tuple[float, float, float]:
    """Pose at the end of pieces (curvatures at both ends and length) from the
    origin along x, by quadrature.
    """
    x = y = h = 0.0
    for first, last, length in pieces:
        s = np.linspace(0.0, length, 20001)
        heading = h + cumulative_trapezoid(first + (last - first) * s / length, s, initial=0.0)
        x += float(np.trapezoid(np.cos(heading), s))
        y += float(np.trapezoid(np.sin(heading), s))
        h = float(heading[-1])
    return x, y, h


def test_a_clothoid_bends_by_its_change_of_curvature(tmp_path: Path) -> None:
    """Clothoid: curvature at the start, curvaturePrime per metre, length."""
    shape = (
        '<Clothoid curvature="0.01" curvaturePrime="0.0004" '
        f'length="60">{world(200, 100, 0)}</Clothoid>'
    )
    ego = driven(tmp_path, follow(shape))
    x, y, h = clothoid([(0.01, 0.01 + 60 * 0.0004, 60.0)])
    assert at(ego, 6.0, "x") == pytest.approx(200 + x, abs=0.02)
    assert at(ego, 6.0, "y") == pytest.approx(100 + y, abs=0.02)
    assert at(ego, 5.95, "h") == pytest.approx(h, abs=0.03)


def test_segments_of_a_clothoid_spline_join(tmp_path: Path) -> None:
    """ClothoidSpline: a segment without PositionStart begins where the one before it ends."""
    shape = (
        '<ClothoidSpline><ClothoidSplineSegment curvatureStart="0" curvatureEnd="0.02" '
        'length="30">'
        f"{world(200, 100, 0).replace('Position>', 'PositionStart>')}</ClothoidSplineSegment>"
        '<ClothoidSplineSegment curvatureStart="0.02" curvatureEnd="-0.02" '
        'length="40"/></ClothoidSpline>'
    )
    ego = driven(tmp_path, follow(shape))
    x, y, _ = clothoid([(0.0, 0.02, 30.0), (0.02, -0.02, 40.0)])
    assert at(ego, 7.0, "x") == pytest.approx(200 + x, abs=0.02)
    assert at(ego, 7.0, "y") == pytest.approx(100 + y, abs=0.02)


def test_a_segment_of_a_clothoid_spline_turns_by_its_heading_offset(tmp_path: Path) -> None:
    """ClothoidSplineSegment: hOffset turns the beginning of the segment against
    the end of the one before.
    """
    shape = (
        f'<ClothoidSpline><ClothoidSplineSegment curvatureStart="0" curvatureEnd="0" length="30">'
        f"{world(200, 100, 0).replace('Position>', 'PositionStart>')}</ClothoidSplineSegment>"
        '<ClothoidSplineSegment curvatureStart="0" curvatureEnd="0" length="40" '
        'hOffset="0.5"/></ClothoidSpline>'
    )
    ego = driven(tmp_path, follow(shape))
    assert at(ego, 7.0, "x") == pytest.approx(230 + 40 * math.cos(0.5), abs=0.02)
    assert at(ego, 7.0, "y") == pytest.approx(100 + 40 * math.sin(0.5), abs=0.02)


def nurbs(points: list[tuple[float, float, float]], knots: list[float], order: int) -> str:
    controls = "".join(
        f'<ControlPoint weight="{weight}">{world(x, y)}</ControlPoint>' for x, y, weight in points
    )
    vector = "".join(f'<Knot value="{value}"/>' for value in knots)
    return f'<Nurbs order="{order}">{controls}{vector}</Nurbs>'


def test_weights_of_a_nurbs_make_a_circle(tmp_path: Path) -> None:
    """Nurbs: order 3 with the weights 1, √½, 1 is a quarter of a circle."""
    points = [(230.0, 100.0, 1.0), (230.0, 130.0, math.sqrt(0.5)), (200.0, 130.0, 1.0)]
    ego = driven(tmp_path, follow(nurbs(points, [0, 0, 0, 1, 1, 1], 3)))
    on = ego["time"] < 30 * math.pi / 2 / 10
    radius = np.hypot(ego["x"][on] - 200.0, ego["y"][on] - 100.0)
    assert radius == pytest.approx(np.full(len(radius), 30.0), abs=0.01)
    assert at(ego, 30 * math.pi / 20, "y") == pytest.approx(130.0, abs=0.05)


def test_a_nurbs_of_order_2_is_a_polyline(tmp_path: Path) -> None:
    """Nurbs: order is the degree plus one."""
    points = [(200.0, 100.0, 1.0), (230.0, 100.0, 1.0), (230.0, 140.0, 1.0)]
    ego = driven(tmp_path, follow(nurbs(points, [0, 0, 1, 2, 2], 2)))
    assert (at(ego, 3.0, "x"), at(ego, 3.0, "y")) == pytest.approx((230.0, 100.0), abs=0.05)
    assert (at(ego, 5.0, "x"), at(ego, 5.0, "y")) == pytest.approx((230.0, 120.0), abs=0.05)


LINE = f"<Polyline><Vertex>{world(200, 100)}</Vertex><Vertex>{world(300, 100)}</Vertex></Polyline>"
SQUARE = (
    "<Polyline>"
    + "".join(
        f"<Vertex>{world(x, y)}</Vertex>"
        for x, y in ((200, 100), (220, 100), (220, 120), (200, 120))
    )
    + "</Polyline>"
)


def test_a_trajectory_may_begin_some_way_along(tmp_path: Path) -> None:
    """FollowTrajectoryAction: initialDistanceOffset."""
    ego = driven(tmp_path, follow(LINE, offset=30))
    assert at(ego, 0.0, "x") == pytest.approx(230.0, abs=1e-6)
    assert at(ego, 2.0, "x") == pytest.approx(250.0, abs=0.01)


def test_a_closed_trajectory_is_gone_round(tmp_path: Path) -> None:
    """Trajectory: closed joins the last vertex to the first."""
    ego = driven(tmp_path, follow(SQUARE, closed=True))
    assert (at(ego, 7.0, "x"), at(ego, 7.0, "y")) == pytest.approx((200.0, 110.0), abs=0.05)
    assert (at(ego, 9.0, "x"), at(ego, 9.0, "y")) == pytest.approx((210.0, 100.0), abs=0.05)


def test_headings_of_vertices_turn_the_entity_and_not_its_way(tmp_path: Path) -> None:
    """Vertex: the orientation of its position is that of the entity there;
    between two it turns from one to the other.
    """
    vertices = "".join(
        f'<Vertex time="{time}">{world(200 + 20 * time, 100, h)}</Vertex>'
        for time, h in ((0, 0.0), (2, 1.0), (4, 1.0))
    )
    ego = driven(tmp_path, follow(f"<Polyline>{vertices}</Polyline>", timed=True))
    for time, h in ((0.5, 0.25), (1.0, 0.5), (3.0, 1.0)):
        assert at(ego, time, "h") == pytest.approx(h, abs=0.02)
        assert at(ego, time, "x") == pytest.approx(200 + 20 * time, abs=0.02)
        assert at(ego, time, "y") == pytest.approx(100.0, abs=1e-6)


def along(s: float, t: float | None = None, orientation: str = "") -> str:
    aside = f' t="{t}"' if t is not None else ""
    return (
        f'<TrajectoryPosition s="{s}"{aside}>{orientation}<TrajectoryRef><Trajectory name="t" '
        'closed="false"><Shape>'
        "<Polyline>"
        f"<Vertex>{world(200, 100)}</Vertex><Vertex>{world(200, 200)}</Vertex></Polyline>"
        "</Shape></Trajectory></TrajectoryRef></TrajectoryPosition>"
    )


ON_A_TRAJECTORY = {
    "s": (along(30), (200, 130, math.pi / 2)),
    "left": (along(30, 2), (198, 130, math.pi / 2)),
    "right": (along(30, -2), (202, 130, math.pi / 2)),
    "turned": (
        along(30, 0, '<Orientation type="relative" h="0.5"/>'),
        (200, 130, math.pi / 2 + 0.5),
    ),
    "absolute": (along(30, 0, '<Orientation type="absolute" h="0.5"/>'), (200, 130, 0.5)),
}


@pytest.mark.parametrize("case", ON_A_TRAJECTORY)
def test_positions_on_a_trajectory(case: str, tmp_path: Path) -> None:
    """TrajectoryPosition: s along it, t to its left, orientation relative to its direction."""
    text, expected = ON_A_TRAJECTORY[case]
    ego, _ = placed_beside(tmp_path, text)
    assert [at(ego, 8.0, name) for name in "xyh"] == pytest.approx(expected, abs=1e-6)


def on_route(inside: str, orientation: str = "") -> str:
    waypoints = "".join(
        "<Waypoint "
        f'routeStrategy="shortest"><Position>{lane_position(*place)}</Position></Waypoint>'
        for place in ((-1, 100), (-1, 600))
    )
    return (
        '<RoutePosition><RouteRef><Route name="r" '
        f'closed="false">{waypoints}</Route></RouteRef>{orientation}'
        f"<InRoutePosition>{inside}</InRoutePosition></RoutePosition>"
    )


ON_A_ROUTE = {
    "lane": (on_route('<FromLaneCoordinates pathS="50" laneId="-2"/>'), (150, -5.25)),
    "lane, offset": (
        on_route('<FromLaneCoordinates pathS="50" laneId="-2" laneOffset="0.5"/>'),
        (150, -4.75),
    ),
    "road": (on_route('<FromRoadCoordinates pathS="50" t="-3"/>'), (150, -3.0)),
    "entity": (on_route('<FromCurrentEntity entityRef="Lead"/>'), (180, -1.75)),
}


@pytest.mark.parametrize("case", ON_A_ROUTE)
def test_positions_on_a_route(case: str, tmp_path: Path) -> None:
    """InRoutePosition: the way from the first waypoint; of an entity where it is."""
    text, expected = ON_A_ROUTE[case]
    ego, lead = placed_beside(tmp_path, text)
    assert at(lead, 8.0, "x") == pytest.approx(180.0)
    assert [at(ego, 8.0, name) for name in "xy"] == pytest.approx(expected, abs=1e-6)


TURNED = {
    # Lead faces -x on lane 1 at x = 420 m, y = 1.75 m
    "object ahead": (
        '<RelativeObjectPosition entityRef="Lead" dx="10" dy="0"/>',
        (410, 1.75, math.pi),
    ),
    "object left": (
        '<RelativeObjectPosition entityRef="Lead" dx="0" dy="3"/>',
        (420, -1.25, math.pi),
    ),
    "object turned": (
        '<RelativeObjectPosition entityRef="Lead" dx="10" dy="0"><Orientation '
        'type="relative" h="0.25"/>'
        "</RelativeObjectPosition>",
        (410, 1.75, math.pi + 0.25),
    ),
    "object absolute": (
        '<RelativeObjectPosition entityRef="Lead" dx="10" dy="0"><Orientation '
        'type="absolute" h="0.25"/>'
        "</RelativeObjectPosition>",
        (410, 1.75, 0.25),
    ),
    "world": ('<RelativeWorldPosition entityRef="Lead" dx="10" dy="3"/>', (430, 4.75, math.pi)),
    "world turned": (
        '<RelativeWorldPosition entityRef="Lead" dx="10" dy="3"><Orientation '
        'type="relative" h="0.25"/>'
        "</RelativeWorldPosition>",
        (430, 4.75, math.pi + 0.25),
    ),
    "road": ('<RelativeRoadPosition entityRef="Lead" ds="10" dt="1"/>', (430, 2.75, None)),
    "lane": ('<RelativeLanePosition entityRef="Lead" dLane="0" ds="10"/>', (430, 1.75, None)),
    "lane, negative": (
        '<RelativeLanePosition entityRef="Lead" dLane="0" ds="-10"/>',
        (410, 1.75, None),
    ),
}


@pytest.mark.parametrize("case", TURNED)
def test_positions_relative_to_an_oncoming_car(case: str, tmp_path: Path) -> None:
    """RelativeObjectPosition counts in the entity's frame, RelativeWorldPosition
    along the world's axes, ds along s.
    """
    text, (x, y, h) = TURNED[case]
    ego, lead = placed_beside(tmp_path, text, lead=lane_position(1, 500))
    assert at(lead, 8.0, "x") == pytest.approx(420.0)
    assert (at(ego, 8.0, "x"), at(ego, 8.0, "y")) == pytest.approx((x, y), abs=1e-6)
    if h is not None:
        apart = at(ego, 8.0, "h") - h
        assert math.remainder(apart, 2 * math.pi) == pytest.approx(0.0, abs=1e-6)


BACK_OVER_THE_JOINT = {
    # Lead has gone from road 1 on to road 2, whose s falls on its way
    "lane": '<RelativeLanePosition entityRef="Lead" dLane="0" ds="60"/>',
    "along the lane": '<RelativeLanePosition entityRef="Lead" dLane="0" dsLane="-60"/>',
    "road": '<RelativeRoadPosition entityRef="Lead" ds="60" dt="0"/>',
}


@pytest.mark.parametrize("case", BACK_OVER_THE_JOINT)
def test_a_way_back_leads_over_the_joint_with_a_road_laid_against(
    case: str, tmp_path: Path
) -> None:
    """RelativeLanePosition, RelativeRoadPosition: offsets lead over the end of a
    road along its links.

    ds counts along s, dsLane as the entity faces.
    """
    ego, lead = placed_beside(
        tmp_path, BACK_OVER_THE_JOINT[case], lead=lane_position(-1, 260), road="opposed"
    )
    assert at(lead, 8.0, "x") == pytest.approx(340.0)
    assert (at(ego, 8.0, "x"), at(ego, 8.0, "y")) == pytest.approx((280.0, -1.75), abs=1e-6)


@pytest.mark.parametrize("more", ["", ' h="0.3"'])
def test_a_world_position_without_heading_faces_along_x(more: str, tmp_path: Path) -> None:
    """WorldPosition: h is 0 where it is absent, whatever the lane there."""
    ego, _ = placed_beside(tmp_path, f'<WorldPosition x="300" y="1.75"{more}/>')
    assert at(ego, 8.0, "h") == pytest.approx(0.3 if more else 0.0, abs=1e-9)


def test_a_teleport_keeps_a_trajectory_of_another_entity_where_it_is(tmp_path: Path) -> None:
    """Trajectory: positions relative to an entity are taken when the action starts."""
    shape = (
        "<Polyline><Vertex><Position>"
        '<RelativeObjectPosition entityRef="Lead" dx="0" '
        'dy="3.5"/></Position></Vertex><Vertex><Position>'
        '<RelativeObjectPosition entityRef="Lead" dx="60" dy="3.5"/></Position></Vertex></Polyline>'
    )
    init = place("Ego", 100, 10) + start("Lead", lane_position(-2, 200), 0)
    moved = other(story("Lead", [(2.0, TELEPORT.format(lane_position(-2, 700)))]))
    ego = track(play(tmp_path, init, story("Ego", [(1.0, follow(shape))]) + moved), "Ego")
    assert (at(ego, 4.0, "x"), at(ego, 4.0, "y")) == pytest.approx((230.0, -1.75), abs=0.02)
