"""What all rules share: classes, precedence, windows, missing frames, determinism."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import recognition.labels.scene as hits
from recognition.labels import Label, LabelledEvent, Rules, counts, label
from recognition.labels.scene import Hits, alone, prepare
from recognition.scenes import Site
from runner.recording import Recording
from tests.recognition.driving import STEP, ahead, labels, of, route, sideways, site, track
from xodr.builders import on_ramp, roundabout, straight_highway

MIDDLE, LEFT = -5.625, -1.875


@pytest.fixture(scope="module")
def motorway(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return site(straight_highway(), tmp_path_factory.mktemp("motorway"))


def test_the_seventeen_classes_have_the_ids_and_names_of_the_method() -> None:
    assert [int(one) for one in Label] == list(range(18))
    assert len({one.title for one in Label}) == 18
    assert (Label(1).title, Label(17).title) == ("highway free cruise", "unsignalised merging")


def test_counts_name_all_classes() -> None:
    events = [LabelledEvent("a", "1", 0.0, Label.CUT_IN, "2", {})]
    assert counts(events)[Label.CUT_IN] == 1
    assert (len(counts(events)), sum(counts(events).values())) == (17, 1)


def test_a_recording_without_vehicles_has_no_events(motorway: Site) -> None:
    walker = track("P", ahead(0, 1, 5), 0.0, category="pedestrian")
    assert label(Recording([], STEP, None), motorway, "empty") == []
    assert labels(motorway, walker) == []


def test_the_stronger_class_stays_within_a_window(motorway: Site) -> None:
    scene = prepare(
        Recording([track("ego", ahead(0, 30, 10), MIDDLE)], STEP, None), motorway, Rules()
    )
    found = [
        alone(Label.FREE_CRUISE, np.array([30])),
        alone(Label.LANE_CHANGE_LEFT, np.array([44])),
        alone(Label.MERGING, np.array([58])),
    ]
    assert [event.label for event in hits.events(scene, "a", found)] == [
        Label.FREE_CRUISE,
        Label.MERGING,
    ]
    apart = [found[0], Hits(Label.LANE_CHANGE_LEFT, np.array([45]), np.array([-1]), {})]
    assert [event.label for event in hits.events(scene, "a", apart)] == [
        Label.FREE_CRUISE,
        Label.LANE_CHANGE_LEFT,
    ]


def test_every_class_has_its_place_in_the_precedence() -> None:
    assert sorted(hits.PRECEDENCE) == [one for one in Label if one]
    order = hits.PRECEDENCE.index
    assert order(Label.MERGING) < order(Label.LEFT_TURN) < order(Label.URBAN_CUT_IN)
    assert (
        order(Label.LANE_CHANGE_LEFT)
        < order(Label.CUT_IN)
        < order(Label.CUT_OUT)
        < order(Label.CAR_FOLLOWING)
    )


def test_missing_frames_in_the_window_make_a_lane_change_partial(motorway: Site) -> None:
    x, y = ahead(100, 30, 8), sideways(MIDDLE, LEFT, 4, 8)
    assert of(labels(motorway, track("ego", x, y)), "ego") == [Label.LANE_CHANGE_LEFT]
    (partial,) = labels(motorway, track("ego", x, y, missing=range(33, 39)))
    assert (partial.label, partial.tags["partial"]) == (Label.LANE_CHANGE_LEFT, True)
    assert partial.time >= 3.9 + 0.7, "its window is beyond the missing frames"
    assert of(labels(motorway, track("ego", x, y, missing=[10])), "ego") == [Label.LANE_CHANGE_LEFT]


def test_a_track_goes_on_after_a_few_missing_frames(motorway: Site) -> None:
    x, y = ahead(100, 30, 8), sideways(MIDDLE, LEFT, 4, 8)
    whole, short, long = (
        labels(motorway, track("ego", x, y, missing=range(33, end))) for end in (33, 38, 39)
    )
    assert [event.tags["partial"] for event in whole + short] == [False, False]
    assert [event.tags["partial"] for event in long] == [True]


def test_events_come_by_ego_and_time_and_are_the_same_each_time(motorway: Site) -> None:
    tracks = [
        track(name, ahead(x, 30, 20), sideways(MIDDLE, LEFT, at, 20))
        for name, x, at in (("b", 100, 8), ("a", 160, 12), ("c", 220, 5))
    ]
    events = labels(motorway, *tracks)
    assert [(event.ego, event.time) for event in events] == sorted(
        (event.ego, event.time) for event in events
    )
    assert events == labels(motorway, *tracks) == labels(motorway, *tracks[::-1])
    assert len(events) >= 6


def test_labelling_completes_the_road_coordinates(motorway: Site) -> None:
    recording = Recording([track("ego", ahead(100, 30, 4), MIDDLE)], STEP, None)
    label(recording, motorway, "a")
    columns = recording.tracks["ego"].columns
    assert set(columns["road_id"]) == {"1"} and set(columns["lane_id"]) == {-2}
    assert columns["s"] == pytest.approx(columns["x"]) and columns["t"] == pytest.approx(MIDDLE)


# leads ----------------------------------------------------------------------------------------


def test_leads_are_found_on_the_roads_that_follow(tmp_path: Path) -> None:
    place = site(on_ramp(), tmp_path)
    x, y = route(place.network, ("1", -2, 440.0), 25.0, 4.0)
    lead_x, lead_y = route(
        place.network, ("2", -2, 5.0), 25.0, 4.0
    )  # the junction between is 99.96 m long
    scene = prepare(
        Recording([track("ego", x, y), track("lead", lead_x, lead_y)], STEP, None), place, Rules()
    )
    rows = len(x)
    assert scene.leads.row[0] == rows and scene.leads.row[rows] == -1
    assert scene.leads.gap[:rows] == pytest.approx(60.0 + 99.959 + 5.0 - 4.5, abs=0.01)
    assert scene.leads.follower[rows] == 0


def test_a_lead_out_of_sight_is_none(motorway: Site) -> None:
    tracks = [track("ego", ahead(0, 30, 4), MIDDLE), track("lead", ahead(250, 30, 4), MIDDLE)]
    assert (
        prepare(Recording(tracks, STEP, None), motorway, Rules(sight=200.0)).leads.row == -1
    ).all()
    assert (
        prepare(Recording(tracks, STEP, None), motorway, Rules(sight=300.0)).leads.row[:41] != -1
    ).all()


def test_alone_in_a_ring_nobody_is_ones_own_lead(tmp_path: Path) -> None:
    place = site(roundabout(), tmp_path)
    x, y = route(place.network, ("11", -1, 1.0), 7.0, 20.0, ("101", "201", "301", "401"))
    scene = prepare(Recording([track("ego", x, y)], STEP, None), place, Rules())
    assert (scene.leads.row == -1).all()
