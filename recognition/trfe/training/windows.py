"""Windows of recordings as an encoder sees them, with labels, in memory and on disk; training data
and its splits."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from itertools import compress
from pathlib import Path
from tokenize import TokenError
from typing import IO, TYPE_CHECKING, Any, NamedTuple, Protocol
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from recognition import recordings as datasets
from recognition.labels import JunctionWay, Label, LabelledEvent, Rules, label, passing
from recognition.recordings.table import Kind, column_names, read_table
from recognition.scenes import Site, place, site_of
from recognition.trfe.inputs.grids import Grid, Moments, covered, rasterise
from recognition.trfe.inputs.samples import BACKGROUND, drawn_of_each
from recognition.trfe.inputs.tokens import Tokens, in_parts, tokenise
from recognition.trfe.training import Unit
from runner.recording import Recording
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import InvalidFile, UsageError
from schemas.common.policy import limited
from schemas.common.storage import drafted, read_parquet, writing

if TYPE_CHECKING:
    import pyarrow as pa


View = Tokens | Grid
Inputs = NDArray[Any]
"""Windows (n, ...) of a view, as an encoder takes them"""


def visible(recording: Recording, moments: Moments, view: View) -> BoolArray:
    """Whether the ego's track covers the view about each moment, so that it can be drawn."""
    # Tokens may be absent at the ends of a window; a grid is drawn in every frame.
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


def drawn_in_parts(
    recording: Recording, moments: Moments, view: View, site: Site | None, size: int
) -> Iterator[Inputs]:
    """The same, so many windows at a time: those of a long recording need not be in memory
    together."""
    if isinstance(view, Grid):
        return (
            rasterise(recording, moments[start : start + size], view, site)
            for start in range(0, len(moments), size)
        )
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
_WAITS = 3.0
"""Time (s) from its event in a junction at which a vehicle does nothing there yet, or any more"""


class TrainingMoment(NamedTuple):
    """A labelled moment about an ego; the label is a class, or `BACKGROUND`."""

    recording: str
    ego: str
    time: float
    label: int


def events_and_background(
    recording: Recording, site: Site, name: str, rules: Rules
) -> tuple[list[LabelledEvent], list[TrainingMoment]]:
    """The rules' events of a recording; and moments at the stride, of the class that a rule finds
    there, or of none.

    A rule for something that lasts (cruising, following, circulating) finds few events of it, far
    apart; at the stride all of it counts. Moments less than a window from an event, but not at it,
    are left out: they are neither one nor the other. So are moments on a way through a junction
    (`recognition.labels.passing`), unless it is straight and no vehicle crosses it, or the ego has
    its event there much later or earlier.
    """
    events = label(recording, site, name, rules)
    lasting = label(
        recording,
        site,
        name,
        replace(rules, spacing=STRIDE, ring_spacing=STRIDE, most_windows=_MANY),
    )
    ways = passing(recording, site, rules)
    times: dict[str, list[tuple[float, int]]] = {}
    for event in (*lasting, *events):
        times.setdefault(event.ego, []).append((event.time, int(event.label)))
    found = []
    for track in recording.tracks.values():
        if track.kind == "vehicle":
            own = times.get(track.name, [])
            labelled = zip(
                *_labelled(regular(track.columns["time"], rules.window), own, rules.window),
                strict=True,
            )
            passages = ways.get(track.name, [])
            found += [
                TrainingMoment(name, track.name, at, which)
                for at, which in labelled
                if which != BACKGROUND
                or all(_idle(at, one, own) for one in passages if one.start <= at <= one.end)
            ]
    return events, found


def _idle(at: float, passage: JunctionWay, own: Sequence[tuple[float, int]]) -> bool:
    """Whether nothing happens at a moment on a way through a junction, given times and labels of
    the vehicle's events."""
    there = any(passage.start <= time <= passage.end for time, _ in own)
    return passage.uncrossed or (there and all(abs(time - at) >= _WAITS for time, _ in own))


def regular(time: FloatArray, window: float, stride: float = STRIDE) -> FloatArray:
    """Moments of a track at the stride, whose windows it covers, s."""
    return np.arange(time[0] + 0.5 * window, time[-1] - 0.5 * window, stride)


