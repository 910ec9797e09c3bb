"""Rules 11 to 13, on a roundabout: lane 1 of an arm leads to the ring; 102
enters it from arm 1, 303 leaves it at arm 3.
"""

from __future__ import annotations

import numpy as np
import pytest

from recognition.labels import Label, Rules
from recognition.labels.scene import alone, events, prepare
from recognition.scenes import Site
from runner.recording import Recording, Track
from tests.recognition.driving import STEP, labels, of, route, site, track
from xodr.builders import roundabout

ROUND = ("102", "201", "301", "401", "101")


@pytest.fixture(scope="module")
def ring(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return site(roundabout(), tmp_path_factory.mktemp("roundabout"))


def car(
    place: Site,
    name: str,
    roads: tuple[str, ...],
    *,
    arm: str = "1",
    s: float = 50.0,
    start: float = 0.0,
) -> Track:
    x, y = route(place.network, (arm, 1, s), 7.0, 30.0, roads)
    return track(name, x, y, start=start)


def test_once_half_round_enters_circulates_and_exits(ring: Site) -> None:
    found = labels(ring, car(ring, "ego", ("102", "201", "303")))
    assert of(found, "ego") == [
        Label.ROUNDABOUT_ENTERING,
        Label.ROUNDABOUT_CIRCULATING,
        Label.ROUNDABOUT_EXITING,
    ]
    times = [event.time for event in found]
    assert times[0] == pytest.approx(
        (50.0 + 22.5) / 7.0, abs=0.5
    )  # rest of the arm and the entry lane
    assert (np.diff(times) > 1.49).all()


@pytest.mark.parametrize(
    ("label", "kept"), [(Label.ROUNDABOUT_ENTERING, False), (Label.LEFT_TURN, True)]
)
def test_merging_wins_over_turns_but_not_over_entering(
    ring: Site, label: Label, kept: bool
) -> None:
    scene = prepare(Recording([car(ring, "ego", ("102", "201", "303"))], STEP, None), ring, Rules())
    row = np.array([60])
    (event,) = events(
        scene, "test", [alone(Label.MERGING, row, arrival_gap=row * 0.1), alone(label, row)]
    )
    assert event.label is (Label.MERGING if kept else label)


def test_round_and_round_circulates_several_times(ring: Site) -> None:
    found = of(labels(ring, car(ring, "ego", ROUND)), "ego")
    assert found[:3] == [
        Label.ROUNDABOUT_ENTERING,
        Label.ROUNDABOUT_CIRCULATING,
        Label.ROUNDABOUT_CIRCULATING,
    ]
    assert Label.ROUNDABOUT_EXITING not in found


def test_an_arm_alone_is_no_roundabout(ring: Site) -> None:
    x, y = route(ring.network, ("1", -1, 10.0), 7.0, 12.0)
    assert labels(ring, track("ego", x, y)) == []


def test_entering_undisturbed_at_speed_yields_to_nobody(ring: Site) -> None:
    assert labels(ring, car(ring, "ego", ("102", "201", "303")))[0].tags["yields"] is False


@pytest.mark.parametrize(("stop", "yields"), [(9.5, True), (6.5, False)])
def test_entering_right_after_a_stop_yields(ring: Site, stop: float, yields: bool) -> None:
    x, y = route(ring.network, ("1", 1, 50.0), 7.0, 30.0, ("102", "201", "303"))
    row = round(stop / STEP)
    x, y = (np.concatenate([line[:row], np.full(30, line[row]), line[row:]]) for line in (x, y))
    event = next(
        event
        for event in labels(ring, track("ego", x, y))
        if event.label is Label.ROUNDABOUT_ENTERING
    )
    assert event.tags["yields"] is yields


@pytest.mark.parametrize(("start", "yields"), [(0.0, True), (9.0, False)])
def test_entering_close_to_somebody_in_the_ring_yields(
    ring: Site, start: float, yields: bool
) -> None:
    ego = car(ring, "ego", ("102", "201", "303"), start=5.0)
    other = car(ring, "other", ("402", "101", "201", "303"), arm="4", s=52.0, start=start)
    event = next(event for event in labels(ring, ego, other) if event.ego == "ego")
    assert event.label is Label.ROUNDABOUT_ENTERING
    assert event.tags["yields"] is yields


def test_entering_when_the_recording_ends_has_its_window_where_it_is_whole(ring: Site) -> None:
    whole = car(ring, "ego", ("102", "201", "303"))
    (entered,) = (
        event for event in labels(ring, whole) if event.label is Label.ROUNDABOUT_ENTERING
    )
    rows = round((entered.time + 0.4) / STEP) + 1
    short = track("ego", whole.columns["x"][:rows], whole.columns["y"][:rows])
    (event,) = labels(ring, short)
    assert event.label is Label.ROUNDABOUT_ENTERING
    assert event.time == pytest.approx(entered.time + 0.4 - 0.75, abs=0.11)


def test_a_track_that_begins_in_the_ring_only_exits(ring: Site) -> None:
    x, y = route(ring.network, ("1", 1, 50.0), 7.0, 30.0, ("102", "201", "303"))
    late = round(12.0 / STEP)
    found = of(labels(ring, track("ego", x[late:], y[late:])), "ego")
    assert found[-1] == Label.ROUNDABOUT_EXITING
    assert Label.ROUNDABOUT_ENTERING not in found
