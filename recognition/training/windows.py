"""Windows: grids about events, with their labels, as arrays that can be larger than memory."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from recognition.grids import Grid, Site, covered, rasterise
from runner.recording import Recording
from schemas.errors import InvalidFile, UsageError
from schemas.storage import writing
from xodr.array_types import FloatArray, IntArray

if TYPE_CHECKING:
    import pyarrow as pa

_GRIDS, _TABLE = "grids.npy", "windows.parquet"


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
        grids: uint8 (n, frames, channels, rows, columns), see `recognition.grids.Grid`; may be mapped from a file.
        labels: int64 (n,), 0 without a label.
        recordings, egos: names, str (n,). times: s, float (n,).
    """

    grids: NDArray[np.uint8]
    labels: IntArray
    recordings: NDArray[np.str_]
    egos: NDArray[np.str_]
    times: FloatArray

    def __post_init__(self) -> None:
        if len({len(column) for column in self._columns()}) > 1:
            raise UsageError("the columns of windows must be equally long")

    def __len__(self) -> int:
        return len(self.labels)

    def select(self, chosen: NDArray[Any] | Sequence[int] | slice) -> Windows:
        """The windows of an index, mask or slice. Their grids are copied into memory, but for slices."""
        return Windows(*(column[chosen] for column in self._columns()))

    def save(self, folder: Path) -> None:
        """Write `grids.npy` and `windows.parquet` into a folder.

        Raises:
            UsageError: the folder can't be written.
        """
        store([self], self.grids.shape, folder)

    @staticmethod
    def load(folder: Path) -> Windows:
        """Read what `save` wrote; the grids stay in their file until they are asked for.

        Raises:
            InvalidFile: the files are missing, truncated, or not windows.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            grids = np.load(folder / _GRIDS, mmap_mode="r", allow_pickle=False)
            table = pq.read_table(folder / _TABLE)
            labels, times = (table[name].to_numpy() for name in ("labels", "times"))
            recordings, egos = (np.array(table[name].to_pylist(), np.str_) for name in ("recordings", "egos"))
        except (OSError, ValueError, KeyError, pa.ArrowException) as error:
            raise InvalidFile(f"these are no windows: {error}", path=folder) from None
        if grids.ndim != 5 or grids.dtype != np.uint8 or len(grids) != len(labels):
            raise InvalidFile(f"{_GRIDS} and {_TABLE} do not belong together", path=folder)
        return Windows(grids, labels.astype(np.int64), recordings, egos, times.astype(np.float64))

    def _table(self) -> pa.Table:
        """All but the grids."""
        import pyarrow as pa

        names = [field.name for field in fields(self)][1:]
        return pa.table(dict(zip(names, map(pa.array, self._columns()[1:]), strict=True)))

    def _columns(self) -> tuple[NDArray[Any], ...]:
        return self.grids, self.labels, self.recordings, self.egos, self.times


def windows_of(recording: Recording, events: Sequence[Event], grid: Grid, site: Site | None = None) -> Windows:
    """The windows about the events of one recording.

    Events whose window reaches beyond the ego's track have none: `len` gives the number of windows.
    """
    inside = covered(recording, [(event.ego, event.time) for event in events], grid)
    kept = [event for event, usable in zip(events, inside, strict=True) if usable]
    return Windows(
        rasterise(recording, [(event.ego, event.time) for event in kept], grid, site),
        np.array([int(event.label) for event in kept], np.int64),
        np.array([event.recording for event in kept], np.str_),
        np.array([event.ego for event in kept], np.str_),
        np.array([event.time for event in kept], np.float64),
    )


def store(parts: Iterable[Windows], shape: tuple[int, ...], folder: Path) -> None:
    """Write windows of several recordings one after the other into a folder, without holding all of them in memory.

    Args:
        parts: windows of one grid.
        shape: of the grids of all of them together.

    Raises:
        UsageError: the folder can't be written, or there are more or fewer windows, or some of another grid.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    tables, filled = [], 0
    with writing("the windows", folder):
        folder.mkdir(parents=True, exist_ok=True)
        grids = np.lib.format.open_memmap(folder / _GRIDS, "w+", np.uint8, shape)
        for part in parts:
            if part.grids.shape[1:] != shape[1:] or filled + len(part) > len(grids):
                raise UsageError(f"{len(part)} windows of shape {part.grids.shape[1:]} do not fit after {filled} of {shape}")
            grids[filled : filled + len(part)] = part.grids
            filled += len(part)
            tables.append(part._table())
        if filled != len(grids):
            raise UsageError(f"there are {filled} windows, not {len(grids)}")
        grids.flush()
        pq.write_table(pa.concat_tables(tables), folder / _TABLE)  # last: a folder without it is not of windows
