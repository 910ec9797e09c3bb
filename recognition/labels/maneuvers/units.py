"""Driven time and distance of recordings, which turn shares of manoeuvres into rates per hour or
kilometre."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recognition.labels.classes import Rules
from recognition.labels.maneuvers.estimation import (
    LaneCoordinates,
    errors,
    estimate,
    lane_motion,
    segment,
)
from recognition.labels.maneuvers.parameters import (
    ACCELERATION,
    BRAKING,
    DECLARED,
    JERK,
    PARAMETERS,
    Unit,
)
from recognition.labels.scene import prepare
from recognition.recordings import Source
from recognition.recordings import open as open_data
from recognition.scenes import site_of
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import InvalidFile, UsageError
from schemas.common.storage import drafted, read_parquet

_HOUR, _KILOMETRE, _DIGITS = 3600.0, 1000.0, 4


@dataclass(frozen=True)
class Exposure:
    """Exposure: driving of all possible egos of a recording, and the manoeuvres in it.

    Attributes:
        hours: of driving, summed over vehicles.
        kilometres: likewise.
        counts: units by kind, those whose parameters can't be estimated among them.
        quality: of the recording, from 0 to 1 (`recognition.recordings.intake`); of several the
            mean by hours.
    """

    hours: float
    kilometres: float
    counts: Mapping[str, int]
    quality: float = 1.0

    @classmethod
    def of(cls, motion: LaneCoordinates, units: Iterable[Unit], quality: float = 1.0) -> Exposure:
        """Return the exposure of one recording."""
        scene = motion.scene
        # Steps between two tracks, and over missing frames, are no driving.
        steps = np.where(
            (np.diff(scene.track) == 0) & (np.diff(scene.frame) == 1), np.diff(scene.time), 0.0
        )
        # Only driving of possible egos: rates are per hour of these.
        steps[~scene.egos[scene.track[:-1]]] = 0.0
        ways = steps * np.abs(scene.speed[:-1])
        hours, kilometres = float(steps.sum()) / _HOUR, float(ways.sum()) / _KILOMETRE
        counts = dict(Counter(unit.kind for unit in units))
        return cls(round(hours, _DIGITS), round(kilometres, _DIGITS), counts, quality)

    @classmethod
    def total(cls, parts: Iterable[Exposure]) -> Exposure:
        """Return the sum over recordings."""
        listed = list(parts)
        counts = sum((Counter(part.counts) for part in listed), Counter[str]())
        hours = sum(part.hours for part in listed)
        quality = sum(part.quality * part.hours for part in listed) / hours if hours > 0.0 else 1.0
        return cls(hours, sum(part.kilometres for part in listed), dict(counts), quality)


def to_bytes(exposure: Mapping[str, Exposure]) -> bytes:
    """Exposure by recording, for files."""
    return json.dumps(
        {name: vars(part) for name, part in exposure.items()}, separators=(",", ":")
    ).encode()


def from_bytes(content: bytes) -> dict[str, Exposure]:
    """Read the result of `to_bytes`.

    Raises:
        ValueError: these are others.
    """
    try:
        return {
            name: Exposure(
                float(values["hours"]),
                float(values["kilometres"]),
                {kind: int(n) for kind, n in values["counts"].items()},
                float(values.get("quality", 1.0)),
            )
            for name, values in json.loads(content).items()
        }
    except (AttributeError, KeyError, TypeError) as error:
        raise ValueError(f"no exposure of recordings: {error!r}") from None


LENGTH = 4.5
"""Length (m) of a car, between the gap to its rear and the gap from its front"""
MOST_LAG = 4.0
"""Time (s) by which the two begin one after the other at most"""
_GAP, _START_SPEED, _DURATION = (
    list(PARAMETERS).index(role) for role in ("gap", "start_speed", "duration")
)


@dataclass(frozen=True, eq=False)
class PairedUnits:
    """Two units each: of the actor that is nearer to the ego, and of the one ahead of that.

    Attributes:
        first, second: units, as many of each; `first.others` are the egos.
        ahead: gap from the first actor's front to the second one's rear when the first one begins,
            m (n,).
        lag: when the second one begins, after the first one, s (n,).
    """

    first: Samples
    second: Samples
    ahead: FloatArray
    lag: FloatArray

    def __len__(self) -> int:
        return len(self.lag)


def pairs(samples: Samples, first: str, second: str) -> PairedUnits:
    """The pairs of units of two kinds that overlap in time, have the same ego, and the second actor
    ahead of the first one.

    The second unit's ego may be the first actor instead, then between the two. Speeds before the
    units are taken to be those at their beginning.
    """
    chosen = _overlapping(samples, first, second)
    one, two = samples.where(chosen[:, 0]), samples.where(chosen[:, 1])
    lag = two.times - one.times
    behind = two.others == one.actors
    followed = np.where(behind, one.theta[:, _START_SPEED], two.ego_speeds)
    # The gap was measured when the second unit began; it is carried back to the first one's
    # beginning.
    ahead = two.theta[:, _GAP] - (two.theta[:, _START_SPEED] - followed) * lag
    ahead -= np.where(behind, 0.0, one.theta[:, _GAP] + LENGTH)
    kept = np.flatnonzero((ahead > 0.0) & (np.abs(lag) < MOST_LAG))
    return PairedUnits(one.where(kept), two.where(kept), ahead[kept], lag[kept])


@dataclass(frozen=True, eq=False)
class Followed:
    """Units while a vehicle drives behind their egos.

    Attributes:
        units: as many.
        behind: gap from the front of the one behind to the ego's rear when the unit begins, m (n,).
    """

    units: Samples
    behind: FloatArray

    def __len__(self) -> int:
        return len(self.behind)


def followed(samples: Samples, kind: str) -> Followed:
    """The units of a kind whose egos brake or accelerate ahead of a vehicle, within `MOST_LAG` of
    the unit's beginning.

    Where an ego does so several times, the time nearest to the unit's beginning counts. Speeds from
    one to the other are taken to be those of that time.
    """
    egos: dict[tuple[str, str], list[int]] = defaultdict(list)
    for row in np.flatnonzero(np.isin(samples.kinds, (BRAKING, ACCELERATION))).tolist():
        egos[samples.recordings[row], samples.actors[row]].append(row)
    found = []
    for row in np.flatnonzero(samples.kinds == kind).tolist():
        candidates = egos[samples.recordings[row], samples.others[row]]
        lags = {other: abs(samples.times[other] - samples.times[row]) for other in candidates}
        nearest = min(lags, key=lags.__getitem__, default=None)
        if (
            nearest is not None
            and lags[nearest] < MOST_LAG
            and samples.others[nearest] != samples.actors[row]
        ):
            found.append((row, nearest))
    chosen = np.array(found, np.int64).reshape(-1, 2)
    units, own = samples.where(chosen[:, 0]), samples.where(chosen[:, 1])
    behind = own.theta[:, _GAP] + (own.ego_speeds - own.theta[:, _START_SPEED]) * (
        own.times - units.times
    )
    kept = np.flatnonzero(behind > 0.0)
    return Followed(units.where(kept), behind[kept])


def _overlapping(samples: Samples, first: str, second: str) -> IntArray:
    """Rows (n, 2) of units of two actors at a time, around one ego."""
    end = samples.times + samples.theta[:, _DURATION]
    around: dict[tuple[str, str], list[int]] = defaultdict(list)
    for row in np.flatnonzero(samples.kinds == second).tolist():
        around[samples.recordings[row], samples.others[row]].append(row)
    found = []
    for row in np.flatnonzero(samples.kinds == first).tolist():
        recording, actor, ego = samples.recordings[row], samples.actors[row], samples.others[row]
        candidates = around[recording, ego] + (around[recording, actor] if first != second else [])
        found += [
            (row, other)
            for other in candidates
            if samples.actors[other] not in (actor, ego)
            and samples.times[row] < end[other]
            and samples.times[other] < end[row]
        ]
    return np.array(found, np.int64).reshape(-1, 2)


DIGITS = 2
"""Decimal digits of numbers in files: recordings tell centimetres."""
OWN = Path(__file__).with_name("own.parquet")
"""Units of our own recordings of motorways and arterials, by `benchmarks/record.py` and
`benchmarks/reconstruct.py --out`."""

Texts = NDArray[np.str_]
_NAMES = tuple(parameter.name for parameter in PARAMETERS.values())
_TEXTS = {"recordings": "recording", "kinds": "kind", "actors": "actor", "others": "other"}
_TIME, _SPEED, _ERRORS = "time_s", "Ego_Speed_mps", ("RMSE_t_m", "RMSE_s_m")
_NUMBERS = (_TIME, *_NAMES, _SPEED, *_ERRORS)
_JERK = DECLARED[JERK].name
_COLUMNS = (*_TEXTS, "theta", "times", "ego_speeds", "errors", "jerks")
"""Attributes that are arrays with a row for each unit"""
_EXPOSURE = b"exposure"
"""Key of the file's metadata that has the exposure"""


