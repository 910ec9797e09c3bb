"""JSON lines of runs, read back."""

import json
from pathlib import Path

from acme import export

import xosc_toolchain as xt
from xosc.exports.draft import Folder


def test_each_step_has_all_participants(tmp_path: Path) -> None:
    result = xt.run("simple_cut_in", sut="none", world="kinematic", max_time=1.0)
    assert export.export(result, "run", Folder(tmp_path)) == [
        "heights, pitch and roll, and road coordinates are left out"
    ]
    steps = [json.loads(line) for line in (tmp_path / "run.jsonl").read_text().splitlines()]
    assert len(steps) == len(result.recording.tracks["Ego"].columns["time"])
    assert all(set(step["participants"]) == set(result.recording.tracks) for step in steps)
