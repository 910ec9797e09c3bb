"""ASAM OSI ground truth: `.osi` and `.mcap` traces of GroundTruth or SensorView messages,
omega-prime's files among them.

Source: ASAM OSI 3.8; see `runner.exchange.traces`. Ground truth is taken as it is, without
smoothing. Needs the extra `osi`.
"""

from __future__ import annotations

import math
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from recognition.recordings.conditions import UNKNOWN, OddConditions, phase_of
from recognition.recordings.intake import Exclusion, Gap, Report
from recognition.recordings.source import SiteRoad, Source
from runner.exchange.traces.maps import road_of
from runner.exchange.traces.reading import TraceRecording
from runner.exchange.traces.reading import read as read_trace
from runner.recording import Recording, Track
from schemas.common.errors import UsageError
from schemas.osi.traces import SUFFIXES

FORMAT = "OSI"
TITLE = "ASAM OSI traces (.osi, .mcap; omega-prime)"
BY_CONTENT = False
_SNOW = 274.15
"""Temperature (K) below which precipitation is snow"""
_LATE = 1.5
"""Steps after which messages are missing between two rows of a track"""


def claims(path: Path) -> bool:
    """Whether a file is a trace, by its name."""
    return path.suffix.lower() in SUFFIXES


def sources(path: Path, roads: Path) -> list[Source]:
    """The recording of a trace, which is a site of its own."""
    return [
        Source(
            path.stem,
            path.stem,
            FORMAT,
            path,
            partial(_read, path),
            road=partial(_road, path),
            ego=partial(_ego, path),
            odd=partial(_conditions, path),
        )
    ]


@lru_cache(maxsize=1)
def _trace(path: Path, _version: int) -> TraceRecording:
    """Read a trace; the result is cached for its road, which is read next."""
    return read_trace(path)


def _ego(path: Path) -> str | None:
    """Name of the host vehicle of a trace; None where it names none."""
    return _trace(path, path.stat().st_mtime_ns).ego


def _conditions(path: Path) -> OddConditions:
    return conditions_in(_trace(path, path.stat().st_mtime_ns).truth.environmental_conditions)


def conditions_in(told: Any) -> OddConditions:
    """Rain, snow, fog and daylight of OSI's EnvironmentalConditions."""
    weather = UNKNOWN
    if told.precipitation > told.PRECIPITATION_NONE:
        # The message has one kind of precipitation; what falls below 1 °C is snow.
        weather = "snow" if 0.0 < told.temperature < _SNOW else "rain"
    elif told.fog >= told.FOG_MIST:
        weather = "fog"
    elif told.precipitation == told.PRECIPITATION_NONE:
        weather = "clear"
    sun = math.degrees(told.sun.elevation) if told.HasField("sun") else None
    return OddConditions(weather, UNKNOWN if sun is None else phase_of(sun))


def _read(path: Path) -> tuple[Recording, Report]:
    # The time of change is part of the key: a trace that was written anew is read anew.
    found = _trace(path, path.stat().st_mtime_ns)
    tracks = [
        Track(track.name, track.kind, track.category, track.box, track.read)
        for track in found.recording.tracks.values()
    ]
    recording = Recording(tracks, found.recording.timestep, None)
    exclusions = [Exclusion(*omission) for omission in found.left_out]
    report = Report(
        sum(len(track.columns["time"]) for track in tracks),
        len(tracks),
        exclusions=exclusions,
        remarks=[*found.remarks],
    )
    for track in tracks:
        time = track.columns["time"]
        for row in np.flatnonzero(np.diff(time) > _LATE * recording.timestep).tolist():
            start, end = float(time[row]), float(time[row + 1])
            report.gaps.append(
                Gap(track.name, start, end, round((end - start) / recording.timestep) - 1)
            )
    return recording, report


def _road(path: Path, _recording: Recording, folder: Path) -> SiteRoad:
    found = road_of(path, _trace(path, path.stat().st_mtime_ns), folder)
    if found is None:
        raise UsageError(
            f"{path.stem} has no road: no map, no lanes, and no {path.stem}.xodr beside it; give "
            "one by --road",
            path=path,
        )
    return SiteRoad(found.path, notes=found.notes)
