"""Motion along roads in segments of many runs is that of each run by itself."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from runner.engine.participants.declaration import BoundingBox
from runner.judging.measures.relations import MotionRows, along_road
from runner.judging.measures.segments import ENDLESS, FRAME, RoadMotion, Segment

BOX = BoundingBox(4.5, 1.8, 1.5, 1.4, 0.0, 0.75)
RUNS, STEPS, DT = 40, 23, 0.05


def _motions(seed: int) -> tuple[Any, Any, Any]:
    """Frames (7, steps, runs), keys of roads and numbers of instants of runs that stand, turn back
    and change roads."""
    generator = np.random.default_rng(seed)
    ahead = generator.choice([0.0, 0.0, 1.0, -1.0], (STEPS, RUNS))
    ahead[:, :10] = 0.0  # never move
    ahead[: STEPS // 2, 10:20] = 0.0  # move late
    values = generator.normal(size=(len(FRAME), STEPS, RUNS))
    values[5] = np.cumsum(ahead, axis=0)
    roads = np.where(generator.random((STEPS, RUNS)) < 0.9, 7, 8)
    roads[:, 30:] = 7
    sizes = generator.integers(1, STEPS + 1, RUNS)
    return values, roads, sizes


@pytest.mark.parametrize("seed", range(6))
def test_motion_in_segments_is_that_of_each_run(seed: int) -> None:
    values, roads, sizes = _motions(seed)
    way = RoadMotion(RUNS, BOX, {7: "a", 8: "b"}, None, DT)
    ends = np.unique([1, *np.random.default_rng(seed).integers(1, STEPS, 4), STEPS])
    parts = []
    for first, last in zip([0, *ends[:-1]], ends, strict=True):
        part = Segment(
            int(first),
            np.arange(RUNS),
            values[None, :, first:last].copy(),
            roads[None, first:last].copy(),
            int(last - first),
        )
        over = np.where(sizes <= last, sizes, ENDLESS)
        way.survey(part, 0, over)
        parts.append(part)
    moved = [way.moved(part, 0, slice(None)) for part in parts]
    side, drift = (
        np.concatenate([getattr(each, name) for each in moved]) for name in ("side", "drift")
    )
    for run, size in enumerate(sizes):
        rows = SimpleNamespace(
            **dict(zip(FRAME, values[:, :size, run], strict=True)),
            road=roads[:size, run],
            time=np.round(np.arange(size) * DT, 9),
        )
        motion: MotionRows = rows  # type: ignore[assignment]
        expected = along_road(motion, np.zeros(size, int), np.arange(size))
        assert (side[:size, run] == expected[0]).all()
        assert (drift[:size, run] == expected[1]).all()


def test_who_has_not_moved_yet_faces_as_in_the_first_movement_of_a_later_segment() -> None:
    values = np.zeros((1, len(FRAME), 2, 1))
    values[0, 4] = 1.0
    keys = np.full((1, 2, 1), 7)
    way = RoadMotion(1, BOX, {7: "a"}, None, DT)
    way.survey(Segment(0, np.arange(1), values, keys.copy(), 2), 0, np.array([ENDLESS]))
    assert way.facing.tolist() == [0.0]
    later = values.copy()
    later[0, 5] = -1.0
    way.survey(Segment(2, np.arange(1), later, keys.copy(), 2), 0, np.array([ENDLESS]))
    assert way.facing.tolist() == [-1.0]
