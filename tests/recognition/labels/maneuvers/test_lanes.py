"""Recorded manoeuvres as seven parameters, and the scenarios that vary them."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

import runner
import xosc
from recognition import recordings as datasets
from recognition.catalogue.writing import storyboard
from recognition.catalogue.writing.replay import entry
from recognition.catalogue.writing.storyboard import paths
from recognition.labels.classes import Label
from recognition.labels.maneuvers.estimation import distance_model
from recognition.labels.maneuvers.events import Maneuvers
from recognition.labels.maneuvers.maneuver import RecordedManeuver, Span
from recognition.scenes import site_at
from runner.judging.measures.relations import MotionRows, relations
from runner.recording import Recording, Track
from schemas import check
from schemas.common.errors import InvalidFile, Unsupported
from tests.recognition import motorway as m
from xosc.writing import maneuvers

HEADER = maneuvers.FileHeader("a test", "a tester", datetime(2000, 1, 1))
AT = Span(5.0, 6.0, 7.0)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    folder = tmp_path_factory.mktemp("motorway")
    (source,) = datasets.open(m.write_motorway(folder), roads=folder).sources
    return source.load()


def measured(
    recording: Recording, label: Label, ego: str, partner: str | None, span: Span = AT
) -> RecordedManeuver:
    assert recording.network is not None
    return Maneuvers(recording, site_at(Path(recording.network.path))).of(label, ego, partner, span)


def write(
    folder: Path, recording: Recording, found: RecordedManeuver, version: tuple[int, int] = (1, 3)
) -> Path:
    assert recording.network is not None
    vehicles = {
        each.name: each.built
        for each in (entry(track) for track in (found.ego, found.other) if track is not None)
    }
    catalogs = {
        "Vehicle": list(vehicles.values()),
        "Maneuver": storyboard.catalogue_entries(found),
        "Controller": [storyboard.CONTROLLER],
    }
    for kind, entries in catalogs.items():
        path = folder / kind / "catalog.xosc"
        path.parent.mkdir(exist_ok=True)
        xosc.write(maneuvers.catalog(path, HEADER, f"{kind}Catalog", entries), path)
    (folder / "road.xodr").write_bytes(Path(recording.network.path).read_bytes())
    followed = paths(found, recording.network, "route", "Other")
    stage = storyboard.ScenarioFiles(
        folder / "scenario.xosc", "road.xodr", {kind: kind for kind in catalogs}
    )
    document = storyboard.scenario(
        stage, HEADER, found, recording.network, "Other", followed, version
    )
    xosc.write(document, stage.path)
    return stage.path


@pytest.mark.parametrize(
    ("ego", "partner", "left", "gap", "speeds"),
    [
        (m.EGO, m.CUTTER, False, 44.0, (27.0, 30.0)),
        (m.OTHER_EGO, m.OTHER_CUTTER, True, 36.0, (28.0, 28.0)),
    ],
)
def test_a_cut_in_is_measured(
    recording: Recording,
    ego: str,
    partner: str,
    left: bool,
    gap: float,
    speeds: tuple[float, float],
) -> None:
    found = measured(recording, Label.CUT_IN, ego, partner)
    assert (found.kind, found.ego.name, found.other and found.other.name, found.left) == (
        "cut_in",
        ego,
        partner,
        left,
    )
    values = found.values
    begin, duration = 3.2, 5.6  # the half cosine nearest to an even motion sideways from 4 s to 8 s
    own, other = (recording.tracks[name].columns for name in (ego, partner))
    assert values.gap == pytest.approx(gap + (4.0 - begin) * (speeds[1] - speeds[0]), abs=0.1)
    assert np.interp(
        begin, own["time"], np.abs(other["x"] - own["x"])
    ) - values.gap == pytest.approx(4.0, abs=0.05)
    assert (values.start_speed, found.speed) == pytest.approx(speeds, abs=0.1)
    assert values.start_time == pytest.approx(begin, abs=0.1)
    assert values.duration == pytest.approx(duration, abs=0.21)
    assert values.start_time + values.duration + values.rest_time == pytest.approx(11.96)


def test_car_following_is_the_leads_change_of_speed(recording: Recording) -> None:
    found = measured(recording, Label.CAR_FOLLOWING, m.EGO, m.STOPPING, Span(1.0, 2.0, 3.0))
    assert (found.kind, found.left) == ("following", None)
    values, lead = found.values, recording.tracks[m.STOPPING].columns
    fitted = [values.start_speed, values.end_speed, values.final_speed]
    way = np.abs(np.interp([1.0, found.end], lead["time"], lead["x"]) @ [-1.0, 1.0])
    model = distance_model(
        np.array([values.duration + values.rest_time]), values.duration, values.rest_time
    )
    off, off_by_instants = np.abs(model @ np.array([fitted, [20.0, 12.0, 0.0]]).T - way)[0]
    assert fitted == sorted(fitted, reverse=True)
    assert off < 0.5 * off_by_instants


REFUSED = {
    "a class that is none of the 17": (
        Label.UNKNOWN,
        m.EGO,
        None,
        AT,
        "its class, unknown or discovered, is none of the 17",
    ),
    "no junction": (
        Label.LEFT_TURN,
        m.EGO,
        None,
        AT,
        "the roads do not show the way through the junction",
    ),
    "no partner": (Label.CUT_IN, m.EGO, None, AT, "the other vehicle is not known"),
    "no lane change": (
        Label.LANE_CHANGE_LEFT,
        m.EGO,
        None,
        AT,
        "no lane change was recorded completely then",
    ),
    "a partner behind": (Label.CAR_FOLLOWING, m.CUTTER, m.EGO, AT, "is not ahead of the ego"),
    "who never met": (Label.CAR_FOLLOWING, m.FAR, m.EGO, AT, "was not recorded then"),
}


@pytest.mark.parametrize(
    ("label", "ego", "partner", "span", "reason"), REFUSED.values(), ids=REFUSED
)
def test_what_is_no_manoeuvre_is_refused_by_name(
    recording: Recording, label: Label, ego: str, partner: str | None, span: Span, reason: str
) -> None:
    with pytest.raises(Unsupported, match=reason):
        measured(recording, label, ego, partner, span)


CASES = {
    "cut in to the right": (Label.CUT_IN, m.EGO, m.CUTTER),
    "cut in to the left, against s": (Label.CUT_IN, m.OTHER_EGO, m.OTHER_CUTTER),
    "lane change without a lead": (Label.LANE_CHANGE_RIGHT, m.CUTTER, None),
    "lane change behind a lead": (Label.LANE_CHANGE_RIGHT, m.CUTTER, m.STOPPING),
}


@pytest.mark.parametrize(("label", "ego", "partner"), CASES.values(), ids=CASES)
def test_the_manoeuvre_happens_as_its_parameters_say(
    tmp_path: Path, recording: Recording, label: Label, ego: str, partner: str | None
) -> None:
    found = measured(recording, label, ego, partner)
    path = write(tmp_path, recording, found)
    assert [problem for file in tmp_path.rglob("*.xosc") for problem in check(file)] == []
    result = runner.run(path, sut="none", world="kinematic")
    values, tracks = found.values, result.recording.locate().tracks
    assert result.status == "completed"
    assert result.end_time == pytest.approx(
        values.start_time + values.duration + values.rest_time, abs=0.25
    )
    started = next(
        event.time
        for event in result.events
        if event.kind == "startTransition" and event.subject.endswith("::change")
    )
    assert started == pytest.approx(values.start_time, abs=0.06)
    actor = tracks["Ego" if found.ego_acts else "Other"].columns
    lanes = actor["lane_id"][[0, -1]]
    recorded = recording.tracks[ego if found.ego_acts or partner is None else partner].columns[
        "lane_id"
    ][[0, -1]]
    assert lanes.tolist() == recorded.tolist()
    if found.other is not None:
        ego_motion, other = (
            MotionRows.from_columns(name, tracks[name].box, tracks[name].columns)
            for name in ("Ego", "Other")
        )
        rows, _, _, view = relations(ego_motion, [other])
        ahead = dict(zip(ego_motion.time[rows].round(6).tolist(), view.ahead.tolist(), strict=True))
        assert ahead[round(started, 6)] == pytest.approx(values.gap, abs=0.6)


def test_recorded_values_beyond_the_ranges_widen_them(tmp_path: Path, recording: Recording) -> None:
    found = measured(recording, Label.CUT_IN, m.EGO, m.CUTTER)
    slow = replace(found, values=found.values._replace(start_speed=3.0, gap=120.0))
    document = xosc.load(write(tmp_path, recording, slow))
    assert xosc.resolve(document, {"Gap_m": 131, "StartSpeed_mps": 2.8}, enforce_constraints=True)
    with pytest.raises(InvalidFile, match="Gap_m = 133"):
        xosc.resolve(document, {"Gap_m": 133}, enforce_constraints=True)


def test_speeds_vary_by_the_limit_of_the_road(tmp_path: Path, recording: Recording) -> None:
    found = measured(recording, Label.CUT_IN, m.EGO, m.CUTTER)
    assert found.speeds == (10.0, 40.0), "a motorway without a limit"
    town = replace(found, speeds=(4.17, 18.07), values=found.values._replace(start_speed=18.0))
    document = xosc.load(write(tmp_path, recording, town))
    assert xosc.resolve(
        document, {"StartSpeed_mps": 19.8, "EndSpeed_mps": 4.2}, enforce_constraints=True
    )
    with pytest.raises(InvalidFile, match="StartSpeed_mps = 30"):
        xosc.resolve(document, {"StartSpeed_mps": 30}, enforce_constraints=True)


def test_the_scene_ends_before_the_road_does(tmp_path: Path, recording: Recording) -> None:
    """The lead would come to the road's end within the rest time and stop dead there."""
    found = measured(recording, Label.CUT_IN, m.EGO, m.CUTTER)
    long = replace(found, values=found.values._replace(rest_time=60.0))
    result = runner.run(write(tmp_path, recording, long), sut="none", world="kinematic")
    assert result.status == "completed" and result.end_time < long.end - long.start
    assert not [remark for remark in result.remarks if "beyond physics" in remark]
    for track in result.recording.tracks.values():
        assert np.abs(np.diff(track.columns["speed"][1:])).max() < 1.0
    with pytest.raises(Unsupported, match="ends before the manoeuvre does"):
        write(tmp_path, recording, replace(found, values=found.values._replace(duration=60.0)))


