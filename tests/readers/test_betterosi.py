"""OSI traces as betterosi reads them, and the MCAP file by the checks of the mcap package."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import runner
from runner.exchange.exports import osi
from runner.recording import Track
from tests.readers.conftest import Read

LIBRARY = Path(__file__).parents[2] / "xosc" / "library"

READ = """
import json, sys
import betterosi
from mcap.reader import make_reader
path = sys.argv[1]
topics = {}
if path.endswith(".mcap"):
    with open(path, "rb") as stream:
        for _, channel, _ in make_reader(stream, validate_crcs=True).iter_messages():
            topics[channel.topic] = topics.get(channel.topic, 0) + 1
rows = []
for truth in betterosi.read(path, return_ground_truth=True):
    time = truth.timestamp.seconds + 1e-9 * truth.timestamp.nanos
    places = sorted((each.base.position.x, each.base.position.y, each.base.dimension.length) for each in truth.moving_object)
    rows.append([time, places, len(truth.lane)])
print(json.dumps([rows, topics]))
"""


@pytest.mark.parametrize("suffix", [".osi", ".mcap"])
def test_a_trace_says_what_was_driven(read: Read, tmp_path: Path, suffix: str) -> None:
    result = runner.run(LIBRARY / "simple_cut_in.xosc", world="kinematic", sut="none", max_time=2.0)
    path = tmp_path / f"trace{suffix}"
    osi.write_trace(result, path)
    rows, topics = read(READ, path)
    assert [row[0] for row in rows] == pytest.approx(
        next(iter(result.recording.tracks.values())).columns["time"]
    )
    assert all(lanes > 0 for _, _, lanes in rows)
    assert topics == (
        {"ground_truth": 41, "traffic_command": 1, "traffic_update": 41}
        if suffix == ".mcap"
        else {}
    )
    for step, (_, places, _) in enumerate(rows):
        driven = sorted(
            (*centre(track, step), track.box.length) for track in result.recording.tracks.values()
        )
        assert places == [pytest.approx(place, abs=1e-6) for place in driven]


def centre(track: Track, step: int) -> tuple[float, float]:
    """The place of the middle of an entity's box."""
    x, y, h = (float(track.columns[name][step]) for name in ("x", "y", "h"))
    ahead, left = track.box.x, track.box.y
    return x + ahead * math.cos(h) - left * math.sin(h), y + ahead * math.sin(h) + left * math.cos(
        h
    )
