"""Parameters that were extracted from recordings, as a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recognition.maneuvers.parameters import PARAMETERS
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
_COLUMNS = (*_TEXTS, "theta", "times", "ego_speeds", "errors")
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
        numbers = (np.round(each, DIGITS) for each in (self.times, *self.theta.T, self.ego_speeds, *self.errors.T))
        metadata = {_EXPOSURE: to_bytes(self.exposure)} if self.exposure else None
        table = pa.table(texts | dict(zip(_NUMBERS, numbers, strict=True)), metadata=metadata)
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
        """Read a Parquet file that `write` wrote.

        Raises:
            InvalidFile: it is no Parquet file, or lacks a column.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            table = pq.read_table(path, columns=[*_TEXTS.values(), *_NUMBERS])
            texts = {name: np.array(table[column].to_pylist(), np.str_) for name, column in _TEXTS.items()}
            columns = {name: table[name].to_numpy().astype(np.float64) for name in _NUMBERS}
            exposure = from_bytes((table.schema.metadata or {}).get(_EXPOSURE, b"{}"))
        except (OSError, pa.ArrowException, KeyError, ValueError) as error:
            raise InvalidFile(f"no table of units: {error}", path=path) from None
        theta, errors = (np.stack([columns[name] for name in names], axis=1) for names in (_NAMES, _ERRORS))
        return cls(theta=theta, times=columns[_TIME], ego_speeds=columns[_SPEED], errors=errors, **texts, exposure=exposure)