def test_an_ego_that_begins_before_its_road_has_no_maneuver(
    tmp_path: Path, recording: Recording
) -> None:
    """The place would be none of the standard's: checks refused the file."""
    found = measured(recording, Label.CUT_IN, m.EGO, m.CUTTER)
    columns = {name: values.copy() for name, values in found.ego.columns.items()}
    columns["s"] -= columns["s"][np.searchsorted(columns["time"], found.start)] + 0.7
    before = Track(
        found.ego.name, found.ego.kind, found.ego.category, found.ego.box, lambda: columns
    )
    with pytest.raises(Unsupported, match="the road begins after the manoeuvre does"):
        write(tmp_path, recording, replace(found, ego=before))


def test_before_1_1_there_are_no_expressions(tmp_path: Path, recording: Recording) -> None:
    with pytest.raises(Unsupported, match=r"plain text in OpenSCENARIO 1\.0"):
        write(tmp_path, recording, measured(recording, Label.CUT_IN, m.EGO, m.CUTTER), (1, 0))


def test_who_would_begin_before_the_road_does_is_refused(
    tmp_path: Path, recording: Recording
) -> None:
    found = measured(recording, Label.CUT_IN, m.EGO, m.CUTTER)
    fast = replace(found, values=found.values._replace(start_speed=60.0))
    with pytest.raises(Unsupported, match="the road is too short"):
        write(tmp_path, recording, fast)


def test_the_scene_begins_after_an_earlier_lane_change(recording: Recording) -> None:
    ego = recording.tracks[m.EGO]
    lanes = ego.columns["lane_id"]
    changed = np.where(ego.columns["time"] < 2.0, lanes + 1, lanes)
    other = Track(
        ego.name, ego.kind, ego.category, ego.box, lambda: ego.columns | {"lane_id": changed}
    )
    altered = Recording(
        [*(track for track in recording.tracks.values() if track is not ego), other],
        0.04,
        recording.network,
    )
    assert measured(altered, Label.CUT_IN, m.EGO, m.CUTTER).start == pytest.approx(2.0)
    assert measured(recording, Label.CUT_IN, m.EGO, m.CUTTER).start == 0.0