def _labelled(
    regular: FloatArray, own: Sequence[tuple[float, int]], window: float
) -> tuple[list[float], list[int]]:
    """Moments with their labels: of the event nearest within half a stride, or the background, a
    window away from all."""
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
_UNREADABLE = (
    OSError,
    EOFError,
    ValueError,
    TypeError,
    KeyError,
    SyntaxError,
    RecursionError,
    TokenError,
    BadZipFile,
)
"""Exceptions of numpy for a damaged file, whose header is a Python literal or looks like an archive
"""


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
        """The windows of an index, mask or slice. Their inputs are copied into memory, but for
        slices."""
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
            # No pickles, which run code.
            inputs = np.load(folder / _INPUTS, mmap_mode="r", allow_pickle=False)
            if not isinstance(inputs, np.ndarray):
                raise TypeError(f"{_INPUTS} is an archive, an array is expected")
            table = read_parquet(folder / _TABLE)
            labels, times = (table[name].to_numpy() for name in ("labels", "times"))
            labels, times = labels.astype(np.int64), times.astype(np.float64)
            recordings, egos = (
                np.array(table[name].to_pylist(), np.str_) for name in ("recordings", "egos")
            )
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


def windows_of(
    recording: Recording, events: Sequence[LabelledMoment], view: View, site: Site | None = None
) -> Windows:
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
    return Windows(
        *(
            np.concatenate(columns)
            for columns in zip(*(part.columns for part in parts), strict=True)
        )
    )


