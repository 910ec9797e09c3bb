"""Scenarios of a catalogue, each compiled and played once before it is listed, and its distance
from the raw recording."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from recognition.scenes.cut import Excerpt
from runner.judging.execution import run
from runner.judging.result import INCONCLUSIVE, RunResult
from runner.recording import Recording, Track
from schemas.common.array_types import FloatArray
from schemas.common.errors import ToolchainError
from schemas.common.terminal.text import many

_STEP = 0.1
"""Time step (s) of the runs: replays are where they are at half of it, to a tenth of a
millimetre, in half of the steps"""
_LATE = 1.0
"""Time (s) after its end in which a scenario has to end"""
_LONGEST = 120.0
"""Time (s) in which a manoeuvre has to end"""
_SAME_TIME = 1e-6


class Trial(NamedTuple):
    """A scenario to be played: files relative to the catalogue, times of the scene (s), and tracks
    by names of participants."""

    file: str
    maneuver: str | None
    start: float
    end: float
    tracks: Mapping[str, str]

    @classmethod
    def of(cls, file: str, maneuver: str | None, scene: Excerpt) -> Trial:
        """Trial of the files of a scene."""
        named = {part.name: part.track.name for part in scene.parts}
        return cls(file, maneuver, scene.start, scene.end, named)


class Played(NamedTuple):
    """Outcome of a trial.

    fault, maneuver_fault: why the scenario or its manoeuvre does not play, None where it does; a
    manoeuvre also has to test something. inconclusive: why the replay has no verdict as recorded.
    deviation, most_deviation: median and maximum over the participants of the greatest distance
    (m) from the raw places of their tracks; None where nothing was played.
    """

    file: str
    fault: str | None
    maneuver_fault: str | None
    inconclusive: str | None
    deviation: float | None
    most_deviation: float | None


def play(root: Path, recording: Recording, trials: Iterable[Trial]) -> list[Played]:
    """Play scenarios of a recording without a simulator, and no system under test."""
    return [_play(root, recording, trial) for trial in trials]


def _play(root: Path, recording: Recording, trial: Trial) -> Played:
    duration = trial.end - trial.start + _LATE
    result = _result(root / trial.file, duration)
    fault = _fault(result, duration)
    # Without its replay the scenario is not listed: its manoeuvre need not be played.
    of_maneuver = None
    if trial.maneuver is not None and fault is None:
        varied = _result(root / trial.maneuver, _LONGEST)
        # A manoeuvre that is written has to happen; recorded participants may be lost from sight.
        of_maneuver = _fault(varied, _LONGEST) or _inconclusive(varied, root)
    away = (
        [
            _deviation(recording.tracks[track], trial.start, result.recording.tracks[name])
            for name, track in trial.tracks.items()
            if name in result.recording.tracks
        ]
        if isinstance(result, RunResult)
        else []
    )
    known = [value for value in away if value is not None]
    return Played(
        trial.file,
        fault,
        of_maneuver,
        _inconclusive(result, root) if fault is None else None,
        round(float(np.median(known)), 3) if known else None,
        round(max(known), 3) if known else None,
    )


def _result(path: Path, longest: float) -> RunResult | ToolchainError:
    try:
        return run(path, sut="none", world="kinematic", timestep=_STEP, max_time=longest)
    except ToolchainError as error:
        return error


def _fault(result: RunResult | ToolchainError, longest: float) -> str | None:
    if isinstance(result, ToolchainError):
        return f"it does not play: {result.message}"
    if result.status == "timeout":
        return f"it does not end within {longest:.1f} s"
    return None


def _inconclusive(result: RunResult | ToolchainError, root: Path) -> str | None:
    """Return the first cause for which a run has no verdict; None if it has one."""
    if isinstance(result, ToolchainError) or result.verdict.outcome != INCONCLUSIVE:
        return None
    first, *more = (cause.text for cause in result.verdict.causes)
    beside = f" (and {many(len(more), 'other cause')})" if more else ""
    # The same catalogue has the same bytes wherever it lies.
    return f"its run is inconclusive: {first.replace(f'{root}/', '')}{beside}"


def _deviation(recorded: Track, start: float, played: Track) -> float | None:
    """Greatest distance (m) of a played track from the raw places; None without rows in common."""
    columns, driven = recorded.columns, played.columns
    time = columns["time"] - start
    # Between the played rows only: before its entry and after its exit a participant is nowhere.
    there = (time >= driven["time"][0] - _SAME_TIME) & (time <= driven["time"][-1] + _SAME_TIME)
    if not there.any():
        return None
    away = [_off(columns.get(f"raw_{axis}", columns[axis]), time, driven, axis) for axis in "xy"]
    return float(np.hypot(*away)[there].max())


def _off(
    raw: FloatArray, time: FloatArray, driven: Mapping[str, FloatArray], axis: str
) -> FloatArray:
    return np.interp(time, driven["time"], driven[axis]) - raw
