"""How closely the scenarios of a catalogue, when they are run, repeat what was recorded."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from recognition.catalogue.scenes.scenes import Part, Scene, SceneCutter, Scope
from recognition.catalogue.writing.index import rows_of
from recognition.datasets import Source
from runner.interpreter.execution import run
from runner.interpreter.result import RunResult

_STEP = 0.05
"""Time step (s) of the runs"""
_SAME_TIME = 1e-6


class Deviation(NamedTuple):
    """How far a participant of a run is from its recorded positions.

    greatest, mean: distance over the recorded rows, m. missing: recorded rows at which the run has none of it; participants that
        appear at the end of a step is in the run's output from the next one on.
    """

    participant: str
    greatest: float
    mean: float
    missing: int


def of_catalogue(
    root: Path, sources: Iterable[Source], scope: Scope, world: str = "sumo"
) -> Iterator[tuple[str, list[Deviation]]]:
    """Each scenario of a catalogue that replays a recording, by its name in the index, with the deviations of its participants.

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
            yield row["file"], list(replayed(root / row["file"], scene, world))


def replayed(path: Path, scene: Scene, world: str = "sumo") -> Iterator[Deviation]:
    """Run a scenario without a system under test, and compare every participant with the scene that it was made from.

    Reference points are compared at every recorded row, also those that the scenario has no vertex for.
    """
    result = run(path, sut="none", timestep=_STEP, max_time=scene.end - scene.start + 1.0, world=world)
    for part in scene.parts:
        yield _deviation(part, scene, result)


def _deviation(part: Part, scene: Scene, result: RunResult) -> Deviation:
    recorded = part.track.columns
    rows = slice(int(part.rows[0]), int(part.rows[-1]) + 1)
    time = recorded["time"][rows] - scene.start
    track = result.recording.tracks.get(part.name)
    if track is None:
        return Deviation(part.name, np.inf, np.inf, len(time))
    driven = track.columns
    there = (time >= driven["time"][0] - _SAME_TIME) & (time <= driven["time"][-1] + _SAME_TIME)
    dx, dy = (np.interp(time, driven["time"], driven[axis]) - recorded[axis][rows] for axis in ("x", "y"))
    away = np.hypot(dx, dy)[there]
    return Deviation(part.name, float(away.max()), float(away.mean()), int((~there).sum()))
