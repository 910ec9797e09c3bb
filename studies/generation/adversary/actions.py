"""Actions of recorded drivers that cut in: states around the vehicle they cut in on, and the
accelerations that followed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recognition.labels.classes import Rules
from recognition.labels.maneuvers.estimation import LaneCoordinates, lane_motion, segment
from recognition.labels.maneuvers.parameters import CUT_IN, Unit
from recognition.labels.scene import prepare
from recognition.recordings import Source
from recognition.recordings import open as open_data
from recognition.scenes import site_of
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import InvalidFile, UsageError
from schemas.common.storage import read_parquet

INTERVAL = 0.5
"""Time (s) between two decisions of a driver; in between, accelerations change evenly"""
DECISIONS = 16
"""Most decisions of an episode"""
STATE = ("gap", "aside", "drift", "closing", "speed", "along", "across")
"""State of a driver relative to the ego, the vehicle it cuts in on.

gap: from the ego's front to the driver's rear along the road, m, negative where they are beside
each other. aside: distance of their middles across the road, m, positive on the side that the
driver comes from. drift: the driver's speed across the road, m/s, positive away from the ego.
closing: speed of the ego less the driver's, m/s. speed: the driver's, m/s. along, across: its
accelerations, m/s²."""
ACTION = ("along", "across")
"""Action of a driver: its accelerations (m/s²) at the next decision."""
OWN = Path(__file__).with_name("own.parquet")
"""Actions in our own recordings of motorways, by `benchmarks/record.py` and `python -m
studies.generation actions --out`"""
_LEAD_IN = 1.0
"""Time (s) before the lane change at which an episode begins"""
_LEAST = 8
"""Decisions of an episode at least"""
_WIDE = 0.4
"""Half the time (s) over which speeds and accelerations across the road are differences: recordings
tell centimetres"""
_DIGITS = 2
_NEXT = tuple(f"next_{name}" for name in ACTION)


@dataclass(frozen=True, eq=False)
class Actions:
    """Decisions of recorded drivers, one a row, those of an episode one after the other.

    Attributes:
        states: (n, 7), the columns of `STATE`. actions: (n, 2), those of `ACTION`.
        recordings: (n,). episodes: numbers (n,), ascending.
    """

    states: FloatArray
    actions: FloatArray
    recordings: NDArray[np.str_]
    episodes: IntArray

    def __len__(self) -> int:
        return len(self.actions)

    @property
    def joint(self) -> FloatArray:
        """States and actions beside each other (n, 9)."""
        return np.hstack([self.states, self.actions])

    @property
    def rank(self) -> IntArray:
        """Number of decisions of its episode before each (n,)."""
        begins = np.flatnonzero(np.diff(self.episodes, prepend=-1))
        return np.arange(len(self)) - np.repeat(begins, np.diff(np.append(begins, len(self))))

    @classmethod
    def joined(cls, parts: Sequence[Actions]) -> Actions:
        """Several tables as one, with episodes numbered anew."""
        counts = np.cumsum([0, *(int(part.episodes[-1]) + 1 if len(part) else 0 for part in parts)])
        columns = {
            each.name: np.concatenate([getattr(part, each.name) for part in parts])
            for each in fields(cls)
        }
        moved = [part.episodes + count for part, count in zip(parts, counts[:-1], strict=True)]
        return cls(**columns | {"episodes": np.concatenate(moved)})

    def write(self, path: str | PathLike[str]) -> None:
        """Write a Parquet file, numbers rounded to centimetres and the like."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        numbers = zip(
            (*STATE, *_NEXT), np.round(self.joint, _DIGITS).astype(np.float32).T, strict=True
        )
        labels = {
            "recording": pa.array(self.recordings.tolist()).dictionary_encode(),
            "episode": self.episodes.astype(np.int32),
        }
        pq.write_table(
            pa.table(labels | dict(numbers)), path, compression="zstd", compression_level=19
        )

    @classmethod
    def read(cls, path: str | PathLike[str]) -> Actions:
        """Read a Parquet file that `write` wrote.

        Raises:
            InvalidFile: it is no Parquet file, lacks a column, or has a number that is none.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            columns = "recording", "episode", *STATE, *_NEXT
            if lacking := sorted({*columns} - {*pq.read_schema(path).names}):
                raise InvalidFile(
                    f"no table of actions: there is no column {lacking[0]}", path=path
                )
            table = read_parquet(path, columns=list(columns))
            numbers = np.stack(
                [table[name].to_numpy().astype(np.float64) for name in (*STATE, *_NEXT)], axis=1
            )
            recordings, episodes = (
                np.array(table["recording"].to_pylist(), np.str_),
                table["episode"].to_numpy().astype(np.int64),
            )
        except (OSError, pa.ArrowException, KeyError, ValueError) as error:
            raise InvalidFile(f"no table of actions: {error}", path=path) from None
        if len(bad := np.argwhere(~np.isfinite(numbers))):
            row, column = bad[0].tolist()
            raise InvalidFile(
                f"row {row + 1}: {(*STATE, *_NEXT)[column]} is not a finite number", path=path
            )
        return cls(
            np.round(numbers[:, : len(STATE)], _DIGITS),
            np.round(numbers[:, len(STATE) :], _DIGITS),
            recordings,
            episodes,
        )


def extract(path: str | PathLike[str], roads: str | PathLike[str]) -> Actions:
    """The decisions of all drivers that cut in in the recordings of a folder.

    Args:
        roads: folder for roads that recordings don't bring with them.

    Raises:
        UsageError: no vehicle cuts in.
        InvalidFile: a recording is malformed.
    """
    found = Actions.joined(
        [_extracted(source, Path(roads)) for source in open_data(path, roads).sources]
    )
    if not len(found):
        raise UsageError("these recordings have no cut-in that lasts long enough", path=path)
    return found


def _extracted(source: Source, roads: Path) -> Actions:
    recording = source.load()
    motion = lane_motion(prepare(recording, site_of(source, recording, roads), Rules()))
    units = (unit for unit in segment(motion) if unit.kind == CUT_IN and not unit.alone)
    episodes = [each for unit in units for each in _episode(motion, unit)]
    rows = np.concatenate(episodes) if episodes else np.empty((0, len(STATE) + len(ACTION)))
    numbers = np.repeat(np.arange(len(episodes)), [len(each) for each in episodes])
    return Actions(
        rows[:, : len(STATE)], rows[:, len(STATE) :], np.full(len(rows), source.name), numbers
    )


def _episode(motion: LaneCoordinates, unit: Unit) -> Iterator[FloatArray]:
    """States and actions (k, 9) around the lane change of a unit, for as long as both are there;
    none where that is too short."""
    scene = motion.scene
    wide, every = scene.rows(_WIDE), scene.rows(INTERVAL)
    first = max(unit.start - scene.rows(_LEAD_IN), int(motion.first[unit.start]) + wide)
    last = min(first + every * DECISIONS, int(motion.last[unit.start]) - wide)
    rows, others = [], []
    for row in range(first, last + 1, every):
        other = motion.row(unit.other, int(scene.frame[row]))
        if other is None:
            break
        rows.append(row)
        others.append(other)
    if len(rows) > _LEAST:
        states = _states(motion, np.array(rows), np.array(others), wide, unit.shift)
        yield np.hstack([states[:-1], states[1:, -len(ACTION) :]])


def _states(
    motion: LaneCoordinates, rows: IntArray, others: IntArray, wide: int, shift: float
) -> FloatArray:
    """States (k, 7) at rows of a driver and of the other one; `wide` is half the rows that
    differences reach over."""
    scene, side = motion.scene, -np.sign(shift)
    time, lateral = wide * scene.step, motion.lateral
    dx, dy, h = scene.x[rows] - scene.x[others], scene.y[rows] - scene.y[others], scene.h[others]
    gap = dx * np.cos(h) + dy * np.sin(h) + scene.rear[rows] - scene.front[others]
    aside = side * (dy * np.cos(h) - dx * np.sin(h))
    drift = side * (lateral[rows + wide] - lateral[rows - wide]) / (2.0 * time)
    across = side * (lateral[rows + wide] - 2.0 * lateral[rows] + lateral[rows - wide]) / time**2
    speed = scene.speed[rows]
    return np.stack(
        [gap, aside, drift, scene.speed[others] - speed, speed, scene.acceleration[rows], across],
        axis=1,
    )
