"""Rules 9 and 10, on a street with a bend: two lanes each way, 50 km/h."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recognition.labels import Label, LabelledEvent, Rules
from recognition.labels.rules import cut_outs
from recognition.labels.scene import Scene, prepare
from recognition.scenes import LaneRole, Site
from runner.recording import Recording, Track
from tests.recognition.driving import STEP, ahead, labels, of, sideways, site, track
from xodr.builders import RoadMap, sharp_curve
from xodr.formats.lanelet2 import Lanelet, LaneletNeighbour, build

SECONDS = 10.0


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return site(_street(50.0), tmp_path_factory.mktemp("street"))


def _street(limit: float) -> RoadMap:
    return sharp_curve(
        radius=80.0, angle=1.2, lanes=2, opposite_lanes=2, approach=120.0, speed_limit=limit / 3.6
    )


def car(place: Site, name: str, s: float, speed: float, t: np.ndarray | float) -> Track:
    """A car along the road at a constant speed of s, t metres to the left of the reference line."""
    time = STEP * np.arange(round(SECONDS / STEP) + 1)
    road = place.network.roads["1"]
    poses = [
        road.pose(a, b)
        for a, b in zip(
            (s + speed * time).tolist(), np.broadcast_to(t, len(time)).tolist(), strict=True
        )
    ]
    return track(name, [pose.x for pose in poses], [pose.y for pose in poses])


def lateral(start: float, end: float, at: float = 5.0) -> np.ndarray:
    share = np.clip((STEP * np.arange(round(SECONDS / STEP) + 1) - at) / 3.0 + 0.5, 0.0, 1.0)
    return start + (end - start) * share**2 * (3.0 - 2.0 * share)


def found(
    place: Site, speed: float, *, ahead: float, start: float = -1.75, end: float = -5.25
) -> list[LabelledEvent]:
    """Events with an ego at 12 m/s on the right lane."""
    return labels(
        place,
        car(place, "ego", 60.0, 12.0, -5.25),
        car(place, "other", 60.0 + ahead, speed, lateral(start, end)),
    )


def test_a_slower_car_that_comes_in_close_ahead_cuts_in(street: Site) -> None:
    event = next(event for event in found(street, 8.0, ahead=34.0) if event.ego == "ego")
    assert (event.label, event.partner) == (Label.URBAN_CUT_IN, "other")
    assert 0.0 < float(event.tags["ttc"]) < 3.0
    assert event.tags["gap"] == pytest.approx(
        34.0 - 4.0 * 5.0 - 4.5, abs=1.5
    )  # along the lane, however it bends


@pytest.mark.parametrize(("speed", "ahead"), [(12.0, 20.0), (10.0, 35.0), (14.0, 12.0)])
def test_a_cut_in_is_one_whatever_its_time_to_collision(
    street: Site, speed: float, ahead: float
) -> None:
    event = next(event for event in found(street, speed, ahead=ahead) if event.ego == "ego")
    assert event.label == Label.URBAN_CUT_IN
    assert event.tags["ttc_below_3s"] is False


@pytest.mark.parametrize(
    ("category", "width", "found"), [("car", 1.8, [Label.URBAN_CUT_IN]), ("bicycle", 0.6, [])]
)
def test_a_bicycle_at_the_edge_of_the_lane_is_beside_the_ego(
    street: Site, category: str, width: float, found: list[Label]
) -> None:
    other = car(street, "other", 94.0, 8.0, lateral(-1.75, -3.9))
    narrow = track("other", other.columns["x"], other.columns["y"], category=category, width=width)
    ego = car(street, "ego", 60.0, 12.0, -5.5)
    assert of(labels(street, ego, narrow), "ego") == found


def test_a_lead_that_leaves_the_lane_cuts_out(street: Site) -> None:
    event = next(
        event
        for event in found(street, 12.0, ahead=25.0, start=-5.25, end=-1.75)
        if event.ego == "ego"
    )
    assert (event.label, event.partner, event.tags["ego_brakes"]) == (
        Label.URBAN_CUT_OUT,
        "other",
        False,
    )


def test_nobody_cuts_in_before_who_stands_or_out_of_his_way(street: Site) -> None:
    ego = car(street, "ego", 60.0, 0.0, -5.25)
    for start, end in ((-1.75, -5.25), (-5.25, -1.75)):
        other = car(street, "other", 70.0, 6.0, lateral(start, end))
        assert of(labels(street, ego, other), "other")
        assert of(labels(street, ego, other), "ego") == []


@pytest.mark.parametrize(("later", "expected"), [(1.4, []), (2.6, [Label.URBAN_CUT_OUT])])
def test_who_follows_his_lead_into_the_other_lane_keeps_none(
    street: Site, later: float, expected: list[Label]
) -> None:
    ego = car(street, "ego", 60.0, 12.0, lateral(-5.25, -1.75, at=5.0 + later))
    lead = car(street, "other", 85.0, 12.0, lateral(-5.25, -1.75))
    assert of(labels(street, ego, lead), "ego") == [*expected, Label.LANE_CHANGE_LEFT]


def test_oncoming_traffic_that_changes_lane_does_not_cut_in(street: Site) -> None:
    ego = car(street, "ego", 60.0, 12.0, -5.25)
    oncoming = car(street, "other", 250.0, -12.0, lateral(5.25, 1.75))
    assert of(labels(street, ego, oncoming), "ego") == []


def test_changing_lane_on_a_street_is_a_lane_change(street: Site) -> None:
    assert of(labels(street, car(street, "ego", 60.0, 12.0, lateral(-5.25, -1.75))), "ego") == [
        Label.LANE_CHANGE_LEFT
    ]


def swerving(degrees: float) -> Track:
    """A car on the straight part of the left lane that turns right by so much
    within 2 s, and then leaves it straight on.
    """
    time = STEP * np.arange(round(SECONDS / STEP) + 1)
    heading = -np.radians(degrees) * np.clip((time - 2.0) / 2.0, 0.0, 1.0)
    x, y = (
        10.0 + np.cumsum(8.0 * STEP * np.cos(heading)),
        -1.75 + np.cumsum(8.0 * STEP * np.sin(heading)),
    )
    on_road = y > -6.5
    return track("ego", x[on_road], y[on_road])


@pytest.mark.parametrize(
    ("degrees", "expected"), [(12.0, [Label.LANE_CHANGE_RIGHT]), (24.0, []), (50.0, [])]
)
def test_who_crosses_the_border_in_a_turn_does_not_change_lane(
    street: Site, degrees: float, expected: list[Label]
) -> None:
    assert of(labels(street, swerving(degrees)), "ego") == expected


@pytest.mark.parametrize(("degrees", "expected"), [(15.0, [Label.LANE_CHANGE_RIGHT]), (35.0, [])])
def test_who_is_oblique_to_the_lane_all_the_time_turns_off(
    street: Site, degrees: float, expected: list[Label]
) -> None:
    way = 3.5 / np.sin(np.radians(degrees)) * np.linspace(0.0, 1.0, 30)
    ego = track(
        "ego", 20.0 + way * np.cos(np.radians(degrees)), -1.8 - way * np.sin(np.radians(degrees))
    )
    assert of(labels(street, ego), "ego") == expected


def test_a_change_that_the_record_cuts_is_a_cut_out_outside_of_junctions_only(street: Site) -> None:
    whole = car(street, "lead", 85.0, 12.0, lateral(-5.25, -1.75))
    lead = track("lead", whole.columns["x"][:58], whole.columns["y"][:58])
    recording = Recording([car(street, "ego", 60.0, 12.0, -5.25), lead], STEP, None)
    scene, inside = (prepare(recording, street, Rules()) for _ in range(2))
    inside.__dict__["in_junction"] = np.ones(len(street.lanes.strips), bool)
    assert [len(cut_outs(one).ego) for one in (scene, inside)] == [1, 0]


def turning_off(degrees: float, start: float = 20.0, y: float = -5.25, name: str = "ego") -> Track:
    """A car on the straight part of the right lane that turns right by so much
    within 2.5 s and goes on beside the road.
    """
    time = STEP * np.arange(round(SECONDS / STEP) + 1)
    heading = -np.radians(degrees) * np.clip((time - 3.0) / 2.5, 0.0, 1.0)
    speed = 7.0
    return track(
        name,
        start + np.cumsum(speed * STEP * np.cos(heading)),
        y + np.cumsum(speed * STEP * np.sin(heading)),
    )


@pytest.mark.parametrize(
    ("degrees", "expected"), [(80.0, [Label.RIGHT_TURN]), (50.0, [Label.RIGHT_TURN]), (35.0, [])]
)
def test_a_turn_into_a_driveway_that_the_map_lacks_is_a_turn(
    street: Site, degrees: float, expected: list[Label]
) -> None:
    events = labels(street, turning_off(degrees))
    assert of(events, "ego") == expected
    assert all(
        event.tags["off_road"] and float(event.tags["turn"]) == pytest.approx(-degrees, abs=3.0)
        for event in events
    )


def test_a_turn_from_a_driveway_is_one_too_and_one_beyond_the_end_of_the_map_none(
    street: Site,
) -> None:
    into = turning_off(80.0)
    from_kerb = track(
        "ego", into.columns["x"][::-1], into.columns["y"][::-1]
    )  # in the right lane, but against its traffic
    assert of(labels(street, from_kerb), "ego") == [Label.LEFT_TURN]
    assert of(labels(street, turning_off(80.0, start=-25.0)), "ego") == []


@pytest.mark.parametrize(("rows", "expected"), [(16, []), (None, [Label.RIGHT_TURN])])
def test_a_vehicle_that_stops_beside_its_lane_parks_and_one_that_drives_on_turns(
    street: Site, rows: int | None, expected: list[Label]
) -> None:
    driving = turning_off(80.0)
    x, y = (driving.columns[name] for name in ("x", "y"))
    beside = int(np.argmax(y < -7.0))
    # It stops 6 m behind the border of the lane, and stands.
    stop = len(x) if rows is None else beside + rows // 2
    x, y = (np.append(column[:stop], np.full(30, column[stop - 1])) for column in (x, y))
    ego = track("ego", x, y)
    ego.columns["h"][stop:] = ego.columns["h"][stop - 2]
    assert of(labels(street, ego), "ego") == expected


def test_a_lead_that_turns_off_into_a_driveway_cuts_out(street: Site) -> None:
    ego = car(street, "ego", 2.0, 7.0, -5.25)
    (event,) = (
        event for event in labels(street, ego, turning_off(80.0, name="lead")) if event.ego == "ego"
    )
    assert (event.label, event.partner) == (Label.URBAN_CUT_OUT, "lead")
    assert of(labels(street, ego, turning_off(20.0, name="lead")), "ego") == []


def test_lanes_that_are_wider_than_usual_need_no_more_of_a_shift(
    street: Site, tmp_path: Path
) -> None:
    wide = site(
        sharp_curve(
            radius=80.0, angle=1.2, lanes=2, opposite_lanes=2, approach=120.0, lane_width=5.0
        ),
        tmp_path,
    )
    moved = car(wide, "ego", 60.0, 12.0, lateral(-4.0, -7.1))
    assert of(labels(wide, moved), "ego") == [Label.LANE_CHANGE_RIGHT]
    assert of(labels(wide, moved, config=Rules(width=5.0)), "ego") == []


def test_the_same_on_a_fast_road_is_no_urban_one(tmp_path: Path) -> None:
    fast = site(_street(80.0), tmp_path)
    assert of(found(fast, 8.0, ahead=34.0), "ego") == [Label.CUT_IN]


def test_a_lane_change_beside_a_side_street_counts(tmp_path: Path) -> None:
    angle = np.linspace(0.0, np.pi / 2.0, 20)
    off = [
        np.array([120.0, -13.75]) + radius * np.column_stack([np.sin(angle), np.cos(angle)])
        for radius in (12.0, 8.5)
    ]
    lanelets = [
        Lanelet(
            name, *(np.array([(start, y), (end, y)]) for y in (top, top - 3.5)), successors=after,
            beside_right=LaneletNeighbour(right, True) if right else None,
        )
        for name, start, end, top, right, after in (
            ("a", 0.0, 120.0, 1.75, "b", ("c",)), ("b", 0.0, 120.0, -1.75, "", ("d", "off")),
            ("c", 120.0, 260.0, 1.75, "d", ()), ("d", 120.0, 260.0, -1.75, "", ()),
        )
    ]  # fmt: skip
    place = site(build([*lanelets, Lanelet("off", *off)], "street").map, tmp_path)
    assert LaneRole.INSIDE in {entry.role for entry in place.roles.entries}
    events = labels(
        place, track("ego", ahead(55.0, 14.0, SECONDS), sideways(-3.5, 0.0, 5.0, SECONDS))
    )
    assert of(events, "ego") == [Label.LANE_CHANGE_LEFT]


def _split(folder: Path, aside: float = 3.5) -> Site:
    """A lane that splits after 60 m: one way goes straight on, the other bears to the left; then
    they lie beside each other.
    """
    along = np.linspace(60.0, 100.0, 21)
    share = (along - 60.0) / 40.0
    middle = aside * share**2 * (3.0 - 2.0 * share)
    bearing = [np.stack([along, middle + half], axis=1) for half in (1.75, -1.75)]

    def straight(
        name: str, start: float, end: float, y: float, after: tuple[str, ...] = (), right: str = ""
    ) -> Lanelet:
        bounds = (np.array([(start, y + half), (end, y + half)]) for half in (1.75, -1.75))
        return Lanelet(
            name,
            *bounds,
            successors=after,
            beside_right=LaneletNeighbour(right, True) if right else None,
        )

    lanelets = [
        straight("one", 0.0, 60.0, 0.0, ("on", "off")),
        straight("on", 60.0, 100.0, 0.0, ("right",)),
        Lanelet("off", *bearing, successors=("left",)),
        straight("left", 100.0, 220.0, 3.5, right="right"),
        straight("right", 100.0, 220.0, 0.0),
    ]  # fmt: skip
    return site(build(lanelets, "street").map, folder)


def test_the_way_that_bears_away_where_a_lane_splits_is_a_lane_change(tmp_path: Path) -> None:
    place = _split(tmp_path)
    x = ahead(5.0, 14.0, SECONDS)
    share = np.clip((x - 60.0) / 40.0, 0.0, 1.0)
    bearing = 3.5 * share**2 * (3.0 - 2.0 * share)
    assert of(labels(place, track("ego", x, bearing)), "ego") == [Label.LANE_CHANGE_LEFT]
    assert of(labels(place, track("ego", x, 0.0)), "ego") == []
    assert (
        of(labels(place, track("ego", x, 0.4 * bearing)), "ego") == []
    )  # lanes overlap, and it hardly moves aside


def test_rows_in_a_turn_have_no_lane_change(street: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    ego = car(street, "ego", 60.0, 12.0, lateral(-5.25, -1.75))
    assert of(labels(street, ego), "ego") == [Label.LANE_CHANGE_LEFT]
    monkeypatch.setattr(Scene, "turning", np.ones(len(ego.columns["time"]), bool))
    assert of(labels(street, ego), "ego") == []


def test_a_way_into_another_lane_of_the_same_road_is_not_crossed(tmp_path: Path) -> None:
    angle = np.linspace(0.0, np.pi / 2.0, 20)
    into = [
        np.array([100.0, -13.75]) + radius * np.column_stack([-np.cos(angle), np.sin(angle)])
        for radius in (12.0, 8.5)
    ]
    rows = [
        Lanelet(
            name, *(np.array([(start, y), (end, y)]) for y in (top, top - 3.5)), successors=after,
            beside_right=LaneletNeighbour(right, True) if right else None,
        )
        for name, start, end, top, right, after in (
            ("a", 0.0, 100.0, 1.75, "b", ("c",)), ("b", 0.0, 100.0, -1.75, "", ("d",)),
            ("c", 100.0, 240.0, 1.75, "d", ()), ("d", 100.0, 240.0, -1.75, "", ()),
        )
    ]  # fmt: skip
    place = site(build([*rows, Lanelet("into", *into, successors=("d",))], "street").map, tmp_path)
    assert LaneRole.INSIDE in {entry.role for entry in place.roles.entries}
    time = STEP * np.arange(round(SECONDS / STEP) + 1)
    other = track("other", 88.0 + 6.0 * time, np.minimum(-12.0 + 6.0 * time, 0.5))
    ego = track("ego", ahead(40.0, 14.0, SECONDS), -3.0, start=20.0)
    assert of(labels(place, ego, other), "ego") == []


def test_motor_vehicles_are_on_the_driving_lane_where_one_for_bicycles_overlaps_it(
    tmp_path: Path,
) -> None:
    along = np.linspace(0.0, 200.0, 41)
    lanelets = [
        Lanelet(
            name,
            *(np.stack([along, top - width + tilt * along], axis=1) for width in (0.0, 3.5)),
            type=kind,
        )
        for name, top, tilt, kind in (
            ("lane", 1.75, 0.0, "driving"),
            ("cycling", 1.5, -0.004, "biking"),
        )
    ]
    place = site(build(lanelets, "street").map, tmp_path)
    ego = track(
        "ego", ahead(20.0, 14.0, SECONDS), -0.04 * np.arange(round(SECONDS / STEP) + 1) * STEP
    )  # along the other one
    bicycle = track("bicycle", ahead(30.0, 5.0, SECONDS), -0.5, heading=-0.004, category="bicycle")
    scene = prepare(Recording([ego, bicycle], STEP, None), place, Rules())
    kinds = [place.lanes.strips[number].kind for number in scene.strip.tolist()]
    half = len(kinds) // 2
    assert set(kinds[:half]) == {"driving"} and set(kinds[half:]) == {"biking"}


@pytest.mark.parametrize(("aside", "expected"), [(0.6, [Label.URBAN_CUT_OUT]), (3.5, [])])
def test_a_lane_goes_on_in_one_that_overlaps_it_without_a_link(
    tmp_path: Path, aside: float, expected: list[Label]
) -> None:
    def lane(name: str, start: float, end: float, y: float, right: str = "") -> Lanelet:
        bounds = (np.array([(start, y + side), (end, y + side)]) for side in (1.75, -1.75))
        return Lanelet(name, *bounds, beside_right=LaneletNeighbour(right, True) if right else None)

    lanelets = [
        lane("before", 0.0, 100.0, aside),
        lane("after", 100.0, 260.0, 0.0, "right"),
        lane("right", 100.0, 260.0, -3.5),
    ]
    place = site(build(lanelets, "street").map, tmp_path)
    ego = track("ego", ahead(40.0, 14.0, SECONDS), sideways(aside, 0.0, 4.0, SECONDS))
    lead = track("lead", ahead(75.0, 14.0, SECONDS), sideways(0.0, -3.5, 5.0, SECONDS))
    assert of(labels(place, ego, lead), "ego") == expected
