"""A whole recording as one scenario that replays it."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from recognition.catalogue.writing import replay
from recognition.catalogue.writing.write import AUTHOR, DATE
from recognition.recordings import Source, cache_roads
from recognition.recordings.motion.smoothing import RAW
from recognition.recordings.source import opened
from recognition.scenes import map_of
from recognition.scenes.cut import Excerpt, SceneCutter, Scope, Tolerance
from runner.recording import Recording, Track
from schemas.common.errors import InvalidFile, UsageError
from schemas.common.policy import limited
from schemas.common.storage import keep, read_bytes, writing
from xosc.document import to_bytes
from xosc.writing.files import FileHeader
from xosc.writing.versions import Version


class Replay(NamedTuple):
    """A scenario that replays a recording.

    files: the scenario and its road, if it has one. remarks: what was assumed, derived or left out.
    """

    files: list[Path]
    remarks: list[str]


@limited()
def write_replay(
    path: Path,
    out: Path,
    *,
    ego: str | None = None,
    road: Path | None = None,
    columns: Path | None = None,
    version: Version = (1, 3),
    raw: bool = False,
) -> Replay:
    """Write one scenario that replays a recording from the first to the last row of its ego, and
    its road beside it.

    The smoothed motion is replayed; its distance from the recorded places is a remark.

    Args:
        path: the recording.
        out: the scenario, `.xosc`.
        ego: name of the participant that becomes the ego; by default the recording's own vehicle,
            else the vehicle that is there for longest.
        road: the OpenDRIVE file; by default what the recording has. A recording without one is
            replayed on a plane.
        columns: declaration of the columns of tables; by default the one beside the recording.
        version: of the standard.
        raw: replay the recorded places and headings, row by row, noise included.

    Raises:
        InvalidFile, Unsupported: the recording can't be read, or has no participants.
        UsageError: there are several recordings, no such participant, or the files can't be
            written.
    """
    source = _only(opened((path,), road, columns), path)
    recording = source.load()
    assert source.report is not None, "the recording has been read"
    remarks = [
        *source.report.remarks,
        *(
            f"{exclusion.what} is left out: {exclusion.reason}"
            for exclusion in source.report.exclusions
        ),
    ]
    track = _ego(recording, source, ego, remarks)
    file = _road(source, recording, remarks)
    if raw:
        recording = _unsmoothed(recording)
    # Everyone takes part, however far from the ego.
    scope = Scope(math.inf, _NONE if raw else Tolerance())
    scene = SceneCutter(recording, scope).cut(track.name, -math.inf, math.inf)
    remarks += _deviation(scene)
    absent = len(recording.tracks) - len(scene.parts)
    if absent:
        remarks.append(
            f"{absent} participants are not there together with the ego, in two "
            "messages or more: left out"
        )
    beside = out.with_suffix(".xodr") if file is not None else None
    header = FileHeader(
        f"replay of {source.name}, {scene.start:.2f} s to {scene.end:.2f} s, ego {track.name}",
        AUTHOR,
        DATE,
    )
    document = replay.whole(
        out,
        header,
        scene,
        road=beside.name if beside is not None else None,
        version=version,
        exact=raw,
    )
    with writing("the scenario", out):
        if file is not None and beside is not None:
            _put(beside, read_bytes(file))
        keep(to_bytes(document), out)
    return Replay([out] if beside is None else [out, beside], remarks)


_NONE = Tolerance(0.0, 0.0, 0.0, 0.0)
"""Tolerance that keeps every row"""


def _unsmoothed(recording: Recording) -> Recording:
    """The recording with recorded instead of smoothed values."""
    tracks = [replace(track, read=partial(_recorded, track)) for track in recording.tracks.values()]
    return Recording(tracks, recording.timestep, recording.network)


def _recorded(track: Track) -> dict[str, np.ndarray]:
    columns = track.columns
    # The columns `raw_…` themselves go: their values stand under the names without it.
    recorded = {name: columns[f"raw_{name}"] for name in RAW if f"raw_{name}" in columns}
    return {name: values for name, values in columns.items() if name[4:] not in recorded} | recorded


def _deviation(scene: Excerpt) -> list[str]:
    """A sentence on the distance of smoothed places from the recorded ones,
    where a track has both.
    """
    away = dict[str, float]()
    for part in scene.parts:
        columns, rows = part.track.columns, slice(part.rows[0], part.rows[-1] + 1)
        if "raw_x" in columns:
            dx, dy = (columns[f"raw_{axis}"][rows] - columns[axis][rows] for axis in "xy")
            away[part.name] = float(np.hypot(dx, dy).max())
    if not away:
        return []
    most = max(away, key=lambda name: away[name])
    median = float(np.median(list(away.values())))
    return [
        f"smoothed motion is up to {median:.2f} m (median of the participants) and "
        f"{away[most]:.2f} m"
        f" ({most}) off the recorded places; --raw replays those"
    ]


def _only(sources: list[Source], path: Path) -> Source:
    if len(sources) > 1:
        names = ", ".join(source.name for source in sources[:3])
        raise UsageError(
            f"here are {len(sources)} recordings ({names}, …): one replay is of one", path=path
        )
    return sources[0]


def _ego(recording: Recording, source: Source, name: str | None, remarks: list[str]) -> Track:
    """The participant that becomes the ego."""
    present = {
        track.name: track for track in recording.tracks.values() if len(track.columns["time"]) > 1
    }
    if name is not None:
        if name not in present:
            raise UsageError(
                f"no participant {name!r} is there for two messages; there are "
                f"{', '.join(list(present)[:10])}"
            )
        return present[name]
    # The vehicle that recorded, where the format knows it: it is there throughout.
    own = source.ego()
    if own in present:
        return present[own]
    vehicles = [track for track in present.values() if track.kind == "vehicle"] or list(
        present.values()
    )
    if not vehicles:
        raise InvalidFile("no participant is there for two messages", path=source.path)
    longest = max(
        vehicles, key=lambda track: float(track.columns["time"][-1] - track.columns["time"][0])
    )
    remarks.append(
        f"the recording names no ego: {longest.name} is it, which is there for longest; --ego "
        "chooses another one"
    )
    return longest


def _road(source: Source, recording: Recording, remarks: list[str]) -> Path | None:
    """The road of the recording; None where it has none."""
    try:
        found = map_of(source, recording, cache_roads())
    except UsageError as error:
        remarks.append(f"{error.message}: replayed on a plane")
        return None
    remarks += found.notes
    return found.path


def _put(path: Path, content: bytes) -> None:
    """Write a file that is not there, or has this content."""
    if path.exists() and path.read_bytes() != content:
        raise UsageError("another road is here: give --out another name", path=path)
    keep(content, path)
