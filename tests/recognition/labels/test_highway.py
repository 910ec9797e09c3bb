"""Rules 1 to 6, on a straight motorway with lanes at y = -1.875 (left), -5.625 and -9.375 m."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recognition.labels import Label, Rules
from recognition.labels.scene import prepare
from recognition.scenes import Site
from recognition.scenes.lanes import NOWHERE
from runner.recording import Recording
from tests.recognition.driving import STEP, ahead, labels, of, sideways, site, track
from xodr.builders import straight_highway

LEFT, MIDDLE, RIGHT = -1.875, -5.625, -9.375
SECONDS = 8.0


@pytest.fixture(scope="module")
def motorway(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return site(straight_highway(), tmp_path_factory.mktemp("motorway"))


def swaying(x: float, speed: float, change: float, seconds: float) -> np.ndarray:
    """x of a vehicle whose speed changes steadily by `change` m/s in each second."""
    time = STEP * np.arange(round(seconds / STEP) + 1)
    return x + speed * time + 0.5 * change * time**2


def test_an_undisturbed_vehicle_cruises_freely(motorway: Site) -> None:
    (event,) = labels(motorway, track("ego", ahead(100, 30, SECONDS), MIDDLE))
    assert (event.label, event.ego, event.partner) == (Label.FREE_CRUISE, "ego", None)
    assert event.time == pytest.approx(
        2.8, abs=0.11
    )  # the window and its margin fit in from here on
    assert event.tags["speed"] == pytest.approx(30.0)


def test_cruising_needs_the_margin_too(motorway: Site) -> None:
    assert labels(motorway, track("ego", ahead(100, 30, 5.3), MIDDLE)) == []


@pytest.mark.parametrize("change", [0.35, -0.35])
def test_who_accelerates_or_brakes_does_not_cruise(motorway: Site, change: float) -> None:
    assert labels(motorway, track("ego", swaying(100, 30, change, SECONDS), MIDDLE)) == []


def test_slowly_wandering_speeds_are_no_cruise(motorway: Site) -> None:
    gentle = swaying(
        100, 30, 0.29, SECONDS
    )  # |a| < 0.3, but 0.46 m/s of standard deviation in 5.5 s
    assert of(labels(motorway, track("ego", gentle, MIDDLE)), "ego") == [Label.FREE_CRUISE]
    assert (
        labels(motorway, track("ego", gentle, MIDDLE), config=Rules(cruise_speed_deviation=0.4))
        == []
    )


@pytest.mark.parametrize("speed", [0.0, 4.0])
def test_who_stands_or_creeps_behind_another_does_not_cruise(motorway: Site, speed: float) -> None:
    jam = [
        track(name, ahead(x, speed, SECONDS), MIDDLE)
        for name, x in (("ego", 100.0), ("lead", 120.0))
    ]
    assert Label.FREE_CRUISE not in {event.label for event in labels(motorway, *jam)}


@pytest.mark.parametrize(
    ("gap", "expected"), [(119.0, Label.CAR_FOLLOWING), (121.0, Label.FREE_CRUISE)]
)
def test_a_headway_of_four_seconds_parts_following_from_cruising(
    motorway: Site, gap: float, expected: Label
) -> None:
    lead = track("lead", ahead(100 + gap + 4.5, 30, SECONDS), MIDDLE)
    events = labels(motorway, track("ego", ahead(100, 30, SECONDS), MIDDLE), lead)
    assert of(events, "ego") == [expected]
    assert of(events, "lead") == [Label.FREE_CRUISE]


def test_following_tells_lead_gap_and_headway(motorway: Site) -> None:
    lead = track("lead", ahead(160, 30, SECONDS), MIDDLE)
    event = labels(motorway, track("ego", ahead(100, 30, SECONDS), MIDDLE), lead)[0]
    assert (event.label, event.partner) == (Label.CAR_FOLLOWING, "lead")
    assert event.tags == {
        "gap": pytest.approx(55.5),
        "thw": pytest.approx(1.85),
        "ttc_below_4s": False,
    }


def test_closing_in_fast_while_following_is_a_tag(motorway: Site) -> None:
    lead = track("lead", ahead(190, 18, SECONDS), MIDDLE)
    events = labels(
        motorway,
        track("ego", ahead(100, 30, SECONDS), MIDDLE),
        lead,
        config=Rules(following_ttc=5.0),
    )
    assert [event.tags["ttc_below_4s"] for event in events if event.ego == "ego"] == [True]


def test_somebody_in_the_next_lane_is_no_lead(motorway: Site) -> None:
    beside = track("beside", ahead(140, 30, SECONDS), LEFT)
    assert of(labels(motorway, track("ego", ahead(100, 30, SECONDS), MIDDLE), beside), "ego") == [
        Label.FREE_CRUISE
    ]


def test_each_lead_is_followed_apart(motorway: Site) -> None:
    first = track("first", ahead(140, 30, 4.0), MIDDLE)
    second = track("second", ahead(270, 30, 3.9), MIDDLE, start=4.1)
    events = labels(motorway, track("ego", ahead(100, 30, SECONDS), MIDDLE), first, second)
    following = [(event.label, event.partner) for event in events if event.ego == "ego"]
    assert following == [(Label.CAR_FOLLOWING, "first"), (Label.CAR_FOLLOWING, "second")]


@pytest.mark.parametrize(("seconds", "times"), [(9.0, [4.5]), (18.0, [5.2, 12.8])])
def test_following_is_one_event_in_its_middle_or_several_far_apart(
    motorway: Site, seconds: float, times: list[float]
) -> None:
    lead, ego = (track(n, ahead(x, 30, seconds), MIDDLE) for n, x in (("lead", 140), ("ego", 100)))
    found = [event.time for event in labels(motorway, ego, lead) if event.ego == "ego"]
    assert found == pytest.approx(times, abs=0.15)


def test_a_short_time_behind_each_of_two_leads_is_no_following(motorway: Site) -> None:
    first = track("first", ahead(140, 30, 2.5), MIDDLE)
    second = track("second", ahead(215, 30, 2.5), MIDDLE, start=2.6)
    ego = track("ego", ahead(100, 30, 5.0), MIDDLE)
    assert of(labels(motorway, ego, first, second), "ego") == []


def test_a_lead_seen_for_single_frames_ends_no_following(motorway: Site) -> None:
    lead = track("lead", ahead(140, 30, SECONDS), MIDDLE)
    ghost = track("ghost", ahead(245, 30, 0.1), MIDDLE, start=4.0)
    ego = track("ego", ahead(100, 30, SECONDS), MIDDLE)
    events = labels(motorway, ego, lead, ghost)
    assert [(event.label, event.partner) for event in events if event.ego == "ego"] == [
        (Label.CAR_FOLLOWING, "lead")
    ]


@pytest.mark.parametrize(("mean", "found"), [(3.0, [Label.CAR_FOLLOWING]), (1.5, []), (0.3, [])])
def test_following_in_a_queue_has_the_headway_of_the_means(
    motorway: Site, mean: float, found: list[Label]
) -> None:
    # Speeds swing by half within 3 s; 8 m ahead are 2.7 s at 3 m/s, and 5.3 s at the slowest.
    time = STEP * np.arange(round(SECONDS / STEP) + 1)
    way = mean * (time - 0.5 * 3.0 / (2.0 * np.pi) * np.sin(2.0 * np.pi * time / 3.0))
    lead, ego = track("lead", 112.5 + way, MIDDLE), track("ego", 100.0 + way, MIDDLE)
    assert of(labels(motorway, ego, lead), "ego") == found


def test_long_steady_drives_give_a_bounded_number_of_windows(motorway: Site) -> None:
    ego = track("ego", ahead(0, 20, 60.0), MIDDLE)
    times = [event.time for event in labels(motorway, ego)]
    assert len(times) == Rules().most_windows
    assert np.diff(times) == pytest.approx(Rules().spacing)


# 5, 6 -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("end", "expected"), [(LEFT, Label.LANE_CHANGE_LEFT), (RIGHT, Label.LANE_CHANGE_RIGHT)]
)
def test_a_change_of_lane_is_labelled_when_it_crosses_the_border(
    motorway: Site, end: float, expected: Label
) -> None:
    events = labels(
        motorway, track("ego", ahead(100, 30, SECONDS), sideways(MIDDLE, end, 4.0, SECONDS))
    )
    assert of(events, "ego") == [expected]
    assert events[0].time == pytest.approx(4.0, abs=0.11)
    assert events[0].tags["shift"] == pytest.approx(3.75, abs=0.05)


def test_a_change_against_the_reference_line_has_the_sides_of_its_traffic(tmp_path: Path) -> None:
    place = site(straight_highway(opposite_lanes=2), tmp_path)
    x, y = ahead(900, -30, SECONDS), sideways(3.5 + 1.875, 3.5 + 5.625, 4.0, SECONDS)
    assert of(labels(place, track("ego", x, y)), "ego") == [
        Label.LANE_CHANGE_RIGHT
    ]  # it drives towards -x, away from the median


def test_left_hand_traffic_changes_to_the_same_sides(tmp_path: Path) -> None:
    place = site(straight_highway(rule="LHT"), tmp_path)
    x, y = ahead(100, 30, SECONDS), sideways(5.625, 9.375, 4.0, SECONDS)
    assert of(labels(place, track("ego", x, y)), "ego") == [Label.LANE_CHANGE_LEFT]


def test_a_lane_has_to_be_held_for_a_second_before_and_after(motorway: Site) -> None:
    there_and_back = np.concatenate(
        [sideways(MIDDLE, LEFT, 3.0, 3.4, 2.0), sideways(LEFT, MIDDLE, 0.2, 4.5, 2.0)]
    )
    found = of(labels(motorway, track("ego", ahead(100, 30, SECONDS), there_and_back)), "ego")
    assert Label.LANE_CHANGE_LEFT not in found and Label.LANE_CHANGE_RIGHT not in found


@pytest.mark.parametrize("rest", [0.3, 0.6])
def test_a_track_that_ends_in_the_change_shows_it_in_part(motorway: Site, rest: float) -> None:
    short = track("ego", ahead(100, 30, 4.0 + rest), sideways(MIDDLE, LEFT, 4.0, 4.0 + rest))
    (event,) = (event for event in labels(motorway, short) if event.label == Label.LANE_CHANGE_LEFT)
    assert event.tags["partial"] is True
    assert event.tags["shift"] < 0.8 * 3.75
    assert event.time <= 4.0 + rest - 0.7, "the window is complete"


def test_a_track_that_begins_in_the_change_shows_it_in_part(motorway: Site) -> None:
    late = track("ego", ahead(100, 30, 4.0), sideways(MIDDLE, LEFT, 0.4, 4.0))
    (event,) = (event for event in labels(motorway, late) if event.label == Label.LANE_CHANGE_LEFT)
    assert event.tags["partial"] is True
    assert event.time >= 0.7


def test_a_track_that_ends_before_the_border_tells_none(motorway: Site) -> None:
    short = track("ego", ahead(100, 30, 3.9), sideways(MIDDLE, LEFT, 4.0, 3.9))
    assert of(labels(motorway, short), "ego") == []


def test_a_track_that_ends_while_it_still_drifts_shows_it_in_part(motorway: Site) -> None:
    slow = track("ego", ahead(100, 30, SECONDS), sideways(-4.9, -3.0, 5.5, SECONDS))
    (event,) = (event for event in labels(motorway, slow) if event.label == Label.LANE_CHANGE_LEFT)
    assert event.tags["partial"] is True and event.tags["shift"] == pytest.approx(1.9, abs=0.01)


def test_a_track_that_is_never_whole_in_one_of_its_lanes_tells_none(motorway: Site) -> None:
    # Its box reaches 0.15 m over the border at first, and back over it as much in the end.
    astride = track("ego", ahead(100, 30, SECONDS), sideways(-4.5, -3.0, 5.5, SECONDS))
    assert Label.LANE_CHANGE_LEFT not in of(labels(motorway, astride), "ego")


def test_a_whole_change_is_not_partial(motorway: Site) -> None:
    (event,) = labels(
        motorway, track("ego", ahead(100, 30, SECONDS), sideways(MIDDLE, LEFT, 4.0, SECONDS))
    )
    assert event.tags["partial"] is False


def test_drifting_over_the_border_is_no_change(motorway: Site) -> None:
    drift = track("ego", ahead(100, 30, SECONDS), sideways(-4.5, -3.0, 4.0, SECONDS))
    assert of(labels(motorway, drift), "ego") == []
    wide = Rules(shift=0.3)
    assert of(labels(motorway, drift, config=wide), "ego") == [Label.LANE_CHANGE_LEFT]


def test_the_strict_shift_counts_in_metres(motorway: Site) -> None:
    ego = track("ego", ahead(100, 30, SECONDS), sideways(MIDDLE, LEFT + 0.4, 4.0, SECONDS))
    cautious = track(
        "ego", ahead(100, 30, SECONDS), sideways(MIDDLE + 0.3, LEFT - 0.2, 4.0, SECONDS)
    )
    assert of(labels(motorway, ego, config=Rules(strict_shift=3.5)), "ego") == [
        Label.LANE_CHANGE_LEFT
    ]
    assert of(labels(motorway, cautious, config=Rules(strict_shift=3.5)), "ego") == []


def test_noise_about_the_border_counts_as_one_change(motorway: Site) -> None:
    y = sideways(MIDDLE, LEFT, 4.0, SECONDS, 5.0)
    noisy = y + 0.2 * np.where(np.arange(len(y)) % 2, 1.0, -1.0)
    ego = track("ego", ahead(100, 30, SECONDS), noisy, heading=0.0)
    assert of(labels(motorway, ego), "ego") == [Label.LANE_CHANGE_LEFT]


# 3, 4 -----------------------------------------------------------------------------------------


def cutting_in(x: float, speed: float = 30.0) -> list:
    ego = track("ego", ahead(100, 30, SECONDS), MIDDLE)
    other = track("other", ahead(x, speed, SECONDS), sideways(LEFT, MIDDLE, 4.0, SECONDS))
    return [ego, other]


def test_who_comes_into_the_lane_ahead_cuts_in(motorway: Site) -> None:
    events = labels(motorway, *cutting_in(130))
    event = next(event for event in events if event.ego == "ego")
    assert (event.label, event.partner) == (Label.CUT_IN, "other")
    assert event.time == pytest.approx(4.0, abs=0.11)
    assert event.tags == {"gap": pytest.approx(25.5, abs=0.2), "lateral_gap_below_2m": True}
    assert of(events, "other") == [Label.LANE_CHANGE_RIGHT]


@pytest.mark.parametrize(("x", "expected"), [(184.0, [Label.CUT_IN]), (185.5, []), (60.0, [])])
def test_cutting_in_far_ahead_or_behind_is_none(
    motorway: Site, x: float, expected: list[Label]
) -> None:
    found = [one for one in of(labels(motorway, *cutting_in(x)), "ego") if one == Label.CUT_IN]
    assert found == expected


def test_only_the_first_behind_sees_the_cut_in(motorway: Site) -> None:
    between = track("between", ahead(115, 30, SECONDS), MIDDLE)
    events = labels(motorway, *cutting_in(140), between)
    assert Label.CUT_IN in of(events, "between")
    assert Label.CUT_IN not in of(events, "ego")


def test_an_ego_that_changes_lane_itself_sees_no_cut_in(motorway: Site) -> None:
    ego = track("ego", ahead(100, 30, SECONDS), sideways(RIGHT, MIDDLE, 3.8, SECONDS))
    other = cutting_in(130)[1]
    assert Label.CUT_IN not in of(labels(motorway, ego, other), "ego")


@pytest.mark.parametrize(("end", "found"), [(-3.65, []), (-3.35, [Label.LANE_CHANGE_LEFT])])
def test_a_vehicle_on_the_border_has_not_changed_lane(
    motorway: Site, end: float, found: list[Label]
) -> None:
    # The border is at -3.75 m, and the recording ends a second after the motion to the side.
    ego = track("ego", ahead(100, 30, SECONDS), sideways(MIDDLE, end, 5.0, SECONDS))
    changes = (Label.LANE_CHANGE_LEFT, Label.LANE_CHANGE_RIGHT)
    assert [one for one in of(labels(motorway, ego), "ego") if one in changes] == found


def leaving(x: float = 130.0) -> list:
    time = STEP * np.arange(round(SECONDS / STEP) + 1)
    brakes = -1.5 * 0.5 * np.clip(time - 4.5, 0.0, 1.0) ** 2 - 1.5 * np.clip(time - 5.5, 0.0, None)
    ego = track("ego", ahead(100, 30, SECONDS) + brakes, MIDDLE)
    return [ego, track("lead", ahead(x, 30, SECONDS), sideways(MIDDLE, RIGHT, 4.0, SECONDS))]


def test_a_lead_that_leaves_the_lane_cuts_out(motorway: Site) -> None:
    events = [event for event in labels(motorway, *leaving()) if event.ego == "ego"]
    assert [event.label for event in events] == [Label.CAR_FOLLOWING, Label.CUT_OUT]
    event = events[-1]
    assert event.partner == "lead"
    assert event.tags == {"gap": pytest.approx(25.5, abs=0.2), "ego_brakes": True}


def test_an_ego_that_stays_calm_has_no_braking_tag(motorway: Site) -> None:
    calm = track("ego", ahead(100, 30, SECONDS), MIDDLE)
    events = labels(motorway, calm, leaving()[1])
    event = next(event for event in events if event.label is Label.CUT_OUT)
    assert event.tags["ego_brakes"] is False


def test_who_leaves_the_lane_far_ahead_does_not_cut_out(motorway: Site) -> None:
    assert Label.CUT_OUT not in of(labels(motorway, *leaving(190.0)), "ego")


def test_somebody_further_ahead_who_leaves_is_not_the_lead(motorway: Site) -> None:
    between = track("between", ahead(115, 30, SECONDS), MIDDLE)
    assert Label.CUT_OUT not in of(labels(motorway, *leaving(), between), "ego")


def test_rows_beside_the_road_or_beyond_its_end_are_no_place(motorway: Site) -> None:
    far, off = track("far", ahead(9_000, 30, 6), MIDDLE), track("off", ahead(0, 30, 6), -40.0)
    assert labels(motorway, far) == labels(motorway, off) == []
    scene = prepare(Recording([far, off], STEP, None), motorway, Rules())
    assert (scene.strip == NOWHERE).all()


@pytest.mark.parametrize(("aside", "lead"), [(1.2, False), (0.0, True)])
def test_a_still_vehicle_is_a_lead_in_the_middle_of_a_lane_and_parked_beside_it(
    motorway: Site, aside: float, lead: bool
) -> None:
    ego = track("ego", ahead(0, 10, 6), MIDDLE)
    jitter = 150.0 + 0.3 * (-1.0) ** np.arange(61)
    still = track("still", jitter, np.full(61, MIDDLE + aside), heading=0.0)
    scene = prepare(Recording([ego, still], STEP, None), motorway, Rules())
    assert scene.egos.tolist() == [True, False]
    assert bool((scene.leads.row[scene.track == 0] >= 0).any()) is lead
