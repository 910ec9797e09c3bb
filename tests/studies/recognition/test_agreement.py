"""The agreement report: what bare positions tell, vehicles of overlapping
recordings, tables and plots.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recognition.labels import Label, Rules
from studies.recognition.agreement.geometry import net_turn, own_lane_changes
from studies.recognition.agreement.report import report
from studies.recognition.agreement.survey import Vehicle, survey, unique
from tests.recognition.driving import ahead, route, sideways
from tests.recognition.traffic import interaction_rows, write_csv
from xodr import builders, load

RATE = 10.0


@pytest.mark.parametrize("turn", [1.5, -1.5, 0.0, 3.0])
def test_the_net_turn_is_that_of_the_ends_of_the_way(turn: float) -> None:
    heading = turn * np.clip((np.arange(200) - 50) / 100.0, 0.0, 1.0)
    x, y = np.cumsum(np.cos(heading)), np.cumsum(np.sin(heading))
    assert net_turn(x, y) == pytest.approx(turn, abs=0.05)


def test_who_stands_has_no_turn() -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.1, (2, 100))
    assert net_turn(*noise) is None
    waiting = np.concatenate(
        [noise, noise[:, -1:] + np.stack([ahead(0, 10, 5), sideways(0, 0, 1, 5)])], axis=1
    )
    assert net_turn(*waiting) == pytest.approx(0.0, abs=0.1)


def test_own_lanes_count_by_their_changes() -> None:
    assert own_lane_changes(np.array([2, 2, 3, 3, 2])) == 2


def vehicle(recording: str, speed: np.ndarray, name: str = "1") -> Vehicle:
    return Vehicle(
        recording, name, (4.5, 1.8), speed, (0, 0), (0, 0), (False, False), None, "", None, ()
    )


def test_overlapping_recordings_of_a_vehicle_are_one() -> None:
    speed = 20.0 + np.cumsum(np.random.default_rng(1).normal(0.0, 0.2, 60))
    parts = [
        vehicle("a", speed[:30]),
        vehicle("b", speed[15:45]),
        vehicle("c", speed[30:]),
        vehicle("d", speed[::-1]),
    ]
    assert [[one.recording for one in group] for group in unique(parts)] == [["a", "b", "c"], ["d"]]
    assert (
        len(unique([vehicle("a", np.full(30, 15.0)), vehicle("b", np.full(30, 15.0))])) == 2
    )  # nothing tells that they are one


def test_a_survey_holds_labels_against_the_ways(tmp_path: Path) -> None:
    folder = tmp_path / "crossing"
    network = load(_written(builders.four_way_intersection(), folder / "crossing.xodr"))
    rows = []
    for name, (arm, inside) in enumerate((("1", "103"), ("3", "107"), ("4", "111")), 1):
        x, y = route(network, (arm, 1, 50.0), 8.0, 16.0, (inside,))
        vx, vy = np.gradient(x, 0.1), np.gradient(y, 0.1)
        for k in range(len(x)):
            one = interaction_rows(name, x[k], y[k], vx[k], vy[k], np.arctan2(vy[k], vx[k]), n=1)[0]
            rows.append(one | {"frame_id": k + 1, "timestamp_ms": 100 * (k + 1) + 20_000 * name})
    write_csv(folder / "vehicle_tracks_000.csv", rows)
    (place,) = survey(folder, tmp_path / "roads", Rules())
    assert (place.name, place.recordings, len(place.vehicles), place.failures) == (
        "crossing",
        1,
        3,
        {},
    )
    assert place.vehicles[0].labels == (Label.LEFT_TURN,)
    assert place.vehicles[0].turn == pytest.approx(np.pi / 2, abs=0.05)
    text = report([place], {})
    assert "| crossing | left | 1 | 1 | 0 | 0 | 0 | 0 |" in text
    assert "| crossing | straight | 2 | 0 | 0 | 2 | 0 | 0 |" in text
    assert "no label at the junction" not in text


def test_a_survey_says_why_there_is_no_label(tmp_path: Path) -> None:
    folder = tmp_path / "crossing"
    network = load(_written(builders.four_way_intersection(), folder / "crossing.xodr"))
    x, y = route(network, ("3", 1, 50.0), 8.0, 16.0, ("107",))
    rows = [
        interaction_rows(1, *place, 8.0, 0.0, 0.0, n=1)[0] | {"timestamp_ms": 100 * (k + 1)}
        for k, place in enumerate(zip(x, y, strict=True))
    ]
    turn = [
        interaction_rows(2, -float(k), 4.0, -10.0, 0.0, 3.14, n=1)[0]
        | {"timestamp_ms": 100 * (k + 1)}
        for k in range(60, 90)
    ]
    write_csv(folder / "vehicle_tracks_000.csv", [*rows, *turn])
    (place,) = survey(folder, tmp_path / "roads", Rules())
    assert [one.unlabelled for one in place.vehicles] == [
        "straight, no crossing traffic",
        "no way through a junction",
    ]


def _written(built: builders.RoadMap, path: Path) -> Path:
    path.parent.mkdir(parents=True)
    return built.write(path)


def test_recordings_that_have_no_roads_are_listed(tmp_path: Path) -> None:
    write_csv(
        tmp_path / "ring" / "vehicle_tracks_000.csv", interaction_rows(1, 0.0, 0.0, 5.0, 0.0, 0.0)
    )
    text = report(survey(tmp_path, tmp_path / "roads", Rules()), {})
    assert "| ring/000 |" in text and "has no map" in text
