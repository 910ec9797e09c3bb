"""The parameters of a run are those that it was given, and the reconstruction
from them is the run.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recognition.labels.maneuvers.estimation import LaneCoordinates, errors, estimate, segment
from recognition.labels.maneuvers.parameters import (
    ACCELERATION,
    BRAKING,
    CUT_IN,
    CUT_OUT,
    KINDS,
    LANE_CHANGE,
    Unit,
)
from recognition.labels.maneuvers.units import OWN, Exposure, Samples, extract
from schemas.common.errors import InvalidFile
from tests.recognition.labels.maneuvers.runs import recorded
from tests.recognition.motorway import write_motorway

VALUES = (20.0, 27.0, 4.0, 25.0, 4.6, 29.0, 6.0)


def named(motion: LaneCoordinates, kind: str, actor: str) -> Unit:
    """The only unit of a kind and an actor."""
    (found,) = [
        unit
        for unit in segment(motion)
        if unit.kind == kind and motion.scene.names[unit.actor] == actor
    ]
    return found


def agrees(motion: LaneCoordinates, unit: Unit, ego_speed: float) -> None:
    """Whether extracted parameters are those that the run was given, as far as
    0.2 s and a time step tell.
    """
    found = estimate(motion, unit)
    assert found is not None
    np.testing.assert_allclose(np.array(found.values), VALUES, atol=0.25)
    assert found.other_speed == pytest.approx(ego_speed, abs=1e-6)
    lateral, longitudinal = errors(motion, unit, np.array(found.values))
    assert lateral < 0.03
    assert longitudinal < 0.1


def test_a_cut_in_gives_its_parameters_back(tmp_path: Path) -> None:
    motion = recorded(
        "cut_in_highway", "highway_straight", "CutIn", VALUES, tmp_path, Ego_Speed_mps=24.0
    )
    unit = named(motion, CUT_IN, "CutIn")
    assert motion.scene.names[unit.other] == "Ego"
    assert unit.shift == pytest.approx(-3.75, abs=0.01)
    agrees(motion, unit, 24.0)


def test_a_cut_out_gives_its_parameters_back(tmp_path: Path) -> None:
    motion = recorded(
        "cut_out_highway",
        "highway_straight",
        "CutOut",
        VALUES,
        tmp_path,
        Ego_Speed_mps=24.0,
        Slow_Speed_mps=24.0,
    )
    agrees(motion, named(motion, CUT_OUT, "CutOut"), 24.0)


def test_the_egos_lane_change_gives_its_parameters_back(tmp_path: Path) -> None:
    motion = recorded(
        "lane_change_left_highway", "highway_straight", "Ego", VALUES, tmp_path, Lead_Speed_mps=28.0
    )
    unit = named(motion, LANE_CHANGE, "Ego")
    assert unit.shift == pytest.approx(3.75, abs=0.01)
    agrees(motion, unit, 28.0)


def test_braking_gives_its_parameters_back(tmp_path: Path) -> None:
    values = (60.0, 14.0, 4.0, 8.0, 4.0, 8.0, 5.0)
    motion = recorded(
        "congestion_highway", "highway_straight", "Lead", values, tmp_path, Ego_Speed_mps=12.0
    )
    unit = named(motion, BRAKING, "Lead")
    found = estimate(motion, unit)
    assert found is not None
    assert (np.abs(np.array(found.values) - values) < [1.5, 0.3, 0.5, 0.3, 0.9, 0.3, 0.6]).all()
    assert errors(motion, unit, np.array(found.values)).longitudinal < 0.2


def test_a_sudden_leader_has_the_jerk_of_its_run(tmp_path: Path) -> None:
    found = []
    for jerk in (1.0, 3.0):
        values, others = (
            (60.0, 28.0, 4.0, 18.0, 4.0, 18.0, 5.0),
            {"Ego_Speed_mps": 25.0, "Lead_Jerk_mps3": jerk},
        )
        motion = recorded(
            "braking_leader_highway",
            "highway_straight",
            "Lead",
            values,
            tmp_path / str(jerk),
            **others,
        )
        each = estimate(motion, named(motion, BRAKING, "Lead"))
        assert each is not None
        found.append(each.jerk)
    assert found[0] == pytest.approx(1.0, rel=0.05)
    assert 0.6 * 3.0 < found[1] < 3.0, (
        "the acceleration builds up in less time than jerk is measured over"
    )


def test_who_accelerates_after_a_cut_in_does_so_in_a_unit_of_its_own(tmp_path: Path) -> None:
    values = (20.0, 20.0, 3.0, 20.0, 1.0, 30.0, 8.0)
    motion = recorded(
        "cut_in_highway", "highway_straight", "CutIn", values, tmp_path, Ego_Speed_mps=18.0
    )
    unit = named(motion, ACCELERATION, "CutIn")
    assert unit.first >= named(motion, CUT_IN, "CutIn").end


def test_on_a_ramp_and_in_a_curve_ways_are_those_along_the_lane(tmp_path: Path) -> None:
    motion = recorded(
        "merging_highway", "highway_on_ramp", "Merging", VALUES, tmp_path, Ego_Speed_mps=24.0
    )
    agrees(motion, named(motion, CUT_IN, "Merging"), 24.0)
    values = (20.0, 15.0, 4.0, 13.0, 4.6, 16.0, 5.0)
    motion = recorded(
        "cut_in_sharp_curve", "sharp_curve", "CutIn", values, tmp_path, Ego_Speed_mps=12.0
    )
    unit = named(motion, CUT_IN, "CutIn")
    found = estimate(motion, unit)
    assert found is not None
    assert errors(motion, unit, np.array(found.values)).longitudinal < 0.3


def test_a_data_set_becomes_a_table_that_can_be_kept(tmp_path: Path) -> None:
    write_motorway(tmp_path / "recordings")
    samples = extract(tmp_path / "recordings", tmp_path)
    chosen = samples.of_kind(CUT_IN)
    assert list(zip(chosen.actors, chosen.others, strict=True)) == [("2", "1"), ("4", "3")]
    assert set(samples.recordings) == {"recordings/01"}
    samples.write(tmp_path / "samples.parquet")
    again = Samples.read(tmp_path / "samples.parquet")
    assert again.exposure == samples.exposure
    for name in (
        "theta",
        "recordings",
        "kinds",
        "actors",
        "others",
        "times",
        "ego_speeds",
        "errors",
        "jerks",
    ):
        values = getattr(samples, name)
        if values.dtype.kind == "f":
            np.testing.assert_allclose(getattr(again, name), values, atol=0.00501)
        else:
            np.testing.assert_array_equal(getattr(again, name), values)
    inside = samples.within(samples.theta[0], samples.theta[0])
    np.testing.assert_array_equal(inside.theta, samples.theta[:1])


def test_exposure_is_what_all_vehicles_drove(tmp_path: Path) -> None:
    motion = recorded(
        "cut_in_highway", "highway_straight", "CutIn", VALUES, tmp_path, Ego_Speed_mps=24.0
    )
    found = Exposure.of(motion, segment(motion))
    seconds, metres = 0.0, 0.0
    for track in motion.scene.recording.tracks.values():
        time, speed = track.columns["time"], track.columns["speed"]
        seconds += time[-1] - time[0]
        metres += float((np.diff(time) * speed[:-1]).sum())
    assert found.hours == pytest.approx(seconds / 3600.0, abs=1e-4)
    assert found.kilometres == pytest.approx(metres / 1000.0, abs=1e-3)
    assert found.counts[CUT_IN] == 1


def test_joined_tables_have_the_exposure_of_all_recordings_also_of_those_without_a_unit(
    tmp_path: Path,
) -> None:
    write_motorway(tmp_path / "recordings")
    samples = extract(tmp_path / "recordings", tmp_path)
    (known,) = samples.exposure.values()
    quiet = replace(
        samples.where(np.array([], np.int64)), exposure={"quiet": Exposure(2.0, 200.0, {})}
    )
    joined = Samples.joined([samples, quiet])
    total = Exposure.total(joined.of_kind(CUT_IN).exposure.values())
    assert (total.hours, total.kilometres) == (
        pytest.approx(known.hours + 2.0),
        pytest.approx(known.kilometres + 200.0),
    )
    assert total.counts[CUT_IN] == known.counts[CUT_IN] >= len(samples.of_kind(CUT_IN).theta)


def test_a_file_that_is_no_table_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "samples.parquet"
    path.write_bytes(b"nothing")
    with pytest.raises(InvalidFile, match="table of units"):
        Samples.read(path)


def test_own_units_are_shipped() -> None:
    own = Samples.read(OWN)
    assert set(own.kinds) == set(KINDS)
    assert np.isnan(own.jerks).all(), "a table of before jerk was measured"
    sideways = own.of_kind(CUT_IN, CUT_OUT, LANE_CHANGE)
    motorway = sideways.where(np.flatnonzero(np.char.startswith(sideways.recordings, "motorway")))
    assert len(motorway.theta) > 6000
    assert (motorway.errors.mean(axis=0) <= [0.237, 3.362]).all()
