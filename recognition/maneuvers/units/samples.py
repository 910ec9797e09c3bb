"""Parameters that were extracted from recordings, as a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recognition.maneuvers.parameters import DECLARED, JERK, PARAMETERS
from recognition.maneuvers.units.exposure import Exposure, from_bytes, to_bytes
from schemas.errors import InvalidFile
from xodr.array_types import FloatArray, IntArray

DIGITS = 2
"""Decimal digits of numbers in files: recordings tell centimetres."""
OWN = Path(__file__).with_name("own.parquet")
"""Units of our own recordings of motorways and arterials, by `benchmarks/record.py` and `benchmarks/reconstruct.py --out`."""

Texts = NDArray[np.str_]
_NAMES = tuple(each.name for each in PARAMETERS.values())
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
        recordings, kinds, actors, others: texts (n,); see `recognition.maneuvers.units.Unit`.
        times: when the manoeuvre begins in the recording, s (n,).
        ego_speeds: of the one who is not the actor, when the manoeuvre begins, m/s (n,).
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
        """Some of them, by index; the exposure stays that of all recordings."""
        return replace(self, **{name: getattr(self, name)[chosen] for name in _COLUMNS})

    def of_kind(self, *kinds: str) -> Samples:
        """Those of some kinds."""
        return self.where(np.flatnonzero(np.isin(self.kinds, kinds)))

    def within(self, low: FloatArray, high: FloatArray) -> Samples:
        """Those inside a box with sides (7,)."""
        return self.where(np.flatnonzero(((self.theta >= low) & (self.theta <= high)).all(axis=1)))

    @classmethod
    def joined(cls, parts: Sequence[Samples]) -> Samples:
        """Several tables as one."""
        columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in _COLUMNS}
        return cls(**columns, exposure={name: each for part in parts for name, each in part.exposure.items()})

    def write(self, path: str | PathLike[str]) -> None:
        """Write a Parquet file, numbers rounded to `DIGITS`."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        texts = {column: pa.array(getattr(self, name).tolist(), pa.string()) for name, column in _TEXTS.items()}
        every = self.times, *self.theta.T, self.ego_speeds, *self.errors.T
        numbers = dict(zip(_NUMBERS, every, strict=True)) | ({_JERK: self.jerks} if np.isfinite(self.jerks).any() else {})
        metadata = {_EXPOSURE: to_bytes(self.exposure)} if self.exposure else None
        table = pa.table(texts | {name: np.round(each, DIGITS) for name, each in numbers.items()}, metadata=metadata)
        pq.write_table(table, path, compression="zstd", compression_level=19)

    @staticmethod
    def claims(path: Path) -> bool:
        """Whether a file is a table of units."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            return path.is_file() and {*_TEXTS.values(), *_NUMBERS} <= set(pq.read_schema(path).names)
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
            table = pq.read_table(path, columns=[*_TEXTS.values(), *names])
            texts = {name: np.array(table[column].to_pylist(), np.str_) for name, column in _TEXTS.items()}
            columns = {name: table[name].to_numpy().astype(np.float64) for name in names}
            exposure = from_bytes((table.schema.metadata or {}).get(_EXPOSURE, b"{}"))
        except (OSError, pa.ArrowException, KeyError, ValueError) as error:
            raise InvalidFile(f"no table of units: {error}", path=path) from None
        theta, errors = (np.stack([columns[name] for name in names], axis=1) for names in (_NAMES, _ERRORS))
        jerks = columns.get(_JERK, np.full(len(theta), np.nan))
        times, speeds = columns[_TIME], columns[_SPEED]
        return cls(theta=theta, times=times, ego_speeds=speeds, errors=errors, jerks=jerks, **texts, exposure=exposure)
