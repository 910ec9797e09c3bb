"""Critical moments beside the classes, in recordings with the errors of sensors,
and none in ordinary traffic.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from recognition.catalogue import pipeline
from recognition.catalogue.recordings import CatalogueSettings
from recognition.labels.critical import UNNAMED, critical_moments
from runner.recording import Recording
from schemas.common.array_types import FloatArray
from tests.recognition.driving import ahead, site, track
from tests.recognition.traffic import interaction_rows, write_csv
from xodr.builders import straight_highway

SECONDS, STEP = 14.0, 0.1
TIME = STEP * np.arange(round(SECONDS / STEP) + 1)
RIGHT, LEFT = -5.625, -1.875


def speeds(start: float, *changes: tuple[float, float, float]) -> FloatArray:
    """Speed over time (m/s) with changes: from a time (s), at so many m/s², down
    or up to a speed.
    """
    speed = np.full(len(TIME), start)
    for begin, rate, until in changes:
        after = speed + rate * np.clip(TIME - begin, 0.0, None)
        speed = np.maximum(after, until) if rate < 0.0 else np.minimum(after, until)
    return speed


def aside(start: float, end: float, begin: float, duration: float) -> FloatArray:
    share = np.clip((TIME - begin) / duration, 0.0, 1.0)
    return start + (end - start) * share**2 * (3.0 - 2.0 * share)


def car(x: float, speed: FloatArray | float, y: FloatArray | float) -> tuple[FloatArray, ...]:
    """x, y (m) over time of a car along the road."""
    driven = np.broadcast_to(speed, TIME.shape)
    way = np.concatenate([[0.0], np.cumsum(0.5 * STEP * (driven[1:] + driven[:-1]))])
    return x + way, np.broadcast_to(y, TIME.shape).copy()


@pytest.fixture(scope="module")
def road(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return site(straight_highway(length=900.0, lanes=2), tmp_path_factory.mktemp("road")).path


def rows(
    road: Path, folder: Path, cars: dict[str, tuple[FloatArray, ...]], noise: float
) -> list[dict]:
    """Rows of the catalogue of a recording of these cars, places with a noise (m)."""
    generator = np.random.default_rng(7)
    written = []
    for number, (x, y) in enumerate(cars.values(), 1):
        vx, vy = np.gradient(x, STEP), np.gradient(y, STEP)
        heading = np.where(np.hypot(vx, vy) > 0.5, np.arctan2(vy, vx), 0.0)
        x, y = (values + noise * generator.standard_normal(len(TIME)) for values in (x, y))
        vx, vy = (values + noise * generator.standard_normal(len(TIME)) for values in (vx, vy))
        told = interaction_rows(number, 0.0, 0.0, 0.0, 0.0, 0.0, n=len(TIME))
        for index, row in enumerate(told):
            row |= {"x": x[index], "y": y[index], "vx": vx[index], "vy": vy[index]}
            row["psi_rad"] = heading[index] + 0.1 * noise * generator.standard_normal()
        written += told
    write_csv(folder / "recorded" / "vehicle_tracks_000.csv", written)
    pipeline.build([folder / "recorded"], folder / "out", CatalogueSettings(road=road))
    return json.loads((folder / "out" / "index.json").read_text())["scenarios"]


NOISES = pytest.mark.parametrize("noise", [0.0, 0.1])


@NOISES
def test_a_cut_in_after_which_the_ego_brakes_to_a_stop_is_critical(
    road: Path, tmp_path: Path, noise: float
) -> None:
    """Of the class, not of the free cruise of the one that cuts in."""
    found = rows(
        road,
        tmp_path,
        {
            "ego": car(100.0, speeds(20.0, (5.0, -7.0, 0.0)), RIGHT),
            "cutter": car(142.0, speeds(14.0, (4.0, -3.0, 0.0)), aside(LEFT, RIGHT, 2.0, 2.5)),
        },
        noise,
    )
    (cut_in,) = [row for row in found if row["class"] == "highway cut in"]
    assert (cut_in["vehicle"], cut_in["partner"], cut_in["others"]) == ("1", "2", "2")
    assert cut_in["severity"] > 0.3 and "braking" in cut_in["critical"]
    assert UNNAMED not in {row["class"] for row in found}
    assert not [row for row in found if row["class"].endswith("cruise") and row["severity"]]


@NOISES
def test_a_lead_that_brakes_hard_is_critical_for_the_follower(
    road: Path, tmp_path: Path, noise: float
) -> None:
    found = rows(
        road,
        tmp_path,
        {
            "ego": car(100.0, speeds(25.0, (6.2, -7.5, 4.0)), RIGHT),
            "lead": car(130.0, speeds(25.0, (5.0, -6.0, 5.0)), RIGHT),
        },
        noise,
    )
    worst = max((row for row in found if row["severity"]), key=lambda row: row["severity"])
    assert worst["vehicle"] == "1" and "braking" in worst["critical"], found
    assert {row["vehicle"] for row in found if row["severity"]} == {"1", "2"}


@NOISES
def test_a_standing_vehicle_that_is_passed_at_the_last_moment_is_unnamed_or_a_lane_change(
    road: Path, tmp_path: Path, noise: float
) -> None:
    found = rows(
        road,
        tmp_path,
        {
            "ego": car(100.0, 20.0, aside(RIGHT, LEFT, 6.0, 1.6)),
            "parked": car(262.0, speeds(2.0, (0.5, -2.0, 0.0)), RIGHT),
        },
        noise,
    )
    critical = [row for row in found if row["severity"]]
    assert [row["vehicle"] for row in critical] == ["1"] and "steering" in critical[0]["critical"]
    if not noise:
        assert critical[0]["others"] == "2" and "drac" in critical[0]["critical"]


def test_a_contact_is_the_gravest_and_its_scene_is_written_and_tagged(
    road: Path, tmp_path: Path
) -> None:
    found = rows(
        road,
        tmp_path,
        {
            "ego": car(100.0, speeds(15.0, (6.5, -8.0, 3.0)), RIGHT),
            "other": car(180.0, speeds(6.0, (3.0, -6.0, 0.0)), RIGHT),
        },
        0.0,
    )
    critical = [row for row in found if row["severity"] == 1.0]
    assert critical and all("contact" in row["critical"] for row in critical), found
    row = critical[0]
    assert row["trust"] in ("measures", "rules alone")
    tags = json.loads((tmp_path / "out" / row["openlabel"]).read_text())
    assert '"Severity"' in json.dumps(tags)


@NOISES
def test_ordinary_traffic_is_not_critical(road: Path, tmp_path: Path, noise: float) -> None:
    """Following at a second, a queue that stops and closes up, overtaking, a lane change ahead."""
    found = rows(
        road,
        tmp_path,
        {
            "follower": car(60.0, 24.0, RIGHT),
            "lead": car(60.0 + 4.0 + 24.0, 24.0, RIGHT),
            "overtaker": car(20.0, 31.0, LEFT),
            "changes": car(160.0, 26.0, aside(RIGHT, LEFT, 7.0, 4.0)),
            "stops": car(500.0, speeds(12.0, (3.0, -2.0, 0.0)), RIGHT),
            "queues": car(482.0, speeds(12.0, (3.9, -2.0, 0.0)), RIGHT),
        },
        noise,
    )
    assert [(row["vehicle"], row["critical"]) for row in found if row["severity"]] == []


def test_severities_are_shares_and_every_unnamed_moment_says_its_measures(
    road: Path, tmp_path: Path
) -> None:
    swerve = RIGHT + 1.2 * np.sin(2 * math.pi * np.clip((TIME - 5.0) / 1.8, 0.0, 1.0))
    found = rows(road, tmp_path, {"ego": car(100.0, 22.0, swerve)}, 0.0)
    (row,) = [row for row in found if row["class"] == UNNAMED]
    assert 0.0 <= row["severity"] <= 1.0 and row["critical"].startswith("steering")
    assert (row["state"], row["trust"], row["partner"]) == ("unknown", "measures", None)


@pytest.mark.parametrize(("aside", "measures"), [(1.75, set()), (0.5, {"ttc", "contact"})])
def test_what_nothing_could_avert_and_did_not_happen_was_of_another_course(
    aside: float, measures: set[str], tmp_path: Path
) -> None:
    """Boxes of recorded sizes overlap by 5 cm as a vehicle passes a standing
    one; those of one ahead collide.
    """
    place = site(straight_highway(length=300.0, lanes=2), tmp_path)
    ego = track("ego", ahead(50.0, 8.0, 6.0), RIGHT)
    standing = track("standing", np.full(61, 80.0), RIGHT + aside, heading=0.0)
    found = critical_moments(Recording([ego, standing], STEP, None), place)
    assert measures <= {name for moment in found for name in moment.values}
    assert bool(found) == bool(measures)


def test_measures_of_vehicles_that_overlap_from_the_beginning_are_none(tmp_path: Path) -> None:
    """Sizes or places are wrong there; the ego passes the other one at 5 m/s."""
    place = site(straight_highway(length=300.0, lanes=2), tmp_path)
    ego = track("ego", ahead(50.0, 5.0, 6.0), RIGHT)
    other = track("other", ahead(52.0, 1.0, 6.0), RIGHT + 0.5)
    assert critical_moments(Recording([ego, other], STEP, None), place) == []


@pytest.mark.parametrize(("braking", "left", "critical"), [(2.5, 8.0, False), (4.5, 1.0, True)])
def test_measures_are_of_the_bodies_not_of_their_extents_along_the_heading(
    braking: float, left: float, critical: bool, tmp_path: Path
) -> None:
    """A bus stands obliquely in a driveway, its nose 20 cm in the way of the ego, its rear off the
    road and 8.5 m nearer: the ego stops before the nose."""
    place = site(straight_highway(length=300.0, lanes=2), tmp_path)
    length, width, turn = 12.0, 2.5, np.radians(45.0)
    nose = np.array([length, 0.5 * width]) - np.array([0.3 * length, 0.0])
    corner = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ nose
    x, y = np.array([150.0, RIGHT - 0.7]) - corner
    bus = track(
        "bus", np.full(len(TIME), x), y, heading=turn, category="bus", length=length, width=width
    )
    bus.columns["road_id"][:] = "driveway"
    speed = np.clip(12.0 - braking * np.clip(TIME - 2.0, 0.0, None), 0.0, None)
    way = np.concatenate([[0.0], np.cumsum(0.5 * STEP * (speed[1:] + speed[:-1]))])
    front = 150.0 - left - 0.7 * 4.5
    ego = track("ego", front - way[-1] + way, RIGHT, heading=0.0)
    found = critical_moments(Recording([ego, bus], STEP, None), place)
    assert bool(found) == critical, found
