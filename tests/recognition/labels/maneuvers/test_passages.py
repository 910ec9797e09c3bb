"""Passages of junctions and roundabouts as seven parameters: on a crossing, arms 1 (east), 2
(north), 3 (west), 4 (south).
"""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

import runner
import xosc
from recognition.catalogue.writing import storyboard
from recognition.catalogue.writing.replay import entry
from recognition.catalogue.writing.storyboard import paths
from recognition.labels.classes import Label
from recognition.labels.maneuvers.events import Maneuvers
from recognition.labels.maneuvers.maneuver import RecordedManeuver, Span
from recognition.scenes import Site, place
from recognition.scenes.cut import EGO
from runner.recording import Recording, Track
from schemas import check
from schemas.common.errors import Unsupported
from tests.recognition.driving import STEP, route, site, track
from xodr.builders import four_way_intersection
from xosc.writing import maneuvers

HEADER = maneuvers.FileHeader("a test", "a tester", datetime(2000, 1, 1))
INSIDE = 6.25
"""When a car that begins 50 m before the junction at 8 m/s enters it, s."""
WAYS = {
    "left": ("1", "103"),
    "oncoming": ("3", "107"),
    "from the left": ("4", "111"),
    "behind": ("1", "102"),
}
"""Arm and road inside: the ego comes from the east; the names of the others say
how they come to it.
"""
TURN = Span(6.5, 7.25, 8.0)


