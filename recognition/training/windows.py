"""Windows: moments of recordings as an encoder sees them, with their labels, in memory and on disk."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from tokenize import TokenError
from typing import IO, TYPE_CHECKING, Any, NamedTuple, Protocol
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from recognition.grids import Grid, Moments, covered, rasterise
from recognition.labels import Event, Rules, label, passing
from recognition.sites import Site
from recognition.tokens import Tokens, in_parts, tokenise
from recognition.trfe.samples import BACKGROUND
from runner.recording import Recording
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import InvalidFile, UsageError
from schemas.common.storage import drafted, read_parquet, writing

if TYPE_CHECKING:
    import pyarrow as pa

View = Tokens | Grid
Inputs = NDArray[Any]
"""Windows (n, ...) of a view, as an encoder takes them"""


def visible(recording: Recording, moments: Moments, view: View) -> BoolArray:
    """Whether the ego's track covers what a view needs of it about each moment: only such moments can be drawn."""
    times = view.offsets if isinstance(view, Grid) else (-0.5 * view.core, 0.0, 0.5 * view.core)
    return covered(recording, moments, times)


def drawn(recording: Recording, moments: Moments, view: View, site: Site | None) -> Inputs:
    """Windows about visible moments.

    Raises:
        UsageError: a moment is not visible, or the view needs a site.
    """
    if isinstance(view, Grid):
        return rasterise(recording, moments, view, site)
    return tokenise(recording, moments, view, _known(site))


def drawn_in_parts(recording: Recording, moments: Moments, view: View, site: Site | None, size: int) -> Iterator[Inputs]:
    """The same, so many windows at a time: those of a long recording need not be in memory together."""
    if isinstance(view, Grid):
        return (rasterise(recording, moments[start : start + size], view, site) for start in range(0, len(moments), size))
    return in_parts(recording, moments, view, _known(site), size)


def _known(site: Site | None) -> Site:
    if site is None:
        raise UsageError("tokens need the site's road")
    return site


def nothing(view: View) -> Inputs:
    """No windows."""
    return np.zeros((0, *view.shape), np.uint8 if isinstance(view, Grid) else np.float16)


STRIDE = 1.0
"""Time between two moments of one vehicle, s"""
_MANY = 1000


class Moment(NamedTuple):
    """A labelled moment about an ego; the label is a class, or `BACKGROUND`."""

    recording: str
    ego: str
    time: float
    label: int


def events_and_background(recording: Recording, site: Site, name: str, rules: Rules) -> tuple[list[Event], list[Moment]]:
    """The rules' events of a recording; and moments at the stride, of the class that a rule finds there, or of none.

    A rule for something that lasts (cruising, following, circulating) finds few events of it, far apart; at the stride all of it
    counts. Moments less than a window from an event, but not at it, are left out: they are neither one nor the other. So are
    moments on a way through a junction at which no rule finds anything (`recognition.labels.passing`).
    """
    events = label(recording, site, name, rules)
    lasting = label(recording, site, name, replace(rules, spacing=STRIDE, ring_spacing=STRIDE, most_windows=_MANY))
    ways = passing(recording, site, rules)
    times: dict[str, list[tuple[float, int]]] = {}
    for event in (*lasting, *events):
        times.setdefault(event.ego, []).append((event.time, int(event.label)))
    found = []
    for track in recording.tracks.values():
        if track.kind == "vehicle":
            own = times.get(track.name, [])
            labelled = zip(*_labelled(regular(track.columns["time"], rules.window), own, rules.window), strict=True)
            passages = ways.get(track.name, [])
            found += [
                Moment(name, track.name, at, which)
                for at, which in labelled
                if which != BACKGROUND or not any(start <= at <= end for start, end in passages)
            ]
    return events, found


def regular(time: FloatArray, window: float, stride: float = STRIDE) -> FloatArray:
    """Moments of a track at the stride, whose windows it covers, s."""
    return np.arange(time[0] + 0.5 * window, time[-1] - 0.5 * window, stride)


def _labelled(regular: FloatArray, own: Sequence[tuple[float, int]], window: float) -> tuple[list[float], list[int]]:
    """Moments with their labels: of the event nearest within half a stride, or the background, a window away from all."""
    if not own:
        return regular.tolist(), [BACKGROUND] * len(regular)
    times, labels = (np.array(values) for values in zip(*own, strict=True))
    apart = np.abs(regular[:, None] - times)
    nearest = apart.argmin(axis=1) if len(regular) else np.zeros(0, np.int64)
    least = apart.min(axis=1, initial=np.inf)
    chosen = np.where(least <= 0.5 * STRIDE, labels[nearest], BACKGROUND)
    kept = (least <= 0.5 * STRIDE) | (least >= window)
    return regular[kept].tolist(), chosen[kept].tolist()


_KINDS = ((4, np.dtype(np.float16)), (5, np.dtype(np.uint8)))
"""Dimensions and types of tokens and grids"""
_INPUTS, _TABLE = "inputs.npy", "windows.parquet"
_UNREADABLE = (OSError, EOFError, ValueError, TypeError, KeyError, SyntaxError, RecursionError, TokenError, BadZipFile)
"""Exceptions of numpy for a damaged file, whose header is a Python literal or looks like an archive"""


class LabelledMoment(Protocol):
    """Used part of a labelled event, see `recognition.labels`."""

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

        try:
            inputs = np.load(folder / _INPUTS, mmap_mode="r", allow_pickle=False)
            if not isinstance(inputs, np.ndarray):
                raise TypeError(f"{_INPUTS} is an archive, an array is expected")
            table = read_parquet(folder / _TABLE)
            labels, times = (table[name].to_numpy() for name in ("labels", "times"))
            labels, times = labels.astype(np.int64), times.astype(np.float64)
            recordings, egos = (np.array(table[name].to_pylist(), np.str_) for name in ("recordings", "egos"))
        except (*_UNREADABLE, pa.ArrowException) as error:
            raise InvalidFile(f"these are no windows: {error}", path=folder) from None
        if (inputs.ndim, inputs.dtype) not in _KINDS or len(inputs) != len(labels):
            raise InvalidFile(f"{_INPUTS} and {_TABLE} do not belong together", path=folder)
        return Windows(inputs, labels, recordings, egos, times)

    def _table(self) -> pa.Table:
        """All but the inputs."""
        import pyarrow as pa

        names = [field.name for field in fields(self)][1:]
        return pa.table(dict(zip(names, map(pa.array, self.columns[1:]), strict=True)))

    @property
    def columns(self) -> tuple[NDArray[Any], ...]:
        """All arrays, in their order."""
        return self.inputs, self.labels, self.recordings, self.egos, self.times


def windows_of(recording: Recording, events: Sequence[LabelledMoment], view: View, site: Site | None = None) -> Windows:
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


def joined(parts: Sequence[Windows]) -> Windows:
    """Windows of one view, one part after the other."""
    return Windows(*(np.concatenate(columns) for columns in zip(*(part.columns for part in parts), strict=True)))


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
        (folder / _TABLE).unlink(missing_ok=True)
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
            with drafted(folder / _TABLE) as draft:  # last: a folder without it is not of windows
                pq.write_table(pa.concat_tables(tables), draft)
    return count


def _write_header(file: IO[bytes], shape: tuple[int, ...], kind: np.dtype[Any]) -> None:
    """The header of an array; NumPy leaves room in it for any number of rows, so that it can be written over."""
    described = {"descr": np.lib.format.dtype_to_descr(kind), "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, described)
