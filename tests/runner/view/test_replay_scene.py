"""What pages are made from: everybody where the recording has them, at every sample."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runner
from runner.engine.participants.declaration import BoundingBox
from runner.judging.result import RunResult, Verdict
from runner.recording import COLUMNS, Recording, Track
from runner.view.replay.player import replay_page, scene
from tests.runner.files import scenario
from tests.runner.view.test_replay_packing import unpack

BOX = BoundingBox(1.5, 0.0, 0.75, 5.0, 2.0, 1.5)


def track(name: str, ticks: np.ndarray, dt: float) -> Track:
    """Someone who turns as they go, 5,000 km from the origin."""
    columns: dict[str, Any] = {column: np.zeros(len(ticks)) for column in COLUMNS} | {
        "time": ticks * dt
    }
    columns |= {"x": 5e6 + np.sin(ticks * dt), "y": -3e6 + ticks * dt, "speed": 0.1 * ticks}
    columns |= {
        "h": np.remainder(2.0 * ticks * dt + np.pi, 2 * np.pi) - np.pi,
        "road_id": np.full(len(ticks), "1", object),
    }
    return Track(name, "vehicle", "car", BOX, partial(dict, columns))


def result(tracks: list[Track], dt: float, end: float) -> RunResult:
    settings = {"timestep": dt, "seed": 0}
    verdict, recording = Verdict(), Recording(tracks, dt, None)
    return RunResult(
        Path("r.xosc"), {}, "completed", end, verdict, (), None, "none", settings, [], recording
    )


@pytest.mark.parametrize(("dt", "sample"), [(0.01, 0.05), (0.05, 0.05), (0.1, 0.1), (0.03, 0.06)])
def test_every_sample_is_the_recordings(dt: float, sample: float) -> None:
    made = track("A", np.arange(401), dt)
    (shown,) = scene([result([made], dt, 400 * dt)])["runs"]
    assert shown["sample"] == pytest.approx(sample)
    (part,) = shown["tracks"][0]["parts"]
    assert part["start"] == 0
    stride = round(sample / dt)
    back = {
        name: np.array(unpack(part[name], step, 2))
        for name, step in (("x", 0.01), ("y", 0.01), ("h", 0.002), ("v", 0.01))
    }
    wanted: Mapping[str, np.ndarray] = {name: made.columns[name][::stride] for name in COLUMNS}
    for axis in ("x", "y"):
        assert np.ptp(back[axis] - wanted[axis]) <= 0.0101  # the origin is the same for all
        assert np.abs(back[axis]).max() < 1e3
    assert np.cos(back["h"] - wanted["h"]).min() > 1.0 - 1e-6
    assert np.abs(np.diff(back["h"])).max() < 1.0  # no jump where angles wrap
    assert np.abs(back["v"] - wanted["speed"]).max() <= 0.0051


def test_heights_and_tilts_are_there_where_they_matter() -> None:
    flat, hill = track("A", np.arange(40), 0.05), track("B", np.arange(40), 0.05)
    hill.columns["z"][:], hill.columns["pitch"][:] = 0.1 * np.arange(40), -0.05
    first, second = (
        each["parts"][0] for each in scene([result([flat, hill], 0.05, 2.0)])["runs"][0]["tracks"]
    )
    assert {"z", "pitch", "roll"}.isdisjoint(first)
    assert unpack(second["z"], 0.01, 2) == pytest.approx(hill.columns["z"], abs=0.0051)
    assert unpack(second["pitch"], 0.002, 2) == pytest.approx(np.full(40, -0.05), abs=0.0011)
    assert "roll" not in second


def test_those_who_come_and_go_have_a_part_for_each_time() -> None:
    ticks = np.concatenate([np.arange(10, 20), np.arange(30, 33)])
    (shown,) = scene([result([track("A", ticks, 0.1), track("B", np.arange(0), 0.1)], 0.1, 5.0)])[
        "runs"
    ]
    first, second = shown["tracks"]
    assert [(part["start"], len(unpack(part["x"], 0.01, 2))) for part in first["parts"]] == [
        (10, 10),
        (30, 3),
    ]
    assert second["parts"] == []


def test_two_runs_share_their_road(tmp_path: Path) -> None:
    runs = [runner.run(scenario(tmp_path, stop=0.2), sut=None, world="kinematic") for _ in range(2)]
    found = scene(runs)
    assert len(found["roads"]) == 1
    assert [run["road"] for run in found["runs"]] == [0, 0]


def test_curves_are_the_egos_where_they_are_defined(tmp_path: Path) -> None:
    run = runner.run(scenario(tmp_path, stop=1.0), sut=None, world="kinematic")
    curves = {curve["id"]: curve["parts"] for curve in scene([run])["runs"][0]["curves"]}
    assert run.criticality is not None
    ttc = run.criticality.ttc
    assert ttc.valid.all()
    (part,) = curves["ttc"]
    assert np.allclose(unpack(part["values"], 0.01, 1), ttc.value, atol=0.0051)
    assert curves["speed"][0]["start"] == 0


def test_a_minute_of_twenty_noisy_participants_is_far_below_two_megabytes() -> None:
    random, tracks = (
        np.random.default_rng(0),
        [track(f"V{number}", np.arange(1201), 0.05) for number in range(20)],
    )
    for each in tracks:
        for axis in ("x", "y"):
            each.columns[axis] += random.normal(0.0, 0.1, 1201)
    assert len(replay_page([result(tracks, 0.05, 60.0)])) < 500_000