@pytest.fixture(scope="module")
def crossing(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return site(four_way_intersection(), tmp_path_factory.mktemp("crossing"))


def car(crossing: Site, way: str, *, start: float = 0.0, speed: float = 8.0) -> Track:
    arm, road = WAYS[way]
    x, y = route(crossing.network, (arm, 1, 50.0), speed, 16.0, (road,))
    return track(way, x, y, start=start)


def recorded(crossing: Site, *tracks: Track) -> Recording:
    recording = Recording(list(tracks), STEP, crossing.network)
    place(recording, crossing.network)
    return recording


def measured(
    crossing: Site, *tracks: Track, label: Label = Label.LEFT_TURN, partner: str | None = None
) -> RecordedManeuver:
    return Maneuvers(recorded(crossing, *tracks), crossing).of(label, tracks[0].name, partner, TURN)


def write(
    folder: Path, crossing: Site, found: RecordedManeuver, version: tuple[int, int] = (1, 3)
) -> Path:
    followed = paths(found, crossing.network, "way", "Other")
    vehicles = {
        each.name: each.built
        for each in (entry(track) for track in (found.ego, found.other) if track is not None)
    }
    catalogs = {
        "Vehicle": list(vehicles.values()),
        "Maneuver": storyboard.catalogue_entries(found),
        "Controller": [storyboard.CONTROLLER],
        "Trajectory": list(followed.trajectories.values()),
    }
    for kind, entries in catalogs.items():
        path = folder / kind / "catalog.xosc"
        path.parent.mkdir()
        xosc.write(maneuvers.catalog(path, HEADER, f"{kind}Catalog", entries, version), path)
    (folder / "road.xodr").write_bytes(crossing.path.read_bytes())
    stage = storyboard.ScenarioFiles(
        folder / "scenario.xosc", "road.xodr", {kind: kind for kind in catalogs}
    )
    xosc.write(
        storyboard.scenario(stage, HEADER, found, crossing.network, "Other", followed, version),
        stage.path,
    )
    return stage.path


def test_a_turn_begins_and_ends_with_the_change_of_heading(crossing: Site) -> None:
    found = measured(crossing, car(crossing, "left"))
    assert (found.kind, found.ego_acts, found.other, found.values.gap) == (
        "passage",
        True,
        None,
        None,
    )
    h = np.unwrap(found.ego.columns["h"])
    begin = found.start + found.values.start_time
    turned = np.abs(
        np.interp([begin, begin + found.values.duration], found.ego.columns["time"], h) - h[0]
    )
    assert turned == pytest.approx([0.0, np.pi / 2], abs=0.25)
    assert INSIDE - 0.1 <= begin <= INSIDE + 1.0


def test_who_stands_in_the_junction_begins_when_setting_off(crossing: Site) -> None:
    whole = car(crossing, "left")
    rows = np.clip(
        np.arange(200) - np.clip(np.arange(200) - 70, 0, 30), 0, len(whole.columns["x"]) - 1
    )[:180]
    waits = track("left", whole.columns["x"][rows], whole.columns["y"][rows], heading=None)
    waits.columns["h"][70:101] = waits.columns["h"][69]
    found = measured(crossing, waits)
    assert found.start + found.values.start_time == pytest.approx(10.0, abs=0.2)
    assert found.values.start_speed < found.values.end_speed


def test_the_gap_is_that_of_the_other_ones_front_to_where_the_ways_meet(crossing: Site) -> None:
    other = car(crossing, "oncoming", start=2.0)
    found = measured(crossing, car(crossing, "left"), other)
    assert found.other is other and found.passage is not None and found.passage.conflict is not None
    conflict = found.passage.conflict
    begin = found.start + found.values.start_time
    x = np.interp(begin, other.columns["time"], other.columns["x"])
    assert found.values.gap == pytest.approx(
        conflict.x - x - other.box.x - other.box.length / 2, abs=0.6
    )
    assert found.speed == pytest.approx(8.0, abs=0.1)


@pytest.mark.parametrize(
    ("way", "start"), [("oncoming", 20.0), ("oncoming", -6.0), ("behind", -2.0)]
)
def test_who_comes_much_later_or_earlier_or_drives_along_is_nobody_to_meet(
    crossing: Site, way: str, start: float
) -> None:
    assert measured(crossing, car(crossing, "left"), car(crossing, way, start=start)).other is None


def test_a_partner_whose_way_does_not_meet_is_refused(crossing: Site) -> None:
    ego, other = car(crossing, "left"), car(crossing, "behind", start=-2.0)
    with pytest.raises(Unsupported, match="ways of the two don't meet"):
        measured(crossing, ego, other, label=Label.MERGING, partner="behind")


@pytest.mark.parametrize("other", [None, "oncoming", "from the left"])
@pytest.mark.parametrize("version", [(1, 1), (1, 3)])
def test_a_passage_happens_as_it_was_recorded(
    tmp_path: Path, crossing: Site, other: str | None, version: tuple[int, int]
) -> None:
    tracks = [car(crossing, "left"), *([car(crossing, other, start=1.5)] if other else [])]
    found = measured(crossing, *tracks)
    assert (found.other is not None) == (other is not None)
    path = write(tmp_path, crossing, found, version)
    assert [problem for file in tmp_path.rglob("*.xosc") for problem in check(file)] == []
    result = runner.run(path, sut="none", world="kinematic")
    assert result.status == "completed"
    for track_, name in zip(tracks, (EGO, "Other"), strict=False):
        driven, was = result.recording.tracks[name].columns, track_.columns
        time = driven["time"][
            (driven["time"] + found.start >= was["time"][0])
            & (driven["time"] + found.start <= was["time"][-1])
        ]
        away = [
            np.interp(time, driven["time"], driven[axis])
            - np.interp(time + found.start, was["time"], was[axis])
            for axis in "xy"
        ]
        assert np.hypot(*away).max() < 1.0


def test_parameters_that_the_ways_are_too_short_for_shorten_the_delay(
    tmp_path: Path, crossing: Site
) -> None:
    path = write(
        tmp_path,
        crossing,
        measured(crossing, car(crossing, "left"), car(crossing, "oncoming", start=2.0)),
    )
    values = {"StartSpeed_mps": "15", "StartTime_s": "10", "Gap_m": "20"}
    result = runner.run(path, sut="none", world="kinematic", parameters=values)
    begun = next(
        event.time
        for event in result.events
        if event.kind == "startTransition" and event.subject.endswith("::change")
    )
    assert begun < 5.0


def test_entering_a_roundabout_is_what_was_recognised(crossing: Site) -> None:
    found = measured(crossing, car(crossing, "left"), label=Label.ROUNDABOUT_ENTERING)
    assert found.start + found.values.start_time == TURN.start
    assert found.values.duration == pytest.approx(1.5)


def test_a_passage_before_the_recording_is_refused(crossing: Site) -> None:
    whole = car(crossing, "left")
    late = track("left", whole.columns["x"][68:], whole.columns["y"][68:], start=6.8)
    with pytest.raises(Unsupported, match="not recorded completely"):
        measured(crossing, late, label=Label.ROUNDABOUT_ENTERING)


def test_an_ego_that_stands_is_refused(crossing: Site) -> None:
    stands = track("left", np.full(160, 5.0), 2.0, heading=0.0)
    with pytest.raises(Unsupported, match="does not move"):
        measured(crossing, stands, label=Label.ROUNDABOUT_CIRCULATING)
