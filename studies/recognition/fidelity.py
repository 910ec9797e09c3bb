"""Fidelity of played catalogue scenarios to their recordings."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from recognition.catalogue.writing.index import rows_of
from recognition.recordings import Source
from recognition.scenes.cut import EGO, Excerpt, Part, SceneCutter, Scope
from runner.judging.execution import run
from runner.judging.measures.criticality import Criticality, of_recording
from runner.judging.result import RunResult
from runner.recording import Recording, Track
from schemas.common.array_types import FloatArray

_STEP = 0.05
"""Time step (s) of the runs"""
_SAME_TIME = 1e-6


class Deviation(NamedTuple):
    """Deviation of a participant of a run from its recorded motion.

    greatest, mean: distance over the recorded rows, m. speed, acceleration: root mean square of the
        difference, m/s and m/s²; accelerations from the second row on, as a run has none before its
        first step.
    rows: how many were compared. fastest, hardest: greatest speed (m/s) and acceleration (m/s²) of
    the run, by amount. hardest_at: when it accelerates or brakes hardest, s of the scenario's time.
    turn: greatest change of its heading from step to step, rad. missing: recorded rows at which the
    run has none of it; participants that appear at the end of a step are in the run's output
        from the next one on.
    """

    participant: str
    category: str
    greatest: float
    mean: float
    speed: float
    acceleration: float
    rows: int
    fastest: float
    hardest: float
    hardest_at: float
    turn: float
    missing: int


class Encounter(NamedTuple):
    """The least time to collision (s) of the ego in the recording and in the run; None where it
    never closes in on anyone."""

    recorded: float | None
    driven: float | None


class Replay(NamedTuple):
    """A scenario that was run: its participants' deviations, and how critical it was."""

    deviations: list[Deviation]
    encounter: Encounter


def of_catalogue(
    root: Path, sources: Iterable[Source], scope: Scope, world: str = "sumo"
) -> Iterator[tuple[str, Replay]]:
    """Each scenario of a catalogue that replays a recording, by its name in the index, run and
    compared.

    Args:
        root: the catalogue's folder.
        sources: the recordings that it was made from.
        scope: with which it was made.
    """
    rows = rows_of(root)
    for source in sources:
        own = [row for row in rows if row["recording"] == source.name]
        stage = SceneCutter(source.load(), scope) if own else None
        for row in own:
            assert stage is not None
            scene = stage.cut(row["vehicle"], row["start"], row["end"])
            yield row["file"], replayed(root / row["file"], scene, world)


def replayed(path: Path, scene: Excerpt, world: str = "sumo") -> Replay:
    """Run a scenario without a system under test, and compare every participant with the scene that
    it was made from.

    Reference points and motion are compared at every recorded row, also those that the scenario has
    no vertex for.
    """
    result = run(
        path, sut="none", timestep=_STEP, max_time=scene.end - scene.start + 1.0, world=world
    )
    recorded = [_within(part, scene) for part in scene.parts]
    driven = [
        _at_rows(track, result) for track in recorded if track.name in result.recording.tracks
    ]
    measures = (of_recording(Recording(tracks, _STEP, None), EGO) for tracks in (recorded, driven))
    return Replay(
        [_deviation(track, result) for track in recorded], Encounter(*map(_least_ttc, measures))
    )


def _within(part: Part, scene: Excerpt) -> Track:
    """Return the recorded track of a participant during the scene, at times from its start, without
    places on the road."""
    rows = slice(int(part.rows[0]), int(part.rows[-1]) + 1)
    columns = {name: values[rows] for name, values in part.track.columns.items()}
    columns["time"] = columns["time"] - scene.start
    columns["road_id"] = np.full(len(columns["time"]), None, dtype=object)
    return Track(part.name, part.track.kind, part.track.category, part.track.box, lambda: columns)


def _at_rows(recorded: Track, result: RunResult) -> Track:
    """Return the track of a participant of a run, at the times of its recording."""
    driven, time = result.recording.tracks[recorded.name].columns, recorded.columns["time"]
    time = time[
        (time >= driven["time"][0] - _SAME_TIME) & (time <= driven["time"][-1] + _SAME_TIME)
    ]
    columns = {
        name: np.interp(time, driven["time"], driven[name])
        for name in ("x", "y", "z", "speed", "s", "t")
    }
    columns["h"] = np.interp(time, driven["time"], np.unwrap(driven["h"]))
    columns |= {"time": time, "road_id": np.full(len(time), None, dtype=object)}
    return Track(recorded.name, recorded.kind, recorded.category, recorded.box, lambda: columns)


def _least_ttc(measures: Criticality | None) -> float | None:
    extreme = measures.summary["min_ttc"] if measures is not None else None
    return extreme["value"] if extreme is not None else None


def _deviation(part: Track, result: RunResult) -> Deviation:
    recorded = part.columns
    time, track = recorded["time"], result.recording.tracks.get(part.name)
    if track is None:
        return Deviation(part.name, part.category, *_ABSENT, len(time))
    driven = track.columns
    if driven["time"][0] > time[-1] + _SAME_TIME:
        return Deviation(part.name, part.category, *_ABSENT, len(time))
    there = (time >= driven["time"][0] - _SAME_TIME) & (time <= driven["time"][-1] + _SAME_TIME)
    off = {
        name: (np.interp(time, driven["time"], driven[name]) - recorded[name])[there]
        for name in _COMPARED
    }
    away = np.hypot(off["x"], off["y"])
    return Deviation(
        part.name,
        part.category,
        float(away.max()),
        float(away.mean()),
        _rms(off["speed"]),
        _rms(off["acceleration"][1:]),
        int(there.sum()),
        float(np.abs(driven["speed"]).max()),
        float(np.abs(driven["acceleration"]).max()),
        float(driven["time"][np.abs(driven["acceleration"]).argmax()]),
        float(np.abs(np.diff(np.unwrap(driven["h"]))).max(initial=0.0)),
        int((~there).sum()),
    )


_ABSENT = (math.inf, math.inf, math.inf, math.inf, 0, 0.0, 0.0, 0.0, 0.0)
_COMPARED = ("x", "y", "speed", "acceleration")


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