@dataclass(frozen=True, eq=False)
class Samples:
    """Units with their parameters, one a row.

    Attributes:
        theta: the seven in the order of `PARAMETERS` (n, 7).
        recordings, kinds, actors, others: texts (n,); see
            `recognition.labels.maneuvers.parameters.Unit`.
        times: when the manoeuvre begins in the recording, s (n,).
        ego_speeds: initial speed of the other vehicle, m/s (n,).
        errors: lateral and longitudinal root mean square of the reconstruction, m (n, 2).
        jerks: how suddenly the acceleration builds up, m/s³ (n,); NaN where it was not measured.
        exposure: by recording, of those without a unit too; none where it is not known.
    """

    theta: FloatArray
    recordings: Texts
    kinds: Texts
    actors: Texts
    others: Texts
    times: FloatArray
    ego_speeds: FloatArray
    errors: FloatArray
    jerks: FloatArray
    exposure: Mapping[str, Exposure] = field(default_factory=dict)

    def where(self, chosen: IntArray) -> Samples:
        """Return a subset of the units, by index; the exposure stays that of all recordings."""
        return replace(self, **{name: getattr(self, name)[chosen] for name in _COLUMNS})

    def of_kind(self, *kinds: str) -> Samples:
        """Return the samples of some kinds."""
        return self.where(np.flatnonzero(np.isin(self.kinds, kinds)))

    def within(self, low: FloatArray, high: FloatArray) -> Samples:
        """Return the samples inside a box with sides (7,)."""
        return self.where(np.flatnonzero(((self.theta >= low) & (self.theta <= high)).all(axis=1)))

    @classmethod
    def joined(cls, parts: Sequence[Samples]) -> Samples:
        """Several tables as one."""
        columns = {
            name: np.concatenate([getattr(part, name) for part in parts]) for name in _COLUMNS
        }
        return cls(
            **columns,
            exposure={name: exposure for part in parts for name, exposure in part.exposure.items()},
        )

    def write(self, path: str | PathLike[str]) -> None:
        """Write a Parquet file, numbers rounded to `DIGITS`."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        texts = {
            column: pa.array(getattr(self, name).tolist(), pa.string())
            for name, column in _TEXTS.items()
        }
        every = self.times, *self.theta.T, self.ego_speeds, *self.errors.T
        numbers = dict(zip(_NUMBERS, every, strict=True)) | (
            {_JERK: self.jerks} if np.isfinite(self.jerks).any() else {}
        )
        # In the file's metadata: recordings without a unit have exposure too, but no row.
        metadata = {_EXPOSURE: to_bytes(self.exposure)} if self.exposure else None
        table = pa.table(
            texts | {name: np.round(column, DIGITS) for name, column in numbers.items()},
            metadata=metadata,
        )
        with drafted(Path(path)) as draft:
            pq.write_table(table, draft, compression="zstd", compression_level=19)

    @staticmethod
    def claims(path: Path) -> bool:
        """Whether a file is a table of units."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            return path.is_file() and {*_TEXTS.values(), *_NUMBERS} <= set(
                pq.read_schema(path).names
            )
        except (OSError, pa.ArrowException):
            return False

    @classmethod
    def read(cls, path: str | PathLike[str]) -> Samples:
        """Read a Parquet file that `write` wrote; those of before jerk was measured have none.

        Raises:
            InvalidFile: it is no Parquet file, or lacks a column.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            there = set(pq.read_schema(path).names)
            names = *_NUMBERS, *([_JERK] if _JERK in there else [])
            table = read_parquet(path, columns=[*_TEXTS.values(), *names])
            texts = {
                name: np.array(table[column].to_pylist(), np.str_)
                for name, column in _TEXTS.items()
            }
            columns = {name: table[name].to_numpy().astype(np.float64) for name in names}
            exposure = from_bytes((table.schema.metadata or {}).get(_EXPOSURE, b"{}"))
        except (OSError, pa.ArrowException, KeyError, ValueError) as error:
            raise InvalidFile(f"no table of units: {error}", path=path) from None
        theta, errors = (
            np.stack([columns[name] for name in names], axis=1) for names in (_NAMES, _ERRORS)
        )
        jerks = columns.get(_JERK, np.full(len(theta), np.nan))
        times, speeds = columns[_TIME], columns[_SPEED]
        return cls(
            theta=theta,
            times=times,
            ego_speeds=speeds,
            errors=errors,
            jerks=jerks,
            **texts,
            exposure=exposure,
        )


def extract(path: str | PathLike[str], roads: str | PathLike[str]) -> Samples:
    """The units of all recordings in a folder with their parameters.

    Args:
        roads: folder for roads that recordings don't bring with them.

    Raises:
        UsageError: no recording has any.
        InvalidFile: a recording is malformed.
    """
    found = [extract_from(source, roads) for source in open_data(path, roads).sources]
    if not any(len(part.theta) for part in found):
        raise UsageError(
            "no recording has a manoeuvre that the seven parameters describe", path=path
        )
    return Samples.joined(found)


def extract_from(source: Source, roads: str | PathLike[str]) -> Samples:
    """The units of one recording; see `extract`."""
    recording = source.load()
    assert source.report is not None, "the recording has been read"
    motion = lane_motion(prepare(recording, site_of(source, recording, Path(roads)), Rules()))
    every = segment(motion)
    found = [(unit, fitted) for unit in every if (fitted := estimate(motion, unit)) is not None]
    scene, names = motion.scene, np.array(motion.scene.names, np.str_)
    units = [unit for unit, _ in found]
    theta = np.array([fitted.values for _, fitted in found], np.float64).reshape(
        -1, len(PARAMETERS)
    )
    return Samples(
        theta=theta,
        recordings=np.full(len(units), source.name),
        kinds=np.array([unit.kind for unit in units], np.str_),
        actors=names[[unit.actor for unit in units]],
        others=names[[unit.other for unit in units]],
        times=scene.time[[unit.start for unit in units]],
        ego_speeds=np.array([fitted.other_speed for _, fitted in found]),
        jerks=np.array([fitted.jerk for _, fitted in found]),
        errors=np.array(
            [errors(motion, unit, row) for unit, row in zip(units, theta, strict=True)]
        ).reshape(-1, 2),
        exposure={source.name: Exposure.of(motion, every, source.report.quality)},
    )
