"""Test cases of smoothing: hidden rows of recordings, and exact recordings with added noise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from recognition import recordings as datasets
from recognition.recordings.motion.observations import deviation
from recognition.recordings.motion.smoothing import RAW, breaks, centres
from recognition.recordings.rows import Columns, Rows, pieces
from recognition.recordings.source import TrackParticipant
from runner.recording import Track
from schemas.common.array_types import BoolArray, FloatArray

_SHORTEST = 5.0
"""Shortest track (s) that is used."""
_MARGIN = 1.0
"""Time (s) at the ends of a track in which nothing is hidden: what is judged is what lies between
rows."""
_HIDDEN, _SHOWN = (0.2, 1.0), (1.0, 3.0)
"""Shortest and longest stretch (s) that is hidden, and that is shown after it."""
_KINDS = ("vehicle", "pedestrian")
_SITES, _LENGTH = 10, 20.0
"""Sites drawn from a seed, and time (s) that each is recorded for exactly."""
_NOISE = (0.02, 0.25)
"""Least and greatest deviation (m) of the places of a recording, as of the recorder's sensors."""
_TURN = 0.1
"""Noise of headings over that of places, rad/m."""
_LASTING = 0.5
"""Time (s) in which half of the noise fades; the other half is each row's own."""
_ABOUT = 0.2
"""Time (s) to either side over which exact accelerations are differences of speeds, which are
rounded."""


class Tracks(NamedTuple):
    """Tracks as they were recorded; columns as those of recordings, by reference points."""

    rows: Rows
    who: list[TrackParticipant]
    columns: Columns


class States(NamedTuple):
    """Places of the box's centre (m), heading (rad), speed and acceleration
    along it, of each row.
    """

    x: FloatArray
    y: FloatArray
    h: FloatArray
    speed: FloatArray
    acceleration: FloatArray


class Case(NamedTuple):
    """A task of smoothing.

    Attributes:
        tracks: what is shown; rows that are not have values on the straight line between those that
            are.
        unseen: rows that are not shown or jump away (n,).
        off: deviation of the centre of each row as it was recorded, m.
        truth: the values to be found.
        counted: the rows at which it is (n,).
    """

    tracks: Tracks
    unseen: BoolArray
    off: FloatArray
    truth: States
    counted: BoolArray


def drawn(path: Path, most: int, rng: np.random.Generator) -> Iterator[Tracks]:
    """Tracks of a data set, drawn until they have `most` rows, those of a recording together."""
    recordings = [source.load() for source in datasets.open(path).sources]
    found = [
        (number, track)
        for number, each in enumerate(recordings)
        for track in each.tracks.values()
        if _usable(track)
    ]
    order = rng.permutation(len(found))
    before = np.cumsum([0, *(len(found[i][1].columns["time"]) for i in order)])[:-1]
    chosen = {int(i) for i in order[before < most]}
    for number, recording in enumerate(recordings):
        own = [track for i, (of, track) in enumerate(found) if of == number and i in chosen]
        if own:
            yield _joined(own, recording.timestep)


def exact(seed: int, most: int, rng: np.random.Generator) -> Iterator[Tracks]:
    """Tracks of sites of our own, drawn from a seed, which an exact sensor recorded, until they
    have `most` rows."""
    from recognition.recorder.recorder import record_one
    from recognition.recorder.simulation import EXACT
    from recognition.recorder.sites import family

    with TemporaryDirectory(prefix="xosc-smoothing-") as folder:
        for site in family(seed, _SITES).values():
            record_one(replace(site, sensor=EXACT), Path(folder), _LENGTH, seed)
        yield from drawn(Path(folder), most, rng)


def hidden(tracks: Tracks, rng: np.random.Generator) -> Case:
    """Tracks of which stretches are hidden, to be found again from what is
    before and after them.
    """
    rows, who, columns = tracks
    x, y = centres(rows, who, columns)
    astray = breaks(rows, x, y).astray
    unseen = _stretches(rows, rng)
    truth = States(x, y, columns["h"], columns["speed"], columns["acceleration"])
    shown = States(
        *(_between(values, rows, unseen) for values in truth._replace(h=np.unwrap(truth.h)))
    )
    return Case(
        _placed(tracks, shown), unseen | astray, deviation(rows, x, y), truth, unseen & ~astray
    )


