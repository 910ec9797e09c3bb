"""Target `acme`: JSON lines, for each step of a run an object with the time and all poses."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runner.judging.result import RunResult
    from xosc.exports.draft import Folder

TARGETS = {"acme": "JSON lines, an object with all poses and speeds for each step"}
# With OF_RUN = False it would export documents: export(source, target, folder, settings).
_COLUMNS = ("x", "y", "h", "speed")
_DIGITS = 6


def export(result: RunResult, name: str, folder: Folder) -> list[str]:
    """Write a run: x, y in m, heading h in rad, speed in m/s, of the reference points.

    Returns:
        Remarks on what is changed or left out.

    Raises:
        UsageError: a file is in the way.
        schemas.common.errors.Unsupported: the run has something that the target can't say.
    """
    steps: dict[float, dict[str, dict[str, float]]] = {}
    for track in result.recording.tracks.values():
        times, *values = (track.columns[column] for column in ("time", *_COLUMNS))
        for time, *row in zip(times, *values, strict=True):
            pose = {
                column: round(float(value), _DIGITS)
                for column, value in zip(_COLUMNS, row, strict=True)
            }
            steps.setdefault(round(float(time), _DIGITS), {})[track.name] = pose
    lines = [json.dumps({"time": time, "participants": steps[time]}) for time in sorted(steps)]
    folder.write(f"{name}.jsonl", "\n".join([*lines, ""]).encode())
    return ["heights, pitch and roll, and road coordinates are left out"]
