"""Windows about events, with their labels, as arrays that can be larger than memory."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from recognition.sites import Site
from recognition.training.views import Inputs, View, drawn, visible
from runner.recording import Recording
from schemas.errors import InvalidFile, UsageError
from schemas.storage import writing
from xodr.array_types import FloatArray, IntArray

if TYPE_CHECKING:
    import pyarrow as pa

_KINDS = ((4, np.dtype(np.float16)), (5, np.dtype(np.uint8)))
"""Dimensions and types of tokens and grids"""
_INPUTS, _TABLE = "inputs.npy", "windows.parquet"


class Event(Protocol):
    """What a window needs of a labelled event, see `recognition.labels`."""

    @property
    def recording(self) -> str: ...
    @property
    def ego(self) -> str: ...
    @property
    def time(self) -> float: ...
    @property
    def label(self) -> int: ...


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows in the order of their events.

    Attributes:
        inputs: (n, ...) as a view makes them: tokens, or grids; may be mapped from a file.
        labels: int64 (n,), 0 without a label.
        recordings, egos: names, str (n,). times: s, float (n,).
    """

    inputs: Inputs
    labels: IntArray
    recordings: NDArray[np.str_]
    egos: NDArray[np.str_]
    times: FloatArray

    def __post_init__(self) -> None:
        if len({len(column) for column in self.columns}) > 1:
            raise UsageError("the columns of windows must be equally long")

    def __len__(self) -> int:
        return len(self.labels)

    def select(self, chosen: NDArray[Any] | Sequence[int] | slice) -> Windows:
        """The windows of an index, mask or slice. Their inputs are copied into memory, but for slices."""
        return Windows(*(column[chosen] for column in self.columns))

    def save(self, folder: Path) -> None:
        """Write `inputs.npy` and `windows.parquet` into a folder.

        Raises:
            UsageError: the folder can't be written.
        """
        store([self], folder)

    @staticmethod
    def load(folder: Path) -> Windows:
        """Read what `save` wrote; the inputs stay in their file until they are asked for.

        Raises:
            InvalidFile: the files are missing, truncated, or not windows.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            inputs = np.load(folder / _INPUTS, mmap_mode="r", allow_pickle=False)
            table = pq.read_table(folder / _TABLE)
            labels, times = (table[name].to_numpy() for name in ("labels", "times"))
            recordings, egos = (np.array(table[name].to_pylist(), np.str_) for name in ("recordings", "egos"))
        except (OSError, ValueError, KeyError, pa.ArrowException) as error:
            raise InvalidFile(f"these are no windows: {error}", path=folder) from None
        if (inputs.ndim, inputs.dtype) not in _KINDS or len(inputs) != len(labels):
            raise InvalidFile(f"{_INPUTS} and {_TABLE} do not belong together", path=folder)
        return Windows(inputs, labels.astype(np.int64), recordings, egos, times.astype(np.float64))

    def _table(self) -> pa.Table:
        """All but the inputs."""
        import pyarrow as pa

        names = [field.name for field in fields(self)][1:]
        return pa.table(dict(zip(names, map(pa.array, self.columns[1:]), strict=True)))

    @property
    def columns(self) -> tuple[NDArray[Any], ...]:
        """All arrays, in their order."""
        return self.inputs, self.labels, self.recordings, self.egos, self.times


def windows_of(recording: Recording, events: Sequence[Event], view: View, site: Site | None = None) -> Windows:
    """The windows about the events of one recording.

    Events whose window reaches beyond the ego's track have none: `len` gives the number of windows.
    """
    inside = visible(recording, [(event.ego, event.time) for event in events], view)
    kept = [event for event, usable in zip(events, inside, strict=True) if usable]
    return Windows(
        drawn(recording, [(event.ego, event.time) for event in kept], view, site),
        np.array([int(event.label) for event in kept], np.int64),
        np.array([event.recording for event in kept], np.str_),
        np.array([event.ego for event in kept], np.str_),
        np.array([event.time for event in kept], np.float64),
    )


def store(parts: Iterable[Windows], folder: Path) -> int:
    """Write windows of several recordings one after the other into a folder, without holding all of them in memory.

    Args:
        parts: windows of one view.

    Returns:
        How many there are.

    Raises:
        UsageError: the folder can't be written, or windows are of different views.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    tables: list[pa.Table] = []
    shape: tuple[int, ...] = (0,)
    kind: np.dtype[Any] = np.dtype(np.float16)
    with writing("the windows", folder):
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / _INPUTS).open("wb") as file:
            for part in parts:
                if not tables:
                    shape, kind = part.inputs.shape[1:], part.inputs.dtype
                    _write_header(file, (0, *shape), kind)
                if part.inputs.shape[1:] != shape or part.inputs.dtype != kind:
                    raise UsageError(f"windows of shape {part.inputs.shape[1:]} do not fit after those of {shape}")
                file.write(np.ascontiguousarray(part.inputs).tobytes())
                tables.append(part._table())
            count = sum(map(len, tables))
            file.seek(0)
            _write_header(file, (count, *shape), kind)
        if tables:
            pq.write_table(pa.concat_tables(tables), folder / _TABLE)  # last: a folder without it is not of windows
    return count


def _write_header(file: IO[bytes], shape: tuple[int, ...], kind: np.dtype[Any]) -> None:
    """The header of an array; NumPy leaves room in it for any number of rows, so that it can be written over."""
    described = {"descr": np.lib.format.dtype_to_descr(kind), "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, described)