def noisy(tracks: Tracks, rng: np.random.Generator) -> Case:
    """Exact tracks with noise on them."""
    rows, who, columns = tracks
    x, y = centres(rows, who, columns)
    reach = max(1, round(_ABOUT / rows.step))
    here = np.arange(len(rows))
    before, after = np.maximum(here - reach, rows.first), np.minimum(here + reach, rows.last)
    change = (columns["speed"][after] - columns["speed"][before]) / (
        rows.time[after] - rows.time[before]
    )
    truth = States(x, y, columns["h"], columns["speed"], change)
    noise = rng.uniform(*_NOISE)
    shown = truth._replace(
        x=x + noise * _lasting(rows, rng),
        y=y + noise * _lasting(rows, rng),
        h=truth.h + _TURN * noise * _lasting(rows, rng),
    )
    everywhere = np.ones(len(rows), bool)
    return Case(
        _placed(tracks, shown), ~everywhere, deviation(rows, shown.x, shown.y), truth, everywhere
    )


def _usable(track: Track) -> bool:
    time = track.columns["time"]
    return track.kind in _KINDS and bool(time[-1] - time[0] >= _SHORTEST)


def _joined(tracks: list[Track], step: float) -> Tracks:
    columns = {
        name: np.concatenate([track.columns[f"raw_{name}"] for track in tracks]) for name in RAW
    }
    time = np.concatenate([track.columns["time"] for track in tracks])
    starts = np.append(0, np.cumsum([len(track.columns["time"]) for track in tracks]))
    numbers = np.arange(len(tracks))
    rows = Rows(
        np.arange(len(time)),
        numbers,
        starts,
        time,
        step,
        *pieces(time, starts, step),
        np.zeros_like(numbers),
    )
    return Tracks(
        rows,
        [TrackParticipant(track.name, track.kind, track.category, track.box) for track in tracks],
        columns,
    )


def _stretches(rows: Rows, rng: np.random.Generator) -> BoolArray:
    unseen = np.zeros(len(rows), bool)
    for start, end in zip(rows.starts[:-1].tolist(), rows.starts[1:].tolist(), strict=True):
        time = rows.time[start:end]
        begin = time[0] + rng.uniform(*_SHOWN)
        while True:
            until = begin + rng.uniform(*_HIDDEN)
            if until > time[-1] - _MARGIN:
                break
            unseen[start:end] |= (time >= begin) & (time < until)
            begin = until + rng.uniform(*_SHOWN)
    return unseen


def _between(values: FloatArray, rows: Rows, unseen: BoolArray) -> FloatArray:
    """Values, and where they are not seen, those on the line between the seen ones of the same
    track."""
    clock = rows.time + rows.each(np.cumsum(np.append(0.0, rows.time[rows.starts[1:-1] - 1])))
    return np.where(unseen, np.interp(clock, clock[~unseen], values[~unseen]), values)


def _lasting(rows: Rows, rng: np.random.Generator) -> FloatArray:
    """Noise of deviation 1 of each row, half of its variance fading from row to row."""
    from scipy.signal import lfilter

    stays = np.exp(-rows.step / _LASTING)
    new = rng.standard_normal(len(rows))
    new[1:] *= np.sqrt(1.0 - stays**2)
    return np.sqrt(0.5) * (lfilter([1.0], [1.0, -stays], new) + rng.standard_normal(len(rows)))


def _placed(tracks: Tracks, shown: States) -> Tracks:
    """Tracks with these states."""
    behind = tracks.rows.each([one.box.x for one in tracks.who])
    x, y = shown.x - behind * np.cos(shown.h), shown.y - behind * np.sin(shown.h)
    columns = {
        "x": x,
        "y": y,
        "h": shown.h,
        "speed": shown.speed,
        "acceleration": shown.acceleration,
    }
    return tracks._replace(columns=columns)