def store(parts: Iterable[Windows], folder: Path) -> int:
    """Write windows of several recordings one after the other into a folder, without holding all of
    them in memory.

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
        # First: inputs that are half written must not pass for windows with the table of others.
        (folder / _TABLE).unlink(missing_ok=True)
        with (folder / _INPUTS).open("wb") as file:
            for part in parts:
                if not tables:
                    shape, kind = part.inputs.shape[1:], part.inputs.dtype
                    _write_header(file, (0, *shape), kind)
                if part.inputs.shape[1:] != shape or part.inputs.dtype != kind:
                    raise UsageError(
                        f"windows of shape {part.inputs.shape[1:]} do not fit "
                        f"after those of {shape}"
                    )
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
    """The header of an array; NumPy leaves room in it for any number of rows, so that it can be
    written over."""
    described = {
        "descr": np.lib.format.dtype_to_descr(kind),
        "fortran_order": False,
        "shape": shape,
    }
    np.lib.format.write_array_header_1_0(file, described)


# training data ----------------------------------------------------------------------------------


def windows_at(
    path: Path, cache: Path, view: View, most: int | None, *, background: bool = False
) -> Windows:
    """Windows of a folder that `Windows.save` wrote, or of recordings.

    Args:
        path: folder of windows, or folder or file of recordings.
        cache: folder that keeps windows made of recordings for the next time; roads made for them
            go there too.
        view: of windows that have to be made.
        most: most windows of each class that are made of one recording; None takes all.
        background: whether there are windows at a regular stride too, with those in which nothing
            happens.

    Raises:
        InvalidFile: nothing of a known format.
        UsageError: windows of another shape than the view's, or no event in the recordings.
    """
    if is_windows(path):
        windows = Windows.load(path)
    elif is_windows(cache):
        windows = Windows.load(cache)
    else:
        windows = _made(path, cache, view, most, background)
    if windows.inputs.shape[1:] != view.shape:
        raise UsageError(
            f"windows of shape {windows.inputs.shape[1:]} are not of the shape {view.shape}",
            path=path,
        )
    return windows


def source_of(path: Path) -> str:
    """Short digest of the recordings in a folder, by their names and sizes; `windows` for a folder
    of windows."""
    if is_windows(path):
        return "windows"
    found = [(source.name, source.path.stat().st_size) for source in datasets.open(path).sources]
    return hashlib.sha256(repr(found).encode()).hexdigest()[:16]


def fingerprint(windows: Windows) -> str:
    """Short digest of windows: their labels, recordings, egos and times."""
    digest = hashlib.sha256(repr(windows.inputs.shape).encode())
    for column in (windows.labels, windows.times):
        digest.update(np.ascontiguousarray(column).tobytes())
    for names in (windows.recordings, windows.egos):
        digest.update("\0".join(names.tolist()).encode())
    return digest.hexdigest()[:16]


def is_windows(folder: Path) -> bool:
    """Whether a folder holds windows."""
    return (folder / "windows.parquet").is_file()


def _made(path: Path, cache: Path, view: View, most: int | None, background: bool) -> Windows:
    """Windows of recordings, each read once."""
    roads = cache / "roads"

    def parts() -> Iterator[Windows]:
        for source in datasets.open(path, roads=roads).sources:
            with limited():
                recording = source.load()
                site = site_of(source, recording, roads)
                found = _moments(recording, site, source.name, view, background)
                windows = windows_of(recording, _thinned(found, most), view, site)
            if len(windows):
                yield windows

    if not store(parts(), cache):
        raise UsageError("no rule finds an event in these recordings", path=path)
    return Windows.load(cache)


_APART = 2.0
"""Time (s) within which different judgements on one vehicle contradict each other"""
_RIGHT, _WRONG, _UNCLEAR = "right", "wrong", "unclear"


def judged(tables: Sequence[Path]) -> list[TrainingMoment]:
    """The moments that reviewers judged, by their CSV tables with recording, vehicle, time, class
    and, for findings, verdict.

    A right finding, or an event that a reviewer lists (a row without a verdict), has its class; at
    a wrong one nothing happens. Rows without a class and unclear ones are left out; so are rows on
    one vehicle that contradict each other within 2 s.

    Raises:
        InvalidFile: a table is not readable, or has an unknown class or verdict.
    """
    found = [one for path in tables for one in _judged(path)]
    of_vehicle: dict[tuple[str, str], list[TrainingMoment]] = {}
    for one in found:
        of_vehicle.setdefault((one.recording, one.ego), []).append(one)
    return [
        one
        for one in found
        if all(
            other.label == one.label or abs(other.time - one.time) > _APART
            for other in of_vehicle[one.recording, one.ego]
        )
    ]


def _judged(path: Path) -> Iterator[TrainingMoment]:
    labels = {one.title: int(one) for one in Label if one is not Label.UNKNOWN}
    kinds: dict[str, Kind] = {
        "recording": "text",
        "vehicle": "text",
        "time": "optional",
        "class": "label",
    }
    if "verdict" in column_names(path):
        kinds["verdict"] = "label"
    table = read_table(path, kinds)
    verdicts = table["verdict"] if "verdict" in kinds else [_RIGHT] * len(table)
    for row, (title, at, verdict) in enumerate(
        zip(table["class"], table["time"], verdicts, strict=True)
    ):
        if not title or verdict == _UNCLEAR:
            continue
        if title not in labels:
            raise table.fault(row, "class", f"{title!r} is none of {', '.join(labels)}")
        if verdict not in (_RIGHT, _WRONG):
            raise table.fault(
                row, "verdict", f"{verdict!r} is none of {_RIGHT}, {_WRONG}, {_UNCLEAR}"
            )
        if np.isnan(at):
            raise table.fault(row, "time", "a value is missing")
        which = labels[title] if verdict == _RIGHT else BACKGROUND
        yield TrainingMoment(table["recording"][row], table["vehicle"][row], float(at), which)


def reviewed(
    recordings: Sequence[Path], judgements: Sequence[TrainingMoment], roads: Path, view: View
) -> Windows:
    """Windows at the moments that reviewers judged in recordings.

    Args:
        recordings: folders or files; those without a judgement are not read.
        judgements: as `judged` gives them.
        roads: folder of roads made for the recordings.

    Raises:
        InvalidFile: a recording is not readable.
        UsageError: no verdict is on a vehicle of the recordings.
    """
    parts = list[Windows]()
    for source in (one for path in recordings for one in datasets.open(path, roads=roads).sources):
        own = [one for one in judgements if one.recording == source.name]
        if own:
            with limited():
                recording = source.load()
                site = site_of(source, recording, roads)
                place(recording, site.network)
                parts.append(
                    windows_of(
                        recording, [one for one in own if one.ego in recording.tracks], view, site
                    )
                )
    if not any(map(len, parts)):
        raise UsageError("no verdict is on a vehicle of these recordings", path=recordings[0])
    return joined(parts)


def _moments(
    recording: Recording, site: Site, name: str, view: View, background: bool
) -> list[TrainingMoment]:
    """Events, at junctions with lights too; with `background` also moments at the stride, if the
    track holds the window."""
    rules = Rules(signalised=True)
    if background:
        events, regular = events_and_background(recording, site, name, rules)
    else:
        events, regular = label(recording, site, name, rules), []
    found = [
        *(TrainingMoment(one.recording, one.ego, one.time, int(one.label)) for one in events),
        *regular,
    ]
    return list(compress(found, visible(recording, [(one.ego, one.time) for one in found], view)))


def _thinned(found: Sequence[TrainingMoment], most: int | None) -> list[TrainingMoment]:
    """Draw moments, at most a number of each class; in their order."""
    labels = np.array([one.label for one in found], np.int64)
    return [
        found[number]
        for number in np.sort(drawn_of_each(labels, most, np.random.default_rng(0))).tolist()
    ]


@contextmanager
def seeded(seed: int) -> Iterator[None]:
    """Context manager in which torch is seeded and has one thread: small layers lose more by
    handing out work than more threads bring."""
    import torch  # windows are read where no model is

    threads = torch.get_num_threads()
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        torch.set_num_threads(1)
        try:
            yield
        finally:
            torch.set_num_threads(threads)


SHARES = {"labelled": 0.56, "stream": 0.14, "validation": 0.15, "test": 0.15}
"""The training share of 70 % in two: a fifth of it never gets a label, as the known traffic of
later streams."""


class Split(NamedTuple):
    """Window numbers of each part, ascending.

    Attributes:
        labelled: training windows whose labels may be learnt once their class is known.
        stream: training windows that only ever arrive without a label.
        validation: for calibration and thresholds.
        test: for figures.
        left_out: classes that have not enough units to be in every part, with the number of their
            windows.
    """

    labelled: IntArray
    stream: IntArray
    validation: IntArray
    test: IntArray
    left_out: dict[int, int]


def split(
    windows: Windows, seed: int, unit: Unit = "recording", events_per_class: int | None = None
) -> Split:
    """Divide the windows that have a class.

    Units are dealt by iterative stratification, so that each class has its share in each part.
    Windows of classes that miss a part are left out of all; with `events_per_class` each class is
    thinned to that number.

    Source: Sechidis, Tsoumakas, Vlahavas, On the Stratification of Multi-Label Data, ECML
    PKDD 2011.
    """
    generator = np.random.default_rng(seed)
    labels = windows.labels
    units, classes = _units(windows, unit), np.unique(labels[labels > 0])
    held = np.array(
        [[np.count_nonzero(labels[rows] == label) for label in classes] for rows in units]
    ).reshape(-1, len(classes))
    part = _deal(held, np.array(list(SHARES.values())), generator)
    of_window = np.full(len(labels), -1)
    for rows, chosen in zip(units, part.tolist(), strict=True):
        of_window[rows] = chosen
    present = np.array(
        [
            [((of_window == k) & (labels == label)).any() for k in range(len(SHARES))]
            for label in classes
        ]
    )
    complete = present.all(axis=1)
    kept = np.isin(labels, classes[complete])
    labelled, stream, validation, test = (
        _thinned_rows(
            np.flatnonzero(kept & (of_window == k)), labels, share, events_per_class, generator
        )
        for k, share in enumerate(SHARES.values())
    )
    left_out = {int(label): int(np.count_nonzero(labels == label)) for label in classes[~complete]}
    return Split(labelled, stream, validation, test, left_out)


def _units(windows: Windows, unit: Unit) -> list[IntArray]:
    """Rows of each unit that has a window with a class, in the order of names."""
    names = (
        windows.recordings
        if unit == "recording"
        else np.char.add(np.char.add(windows.recordings, "\0"), windows.egos)
    )
    rows = np.flatnonzero(windows.labels > 0)
    _, number = np.unique(names[rows], return_inverse=True)
    order = np.argsort(number, kind="stable")
    return np.split(rows[order], np.flatnonzero(np.diff(number[order])) + 1) if len(rows) else []


def _deal(held: IntArray, shares: FloatArray, generator: np.random.Generator) -> IntArray:
    """Part of each unit, given its numbers of windows (units, classes).

    The class with the fewest units left is dealt next, its largest unit to a part that has none of
    it, else to the part that lacks most windows of it.
    """
    part = np.full(len(held), -1)
    lacking = shares[:, None] * held.sum(axis=0)
    order = generator.permutation(len(held))
    while (part < 0).any():
        open_ = order[part[order] < 0]
        left = held[open_].sum(axis=0)
        # Classes without a unit left are never the rarest.
        rarest = int(np.where(left > 0, (held[open_] > 0).sum(axis=0), len(held) + 1).argmin())
        having = open_[held[open_, rarest] > 0]
        largest = having[held[having, rarest].argmax()]
        without = np.array([not held[part == k, rarest].any() for k in range(len(shares))])
        # The last key counts first: parts without the class, then its lack, then the lack of all.
        taker = int(np.lexsort((-lacking.sum(axis=1), -lacking[:, rarest], ~without))[0])
        part[largest] = taker
        lacking[taker] -= held[largest]
    return part


def _thinned_rows(
    rows: IntArray, labels: IntArray, share: float, most: int | None, generator: np.random.Generator
) -> IntArray:
    """At most round(share · most) rows of each class, drawn; ascending."""
    if most is None:
        return rows
    return np.sort(rows[drawn_of_each(labels[rows], max(round(share * most), 1), generator)])
