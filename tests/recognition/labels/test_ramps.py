"""Rules 7 and 8, on the builders' ramps: the ramp is road 3, the extra lane
beside the carriageway has the id -3.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recognition.labels import Label, Rules
from recognition.scenes import Site, site_at
from tests.recognition.driving import STEP, labels, of, route, site, track
from xodr.builders import off_ramp, on_ramp


@pytest.fixture(scope="module")
def entering(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return site(on_ramp(), tmp_path_factory.mktemp("on_ramp"))


@pytest.fixture(scope="module")
def leaving(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return site(off_ramp(), tmp_path_factory.mktemp("off_ramp"))


def beside(y: np.ndarray, at: float, shift: float, duration: float = 4.0) -> np.ndarray:
    """The same y, moved smoothly to the left from a time on."""
    share = np.clip((STEP * np.arange(len(y)) - at) / duration + 0.5, 0.0, 1.0)
    return y + shift * share**2 * (3.0 - 2.0 * share)


def test_from_the_acceleration_lane_onto_the_carriageway(entering: Site) -> None:
    x, y = route(entering.network, ("3", -1, 100.0), 25.0, 16.0)
    events = labels(entering, track("ego", x, beside(y, 11.0, 3.75)))
    assert of(events, "ego") == [Label.RAMP_ENTERING]
    assert events[0].time == pytest.approx(11.0, abs=0.2)
    assert events[0].tags["ramp_way"] == pytest.approx(275.0, abs=5.0)


def test_staying_on_the_acceleration_lane_is_no_entering(entering: Site) -> None:
    x, y = route(entering.network, ("3", -1, 100.0), 25.0, 14.0)
    assert of(labels(entering, track("ego", x, y)), "ego") == []


def test_a_view_that_begins_on_the_ramp_shows_entering_in_part(entering: Site) -> None:
    x, y = route(entering.network, ("2", -3, 10.0), 25.0, 7.0)
    ego = track("ego", x, beside(y, 1.9, 3.75, 2.0))
    (event,) = (event for event in labels(entering, ego) if event.label == Label.RAMP_ENTERING)
    assert event.tags == {"ramp_way": pytest.approx(45.0, abs=0.5), "partial": True}
    assert Label.RAMP_ENTERING not in of(
        labels(entering, ego, config=Rules(partial_ramp=50.0)), "ego"
    )
    (whole,) = (
        event
        for event in labels(entering, ego, config=Rules(ramp_length=30.0))
        if event.label == Label.RAMP_ENTERING
    )
    assert whole.tags["partial"] is False


def test_entering_at_the_beginning_of_the_view_has_its_window_where_it_is_whole(
    entering: Site,
) -> None:
    x, y = route(entering.network, ("2", -3, 10.0), 25.0, 7.0)
    (event,) = (
        event
        for event in labels(entering, track("ego", x, beside(y, 0.6, 3.75, 2.0)))
        if event.label is Label.RAMP_ENTERING
    )
    assert event.time == pytest.approx(0.8)
    assert event.tags["partial"] is True


def test_changing_between_main_lanes_is_no_entering(entering: Site) -> None:
    x, y = route(entering.network, ("2", -2, 10.0), 25.0, 10.0)
    assert of(labels(entering, track("ego", x, beside(y, 5.0, 3.75))), "ego") == [
        Label.LANE_CHANGE_LEFT
    ]


def test_whoever_enters_cuts_in_before_those_on_the_carriageway(entering: Site) -> None:
    x, y = route(entering.network, ("3", -1, 100.0), 25.0, 16.0)
    behind_x, behind_y = route(entering.network, ("1", -2, 370.0), 25.0, 16.0)
    events = labels(
        entering, track("ramp", x, beside(y, 11.0, 3.75)), track("main", behind_x, behind_y)
    )
    assert Label.CUT_IN in of(events, "main")
    assert next(event.partner for event in events if event.label is Label.CUT_IN) == "ramp"


def test_from_the_carriageway_onto_the_deceleration_lane(leaving: Site) -> None:
    x, y = route(leaving.network, ("1", -2, 600.0), 25.0, 20.0)
    onto = beside(y, 6.0, -3.75)
    after_x, after_y = route(leaving.network, ("1", -3, 700.0), 25.0, 16.0, ("102",))
    changed = round(7.0 / STEP)
    first = int(np.argmin(np.abs(after_x - x[changed + 30])))
    ego = track(
        "ego",
        np.append(x[: changed + 30], after_x[first:]),
        np.append(onto[: changed + 30], after_y[first:]),
    )
    events = labels(leaving, ego)
    assert of(events, "ego") == [Label.FREE_CRUISE, Label.RAMP_EXITING]
    assert events[1].time == pytest.approx(6.0, abs=0.2)


@pytest.mark.parametrize(("seconds", "seen"), [(6.3, False), (7.5, True)])
def test_a_view_that_ends_on_the_ramp_shows_exiting_in_part(
    leaving: Site, seconds: float, seen: bool
) -> None:
    x, y = route(leaving.network, ("1", -2, 600.0), 25.0, seconds)
    events = labels(leaving, track("ego", x, beside(y, 6.0, -3.75)))
    assert [event.tags["partial"] for event in events if event.label == Label.RAMP_EXITING] == [
        True
    ] * seen


def test_a_ramp_that_becomes_a_lane_is_entered_without_a_change(tmp_path: Path) -> None:
    place = site(on_ramp(), tmp_path)
    roles = (
        tmp_path / "site.roles.json"
    )  # a person says that the extra lane is a through lane from s = 0 on
    roles.write_text(
        roles.read_text().replace('"to": 325.0, "role": "on_ramp"', '"to": 325.0, "role": "main"')
    )
    x, y = route(place.network, ("3", -1, 100.0), 25.0, 14.0)
    events = labels(site_at(place.path), track("ego", x, y))
    assert Label.RAMP_ENTERING in of(events, "ego")
