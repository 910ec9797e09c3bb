"""Rules 14 to 17, on a crossing whose arms are 1 (east), 2 (north), 3 (west), 4 (south); connecting
roads go counterclockwise.

Roads inside: 101 to 103 from the east to north, west and south, 104 to 106 from the north to east,
west and south, and so on.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from recognition.labels import Label, LabelledEvent, Rules
from recognition.labels.changes import passages
from recognition.labels.scene import prepare
from recognition.scenes import Site
from runner.recording import Recording, Track
from tests.recognition.driving import STEP, ahead, labels, of, route, site, track
from xodr.builders import four_way_intersection, t_junction
from xodr.formats.lanelet2 import Lanelet, build

WAYS = {"EN": "101", "EW": "102", "ES": "103", "NE": "104", "NW": "105", "NS": "106", "WE": "107",
    "WN": "108", "WS": "109",
        "SE": "110", "SN": "111", "SW": "112"}  # fmt: skip
ARMS = {"E": "1", "N": "2", "W": "3", "S": "4"}
INSIDE = 50.0 / 8.0
"""When a car enters the junction, s."""


@pytest.fixture(scope="module")
def crossing(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return site(four_way_intersection(), tmp_path_factory.mktemp("crossing"))


def car(
    place: Site, way: str, *, start: float = 0.0, name: str | None = None, category: str = "car"
) -> Track:
    """A car that enters the junction 6.25 s after its start, at 8 m/s."""
    x, y = route(place.network, (ARMS[way[0]], 1, 50.0), 8.0, 16.0, (WAYS[way],))
    return track(name or way, x, y, start=start, category=category)


def first(events: list[LabelledEvent], ego: str) -> LabelledEvent:
    return next(event for event in events if event.ego == ego)


@pytest.mark.parametrize(
    ("way", "expected"),
    [
        ("ES", Label.LEFT_TURN),
        ("WN", Label.LEFT_TURN),
        ("SW", Label.LEFT_TURN),
        ("EN", Label.RIGHT_TURN),
        ("NW", Label.RIGHT_TURN),
    ],
)
def test_turns_are_told_by_the_change_of_heading(crossing: Site, way: str, expected: Label) -> None:
    events = labels(crossing, car(crossing, way))
    assert of(events, way) == [expected]
    assert abs(float(events[0].tags["turn"])) == pytest.approx(90.0, abs=8.0)
    assert events[0].time == pytest.approx(INSIDE + 1.0, abs=0.6)


def test_straight_on_is_a_cross_only_where_somebody_crosses(crossing: Site) -> None:
    assert of(labels(crossing, car(crossing, "WE")), "WE") == []
    events = labels(crossing, car(crossing, "WE"), car(crossing, "SN", start=30.0))
    assert of(events, "WE") == of(events, "SN") == [Label.STRAIGHT_CROSS]


def _bent(folder: Path, degrees: float, straight_on: bool) -> Site:
    """A street that bends to the left where a side street from the south crosses it; with another
    way that goes straight on.
    """
    angle = np.radians(degrees)
    ways = {"in": [(-100.0, 0.0), (0.0, 0.0)], "south": [(20.0, -60.0), (20.0, -12.0)]}
    ways |= {"across": [(20.0, -12.0), (20.0, 22.0)], "north": [(20.0, 22.0), (20.0, 70.0)]}
    bend = np.linspace(0.0, angle, 15)
    inside = np.column_stack([40.0 / angle * np.sin(bend), 40.0 / angle * (1.0 - np.cos(bend))])
    end = inside[-1] + 80.0 * np.array([np.cos(angle), np.sin(angle)])
    ways |= {
        "bend": inside,
        "out": [tuple(inside[-1]), tuple(end)],
        "ahead": [(0.0, 0.0), (40.0, 0.0)],
        "far": [(40.0, 0.0), (99.0, 0.0)],
    }
    links = {
        "in": ("bend", "ahead") if straight_on else ("bend",),
        "bend": ("out",),
        "ahead": ("far",),
    }
    links |= {"south": ("across",), "across": ("north",)}
    names = [name for name in ways if straight_on or name not in ("ahead", "far")]
    lanelets = [_lanelet(name, ways[name], links) for name in names]
    return site(build(lanelets, "bent").map, folder)


def _lanelet(name: str, centre: ArrayLike, links: dict[str, tuple[str, ...]]) -> Lanelet:
    """A lanelet 3.5 m wide."""
    points = np.array(centre, float)
    steps = np.gradient(points, axis=0)
    normal = np.column_stack([-steps[:, 1], steps[:, 0]]) / np.hypot(*steps.T)[:, None]
    return Lanelet(
        name, points + 1.75 * normal, points - 1.75 * normal, successors=links.get(name, ())
    )


@pytest.mark.parametrize(
    ("degrees", "straight_on", "expected"),
    [(33.0, False, [Label.STRAIGHT_CROSS]), (33.0, True, []), (60.0, False, [Label.LEFT_TURN])],
)
def test_where_the_road_itself_bends_its_way_goes_straight_on(
    tmp_path: Path, degrees: float, straight_on: bool, expected: list[Label]
) -> None:
    place = _bent(tmp_path, degrees, straight_on)
    bend = np.radians(degrees) * np.clip((STEP * np.arange(120) * 10.0 - 60.0) / 40.0, 0.0, 1.0)
    ego = track("ego", -60.0 + np.cumsum(np.cos(bend)), np.cumsum(np.sin(bend)))
    across = track("across", 20.0, -50.0 + np.arange(110), start=30.0)
    assert of(labels(place, ego, across), "ego") == expected


def test_ways_that_only_part_or_meet_do_not_cross(crossing: Site) -> None:
    events = labels(
        crossing,
        car(crossing, "WE"),
        car(crossing, "WN", start=30.0),
        car(crossing, "SE", start=60.0),
    )
    assert of(events, "WE") == []


def test_a_way_through_two_junctions_does_not_cross_itself(tmp_path: Path) -> None:
    # Between the junctions there is only a metre: the ways through both meet there.
    ends = (-60.0, 0.0, 16.0, 17.0, 33.0, 90.0)
    ways = {f"w{n}": [(a, 0.0), (b, 0.0)] for n, (a, b) in enumerate(itertools.pairwise(ends))}
    links = {f"w{n}": (f"w{n + 1}",) for n in range(4)}
    for name, x in (("p", 8.0), ("q", 25.0)):
        places = (-60.0, -8.0, 8.0, 60.0)
        for n, (a, b) in enumerate(itertools.pairwise(places)):
            ways[f"{name}{n}"] = [(x, a), (x, b)]
        links |= {f"{name}{n}": (f"{name}{n + 1}",) for n in range(2)}
    place = site(build([_lanelet(*way, links) for way in ways.items()], "two").map, tmp_path)
    ego = track("ego", ahead(-50.0, 8.0, 16.0), 0.0)
    assert len(passages(prepare(Recording([ego], STEP, None), place, Rules()))) == 2
    assert of(labels(place, ego), "ego") == []
    across = track("across", 25.0, ahead(-50.0, 8.0, 14.0), start=30.0)
    assert of(labels(place, ego, across), "ego") == [Label.STRAIGHT_CROSS]


def test_a_left_turn_before_oncoming_traffic_is_opposed(crossing: Site) -> None:
    alone = labels(crossing, car(crossing, "ES"))
    opposed = labels(crossing, car(crossing, "ES"), car(crossing, "WE", start=3.0))
    later = labels(crossing, car(crossing, "ES"), car(crossing, "WE", start=8.0))
    assert [first(events, "ES").tags["opposing"] for events in (alone, opposed, later)] == [
        False,
        True,
        False,
    ]


@pytest.mark.parametrize(("after", "conflict"), [(2.0, True), (4.5, False)])
def test_a_cyclist_or_pedestrian_on_the_way_is_a_conflict(
    crossing: Site, after: float, conflict: bool
) -> None:
    turn = car(crossing, "EN")
    row = round(8.0 / STEP)
    x, y = turn.columns["x"][row], turn.columns["y"][row]
    walker = track(
        "P",
        x + np.linspace(-10.0, 10.0, 101),
        y,
        start=8.0 + after - 5.0,
        category="pedestrian",
        length=0.5,
        width=0.5,
    )
    events = labels(crossing, turn, walker)
    assert first(events, "EN").tags["vru_conflict"] is conflict
    assert of(events, "P") == []


def test_cyclists_are_no_egos(crossing: Site) -> None:
    assert labels(crossing, car(crossing, "ES", category="bicycle")) == []


@pytest.mark.parametrize(("later", "expected"), [(2.0, Label.MERGING), (4.5, Label.RIGHT_TURN)])
def test_arriving_in_one_lane_shortly_after_each_other_is_merging(
    crossing: Site, later: float, expected: Label
) -> None:
    events = labels(crossing, car(crossing, "WE"), car(crossing, "SE", start=later))
    assert of(events, "SE") == [expected]
    if expected is Label.MERGING:
        event = first(events, "SE")
        assert (event.partner, of(events, "WE")) == ("WE", [Label.MERGING])
        assert float(event.tags["arrival_gap"]) < 3.0


def test_a_turn_whose_arrival_is_cut_off_by_the_end_of_the_view_stays_a_turn(
    crossing: Site,
) -> None:
    whole = car(crossing, "SE", start=2.0)
    arrived = int(np.argmax(whole.columns["x"] > 11.5))  # the junction ends there
    short = track(
        "SE", whole.columns["x"][: arrived + 6], whole.columns["y"][: arrived + 6], start=2.0
    )
    events = labels(crossing, car(crossing, "WE"), short)
    assert of(events, "SE") == [Label.RIGHT_TURN]
    assert of(events, "WE") == [Label.MERGING]


def test_following_each_other_from_one_road_is_no_merging(crossing: Site) -> None:
    events = labels(
        crossing, car(crossing, "SE", name="a"), car(crossing, "SE", start=2.0, name="b")
    )
    assert {event.label for event in events} == {Label.RIGHT_TURN}


def test_who_is_first_seen_on_the_way_of_another_does_not_merge_with_it(crossing: Site) -> None:
    other, whole = car(crossing, "SE", start=2.0), car(crossing, "WE")
    shown = whole.columns["x"] > 5.0
    late = track(
        "WE",
        whole.columns["x"][shown],
        whole.columns["y"][shown],
        start=float(whole.columns["time"][shown][0]),
    )
    assert of(labels(crossing, other, whole), "SE") == [Label.MERGING]
    assert of(labels(crossing, other, late), "SE") == [Label.RIGHT_TURN]


def test_traffic_lights_rule_the_classes_out_unless_asked_for(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    place = site(four_way_intersection(signals=True), tmp_path_factory.mktemp("lights"))
    ego = car(place, "ES")
    assert labels(place, ego) == []
    assert of(labels(place, ego, config=Rules(signalised=True)), "ES") == [Label.LEFT_TURN]


def test_a_track_that_begins_and_ends_inside_is_a_passage_too(crossing: Site) -> None:
    whole = car(crossing, "ES")
    rows = slice(round((INSIDE + 0.1) / STEP), round((INSIDE + 2.1) / STEP))
    part = track("ES", whole.columns["x"][rows], whole.columns["y"][rows])
    assert of(labels(crossing, part), "ES") == [Label.LEFT_TURN]


def test_passages_know_origin_and_target_from_the_map_where_the_track_does_not_reach_them(
    crossing: Site,
) -> None:
    whole = car(crossing, "ES")
    rows = slice(round((INSIDE + 0.1) / STEP), round((INSIDE + 2.1) / STEP))
    part = track("part", whole.columns["x"][rows], whole.columns["y"][rows])
    found = passages(prepare(Recording([whole, part], STEP, None), crossing, Rules()))
    assert found.origin[0] == found.origin[1] and found.target[0] == found.target[1]
    assert found.arrived.tolist() == [True, False]


@pytest.mark.parametrize(
    ("recorded", "expected"), [(60.0, [Label.LEFT_TURN]), (36.0, [Label.LEFT_TURN]), (24.0, [])]
)
def test_of_a_turn_that_the_record_cuts_a_third_is_enough(
    crossing: Site, recorded: float, expected: list[Label]
) -> None:
    whole = car(crossing, "ES")
    left = np.degrees(1.5 * np.pi - np.unwrap(np.mod(whole.columns["h"], 2.0 * np.pi)))
    rows = slice(int(np.argmax(left < recorded)), None)
    part = track("ES", whole.columns["x"][rows], whole.columns["y"][rows])
    events = labels(
        crossing, part, car(crossing, "WE", start=40.0), car(crossing, "NS", start=60.0)
    )
    assert of(events, "ES") == expected
    assert all(event.time >= 0.7 for event in events)  # the whole window is there


def test_a_turn_across_a_corner_without_a_lane_is_one(tmp_path: Path) -> None:
    # The lanes before and behind the corner are 20 m apart, and no lane links them.
    lanelets = [
        _lanelet("in", [(-80.0, 0.0), (0.0, 0.0)], {}),
        _lanelet("out", [(20.0, -20.0), (20.0, -100.0)], {}),
    ]
    place = site(build(lanelets, "corner").map, tmp_path)
    angle = np.linspace(0.0, np.pi / 2.0, 40)
    x = np.concatenate([np.arange(-40.0, 0.0, 0.8), 20.0 * np.sin(angle), np.full(50, 20.0)])
    y = np.concatenate(
        [np.zeros(50), 20.0 * (np.cos(angle) - 1.0), -20.0 - 0.8 * np.arange(1.0, 51.0)]
    )
    (event,) = labels(place, track("ego", x, y))
    assert (event.label, event.tags["off_road"]) == (Label.RIGHT_TURN, True)
    assert event.tags["turn"] == pytest.approx(-90.0, abs=6.0)


def test_a_cut_corner_counts_from_the_heading_of_its_lane(crossing: Site) -> None:
    # The track begins inside, where its lane has turned by 3 degrees and the vehicle by 40.
    whole = car(crossing, "EN")
    x, y, h = (whole.columns[name] for name in ("x", "y", "h"))
    turned = np.abs(np.unwrap(h) - h[0])
    begin, end = int(np.argmax(turned >= 0.05)), int(np.argmax(turned >= 1.55)) + 10
    heading = np.unwrap(h)[0] + np.sign(np.unwrap(h)[end] - h[0]) * np.radians(40.0)
    reach = 0.4 * np.hypot(x[end] - x[begin], y[end] - y[begin])
    share = np.linspace(0.0, 1.0, 20)[:, None]
    points = np.array(
        [
            (x[begin], y[begin]),
            (x[begin] + reach * np.cos(heading), y[begin] + reach * np.sin(heading)),
            (x[end] - reach * np.cos(h[end]), y[end] - reach * np.sin(h[end])),
            (x[end], y[end]),
        ]
    )
    weights = (1.0 - share) ** (3 - np.arange(4)) * share ** np.arange(4) * (1.0, 3.0, 3.0, 1.0)
    shortcut = weights @ points
    ego = track("ego", *np.concatenate([shortcut, np.column_stack([x, y])[end + 1 :]]).T)
    ways = passages(prepare(Recording([ego], STEP, None), crossing, Rules()))
    # By what the lane bends before it, the turn would be 56 degrees.
    assert np.degrees(ways.turn) == pytest.approx([-72.0], abs=4.0)


def test_a_slow_end_of_a_turn_that_the_record_cuts_is_none(crossing: Site) -> None:
    whole = car(crossing, "ES")
    left = np.degrees(1.5 * np.pi - np.unwrap(np.mod(whole.columns["h"], 2.0 * np.pi)))
    shown = np.arange(float(np.argmax(left < 15.0)), float(np.argmax(left < 15.0)) + 20.0, 0.2)
    x, y = (np.interp(shown, np.arange(len(left)), whole.columns[name]) for name in ("x", "y"))
    assert labels(crossing, track("ES", x, y)) == []


def test_a_turn_may_begin_before_the_junction_and_end_behind_it(crossing: Site) -> None:
    angle = np.linspace(0.0, 0.5 * np.pi, 40)
    x = np.concatenate(
        [np.linspace(60.0, 17.0, 60), 16.5 - 18.25 * np.sin(angle), np.full(40, -1.75)]
    )
    y = np.concatenate(
        [np.full(60, 1.75), -16.5 + 18.25 * np.cos(angle), np.linspace(-17.0, -45.0, 40)]
    )
    wide = track("wide", x, y)  # it turns by less than 60 degrees inside
    assert of(labels(crossing, wide, config=Rules(turn=(75.0, 135.0))), "wide") == [Label.LEFT_TURN]
    assert (
        of(labels(crossing, wide, config=Rules(turn=(75.0, 135.0), turning_time=0.1)), "wide") == []
    )


def test_all_rows_of_a_passage_that_turns_are_in_a_turn(crossing: Site) -> None:
    scene = prepare(
        Recording([car(crossing, "ES"), car(crossing, "WE")], STEP, None), crossing, Rules()
    )
    left, straight = (scene.passages.rows(number) for number in (0, 1))
    assert scene.turning[left].all() and np.count_nonzero(scene.turning) == len(left)
    assert not scene.turning[straight].any()


def test_standing_inside_is_no_passage(crossing: Site) -> None:
    assert labels(crossing, track("ego", np.full(50, 1.0), -1.75, heading=0.0)) == []


def test_a_t_junction_has_the_same_classes(tmp_path_factory: pytest.TempPathFactory) -> None:
    place = site(t_junction(), tmp_path_factory.mktemp("t"))
    x, y = route(place.network, ("4", 1, 50.0), 8.0, 16.0, ("106",))
    across_x, across_y = route(place.network, ("3", 1, 50.0), 8.0, 16.0, ("103",))
    events = labels(place, track("left", x, y), track("straight", across_x, across_y, start=20.0))
    assert of(events, "left") == [Label.LEFT_TURN]
    assert of(events, "straight") == [Label.STRAIGHT_CROSS]
