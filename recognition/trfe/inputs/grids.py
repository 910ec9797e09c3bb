"""Occupancy grids about an ego, which encoders of the presets `cpu` and `full` read (METHOD §1)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from recognition.scenes import Site
from runner.recording import Recording
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import UsageError
from xodr.graph.network import RoadNetwork
from xodr.graph.ways import DRIVABLE
from xodr.lookup.arrays import lane_borders
from xodr.model.road import Road

__all__ = [
    "CHANNELS",
    "VELOCITY_STEP",
    "Channel",
    "Grid",
    "Moments",
    "covered",
    "rasterise",
]

Channel = Literal["others", "ego", "speed", "velocity_x", "velocity_y", "area", "borders"]
"""Name of a channel; `CHANNELS` says what each holds."""
CHANNELS: tuple[Channel, ...] = (
    "others",
    "ego",
    "speed",
    "velocity_x",
    "velocity_y",
    "area",
    "borders",
)
"""Channels by name:

- `others`, `ego`: the share of each cell that boxes cover, 0 to 255;
- `speed`: the ego's speed, v / `VELOCITY_STEP`, from 1 to 255, in the cells that its box touches;
- `velocity_x`, `velocity_y`: velocity of others relative to the ego's, in the axes of the grid:
  128 + v / `VELOCITY_STEP`,
  from 1 to 255; 0 where no one is;
- `area`: the share of each cell that is drivable lane; `borders`: the same of the lanes' borders,
  drawn as lines.
"""
ROAD_CHANNELS = ("area", "borders")
VELOCITY_STEP = 0.25
"""m/s for each step of the code of a velocity: speeds up to 63.75 m/s differ in
it, velocities up to ±31.75 m/s.
"""


@dataclass(frozen=True)
class Grid:
    """Grids about an ego vehicle: cells along its heading (columns, rear to
    front) and across (rows, left to right).

    Attributes:
        length, width: extent along and across the heading, m.
        cell_length, cell_width: size of a cell, m.
        ahead: distance of the grid's centre in front of the centre of the ego's box, m.
        channels: some of `CHANNELS`, in any order.
        pose: what the grids are aligned to: the ego in each `frame`, so that the motion of others
            relative to it shows, and its own on the road; or the ego at the centre of the `window`,
            for all frames.
        frames, span: that many frames, uniformly over so many seconds about the event's time.
    """

    length: float = 200.0
    width: float = 32.0
    cell_length: float = 2.0
    cell_width: float = 0.5
    ahead: float = 0.0
    channels: tuple[Channel, ...] = ("others", "speed", "area", "borders")
    pose: Literal["window", "frame"] = "frame"
    frames: int = 4
    span: float = 1.5

    def __post_init__(self) -> None:
        for name in ("length", "width", "cell_length", "cell_width"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise UsageError(
                    f"{name} of a grid must be a positive length, not {getattr(self, name)}"
                )
        if not set(self.channels) <= set(CHANNELS) or len(set(self.channels)) < max(
            len(self.channels), 1
        ):
            raise UsageError(
                f"channels of a grid are different ones of {', '.join(CHANNELS)}, not "
                f"{self.channels}"
            )
        if self.pose not in ("window", "frame"):
            raise UsageError(f"a grid is aligned to the window or the frame, not {self.pose!r}")
        if self.frames < 2 or not 0.0 < self.span < math.inf:
            raise UsageError("a grid needs two or more frames over a positive time")

    @property
    def cells(self) -> tuple[int, int]:
        """Number of rows (across) and columns (along)."""
        # Rounding may put a quotient just above a whole number, which would add an empty row.
        return math.ceil(self.width / self.cell_width - 1e-9), math.ceil(
            self.length / self.cell_length - 1e-9
        )

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Shape of one window: frames, channels, rows, columns."""
        return (self.frames, len(self.channels), *self.cells)

    @property
    def offsets(self) -> tuple[float, ...]:
        """Times of the frames relative to the event's, s."""
        return tuple(self.span * (k / (self.frames - 1) - 0.5) for k in range(self.frames))


Singles = NDArray[np.float32]
_PIXEL = 0.5
"""Edge of a pixel, m."""
_LARGEST = 20_000
"""Most pixels along one edge of a picture: 10 km."""


@dataclass(frozen=True)
class Picture:
    """Drivable area and lane borders of a site: uint8 (rows, columns, 2), of
    which pixel (0, 0) begins at x, y (m).

    A pixel's values are the shares of the cell around it that are area and border, 0 to 255.
    """

    pixels: NDArray[np.uint8]
    x: float
    y: float

    def at(self, x: Singles, y: Singles) -> NDArray[np.uint8]:
        """Both values, in a last axis, of places x, y (m) from the picture's
        beginning; 0 outside of the picture.
        """
        rows, columns, _ = self.pixels.shape
        column, row = (
            np.clip(place * (1.0 / _PIXEL), 0, last - 1).astype(np.int32)
            for place, last in ((x, columns), (y, rows))
        )
        both = self.pixels.reshape(-1, 2).view(np.uint16)[
            row * columns + column
        ]  # one look-up for the two
        return both.view(np.uint8)


@lru_cache(maxsize=8)
def picture(network: RoadNetwork, cell: float) -> Picture:
    """Draw the drivable lanes of a road network, smoothed over the size of a cell (m)."""
    from scipy.ndimage import uniform_filter

    lanes = [lane for road in network.roads.values() for lane in _lanes(road)]
    corners = (
        np.concatenate([line for lane in lanes for line in lane]) if lanes else np.zeros((1, 2))
    )
    margin = (
        2.0 * cell + 2.0 * _PIXEL
    )  # empty, also after smoothing: positions outside are clipped to it
    low, high = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    columns, rows = np.minimum(np.ceil((high - low) / _PIXEL), _LARGEST).astype(int)
    planes = np.zeros((2, rows, columns), np.uint8)
    for inner, outer in lanes:
        # 1.5 points a pixel, so that no pixel between the borders is missed.
        share = np.linspace(0.0, 1.0, 2 + int(1.5 * np.abs(outer - inner).max() / _PIXEL))[
            :, None, None
        ]
        _draw(planes[0], (1.0 - share) * inner + share * outer, low)
        _draw(planes[1], np.stack([inner, outer]), low)
    size = max(1, round(cell / _PIXEL))
    smooth = np.stack([uniform_filter(plane, size, mode="constant") for plane in planes], axis=-1)
    return Picture(smooth, float(low[0]), float(low[1]))


def _lanes(road: Road) -> list[tuple[FloatArray, FloatArray]]:
    """Inner and outer borders of the drivable lanes, at places that are less
    than a pixel apart: (n, 2) each.
    """
    sections = [
        section.lanes[lane_id]
        for section in road.sections
        for lane_id in (*section.left, *section.right)
    ]
    return [
        _refined(inner[:, :2], outer[:, :2])
        for lane, (_, inner, outer) in zip(sections, lane_borders(road, 2.0), strict=True)
        if lane.type in DRIVABLE
    ]


def _refined(inner: FloatArray, outer: FloatArray) -> tuple[FloatArray, FloatArray]:
    steps = [np.hypot(*np.diff(line, axis=0).T) for line in (inner, outer)]
    # As above, 1.5 points a pixel.
    count = 2 + int(1.5 * max(step.sum() for step in steps) / _PIXEL)
    given = np.concatenate([[0.0], np.cumsum(np.maximum(*steps))])
    stations = np.linspace(0.0, given[-1], count)
    first, second = (
        np.stack([np.interp(stations, given, line[:, k]) for k in (0, 1)], axis=1)
        for line in (inner, outer)
    )
    return first, second


def _draw(plane: NDArray[np.uint8], points: FloatArray, low: FloatArray) -> None:
    column, row = (((points[..., k] - low[k]) / _PIXEL).astype(np.int64) for k in (0, 1))
    inside = (row < plane.shape[0]) & (column < plane.shape[1])
    plane[row[inside], column[inside]] = 255


def cell_centres(grid: Grid) -> tuple[Singles, Singles]:
    """Coordinates of the cells' centres, ahead and to the left of the ego (m):
    shape rows × columns each.
    """
    rows, columns = grid.cells
    along = (np.arange(columns) + 0.5) * grid.cell_length - 0.5 * grid.length + grid.ahead
    left = 0.5 * grid.width - (np.arange(rows) + 0.5) * grid.cell_width
    across, ahead = np.meshgrid(left.astype(np.float32), along.astype(np.float32), indexing="ij")
    return ahead, across


Moments = Sequence[tuple[str, float]]
"""Names of ego tracks and times, s."""
_MISSING = 0.25
"""The ego's row nearest to a requested time may be this far from it, s: a few
frames may be missing in its track.
"""
_TIE = 1e-6
"""Of two rows that are equally near in time, within rounding (s), the earlier
counts: so frames stay equally far apart.
"""


@dataclass(frozen=True)
class Frames:
    """All rows of a recording, sorted by frame.

    Attributes:
        x, y, h: centres (m) and headings (rad) of the boxes; vx, vy: velocities, m/s; length,
            width: of the boxes, m.
        time: s. frame, track: numbers of the row's frame and track. starts: first row of each
            frame, and the end.
        names: number of each track by its name. tracks: rows of each track in ascending time, one
            after the other, from `begins[number]` on.
    """

    x: FloatArray
    y: FloatArray
    h: FloatArray
    vx: FloatArray
    vy: FloatArray
    length: FloatArray
    width: FloatArray
    time: FloatArray
    frame: IntArray
    track: IntArray
    starts: IntArray
    names: dict[str, int]
    tracks: IntArray
    begins: IntArray


def frames_of(recording: Recording) -> Frames:
    """Sort the rows of a recording by frame: its timestep is the raster of the times."""
    tracks = list(recording.tracks.values())
    if not tracks:
        raise UsageError("the recording has no tracks")
    counts = [len(track.columns["time"]) for track in tracks]
    time, x, y, h, speed = (
        np.concatenate([track.columns[name] for track in tracks])
        for name in ("time", "x", "y", "h", "speed")
    )
    who = np.repeat(np.arange(len(tracks)), counts)
    frame = np.rint((time - time.min()) / recording.timestep).astype(np.int64)
    order = np.argsort(frame, kind="stable")
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    frame, who = frame[order], np.repeat(np.arange(len(tracks)), counts)[order]
    x, y, h, speed = (
        np.concatenate([track.columns[name] for track in tracks])[order]
        for name in ("x", "y", "h", "speed")
    )
    ahead, left, length, width = np.array(
        [(t.box.x, t.box.y, t.box.length, t.box.width) for t in tracks]
    )[who].T
    cos, sin = np.cos(h), np.sin(h)
    return Frames(
        x=x + ahead * cos - left * sin,
        y=y + ahead * sin + left * cos,
        h=h,
        vx=speed * cos,
        vy=speed * sin,
        length=length,
        width=width,
        time=time[order],
        frame=frame,
        track=who,
        starts=np.searchsorted(frame, np.arange(frame[-1] + 2)),
        names={track.name: number for number, track in enumerate(tracks)},
        tracks=place,
        begins=np.concatenate([[0], np.cumsum(counts)]),
    )


def ego_rows(
    frames: Frames, moments: Moments, offsets: Sequence[float]
) -> tuple[IntArray, BoolArray]:
    """Rows of the egos nearest to the requested times: (n, offsets); and whether
    each moment's are all near enough.

    Raises:
        UsageError: a moment names no track of the recording.
    """
    rows = np.empty((len(moments), len(offsets)), np.int64)
    requested = np.array([time for _, time in moments], float)[:, None] + np.asarray(offsets) - _TIE
    egos = np.array([_number(frames, ego) for ego, _ in moments], np.int64)
    for ego in np.unique(egos):
        mine = egos == ego
        own = frames.tracks[frames.begins[ego] : frames.begins[ego + 1]]
        middles = 0.5 * (frames.time[own[1:]] + frames.time[own[:-1]])
        rows[mine] = own[np.searchsorted(middles, requested[mine])]
    return rows, (np.abs(frames.time[rows] - requested) <= _MISSING).all(axis=1)


def covered(recording: Recording, moments: Moments, offsets: Sequence[float]) -> BoolArray:
    """Whether the ego's track is there at these times (s) about each moment, but
    for gaps of a few frames.
    """
    if not moments:
        return np.zeros(0, bool)
    return ego_rows(frames_of(recording), moments, offsets)[1]


def _number(frames: Frames, ego: str) -> int:
    number = frames.names.get(ego)
    if number is None:
        raise UsageError(f"the recording has no track {ego!r}")
    return number


_BATCH = 256
"""Windows drawn at once: their sums of area stay within tens of MB."""
_POINTS = 2.0
"""Points on a box along the shorter edge of a cell, in each direction."""


class Boxes(NamedTuple):
    """Boxes in the axes of the grids: in which frame of the batch (`frame`), and which row of the
    recording (`row`) each is.

    x, y: centre ahead and to the left of the ego, m; cos, sin: of the heading relative to the
    grid's; own: whether it is the ego.
    """

    frame: IntArray
    row: IntArray
    x: FloatArray
    y: FloatArray
    cos: FloatArray
    sin: FloatArray
    own: BoolArray


def rasterise(
    recording: Recording, moments: Moments, grid: Grid, site: Site | None = None
) -> NDArray[np.uint8]:
    """Grids about egos, from the frames nearest to the requested times, without interpolation.

    Args:
        moments: name of the ego's track and time at the window's centre (s) of each window.
        site: the road, for channels that show it.

    Returns:
        uint8 (n, frames, channels, rows, columns), see `Grid`.

    Raises:
        UsageError: a moment names no track, or a time that the ego's track does not cover (see
            `covered`), or there is no site although a channel shows the road.
    """
    shows_road = bool(set(ROAD_CHANNELS) & set(grid.channels))
    if shows_road and site is None:
        raise UsageError(f"grids with the channels {', '.join(grid.channels)} need the site's road")
    grids = np.zeros((len(moments), *grid.shape), np.uint8)
    if not len(moments):
        return grids
    frames = frames_of(recording)
    rows, complete = ego_rows(frames, moments, (*grid.offsets, 0.0))
    if not complete.all():
        ego, time = moments[int(np.argmin(complete))]
        raise UsageError(
            f"the track of {ego!r} does not cover the {grid.span:g} s about {time:g} s"
        )
    # The last column is the row at the centre of the window, offset 0.
    poses = np.repeat(rows[:, -1:], grid.frames, axis=1) if grid.pose == "window" else rows[:, :-1]
    order = np.argsort(
        rows[:, -1], kind="stable"
    )  # neighbours in time lie near to each other in memory
    for first, last in pairwise([*range(0, len(moments), _BATCH), len(moments)]):
        chosen = order[first:last]
        drawn = _vehicles(frames, rows[chosen, :-1].ravel(), poses[chosen].ravel(), grid)
        if shows_road and site is not None:
            drawn |= _roads(frames, poses[chosen], grid, site.network)
        for channel, values in drawn.items():
            grids[chosen, :, grid.channels.index(channel)] = values.reshape(
                len(chosen), -1, *grid.cells
            )
    return grids


def _vehicles(
    frames: Frames, egos: IntArray, poses: IntArray, grid: Grid
) -> dict[Channel, NDArray[np.uint8]]:
    """The channels that show boxes: (frames of the batch, cells) each."""
    boxes = _about(frames, egos, poses, grid)
    box, cell, area = _points(frames, boxes, grid)
    count = grid.cells[0] * grid.cells[1]
    place = boxes.frame[box] * count + cell
    shape = (len(egos), count)
    own = boxes.own[box]
    drawn: dict[Channel, NDArray[np.uint8]] = {}
    # Code of a cell per m² of it that is covered.
    full = 255.0 / (grid.cell_length * grid.cell_width)
    for covers, mine in (("others", ~own), ("ego", own)):
        if covers in grid.channels:
            sums = np.bincount(place[mine], area[box[mine]] * full, minlength=len(egos) * count)
            drawn[covers] = np.minimum(sums + 0.5, 255.0).astype(np.uint8).reshape(shape)
    for channel, codes in _motion(frames, boxes, egos, poses).items():
        if channel in grid.channels:
            mine = own if channel == "speed" else ~own
            plane = drawn[channel] = np.zeros(shape, np.uint8)
            plane.ravel()[place[mine]] = codes[box[mine]]
    return drawn


def _about(frames: Frames, egos: IntArray, poses: IntArray, grid: Grid) -> Boxes:
    """Participants in the frames of the egos' rows and within reach of the grids
    at the given poses.
    """
    start, end = frames.starts[frames.frame[egos]], frames.starts[frames.frame[egos] + 1]
    frame = np.repeat(np.arange(len(egos)), end - start)
    row = np.arange(len(frame)) + np.repeat(
        start - np.concatenate([[0], np.cumsum(end - start)[:-1]]), end - start
    )
    pose = poses[frame]
    dx, dy = frames.x[row] - frames.x[pose], frames.y[row] - frames.y[pose]
    cos, sin = np.cos(frames.h[pose]), np.sin(frames.h[pose])
    x, y = dx * cos + dy * sin, dy * cos - dx * sin
    # By the circle about the box: a corner may reach into the grid from outside.
    radius = 0.5 * np.hypot(frames.length[row], frames.width[row])
    near = (np.abs(x - grid.ahead) < 0.5 * grid.length + radius) & (
        np.abs(y) < 0.5 * grid.width + radius
    )
    frame, row, x, y = frame[near], row[near], x[near], y[near]
    turn = frames.h[row] - frames.h[pose[near]]
    return Boxes(
        frame, row, x, y, np.cos(turn), np.sin(turn), frames.track[row] == frames.track[egos[frame]]
    )


def _points(frames: Frames, boxes: Boxes, grid: Grid) -> tuple[IntArray, IntArray, FloatArray]:
    """Points spread evenly over the boxes: the box and the cell of each that lies in the grid; and
    the area (m²) that each point of a box stands for."""
    length, width = frames.length[boxes.row], frames.width[boxes.row]
    spacing = min(grid.cell_length, grid.cell_width) / _POINTS
    along, across = (np.maximum(np.ceil(size / spacing), 1.0) for size in (length, width))
    # Boxes with equally many points are drawn together: vehicles have few sizes.
    counts, kind = np.unique(
        np.stack([along, across]).astype(np.int64), axis=1, return_inverse=True
    )
    # Something to join where no box is near.
    found = [(np.zeros(0, np.int64), np.zeros(0, np.int64))]
    for number, (many, more) in enumerate(counts.T.tolist()):
        found.append(
            _lattice(boxes, np.flatnonzero(kind == number), length, width, many, more, grid)
        )
    box, cell = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return box, cell, length * width / (along * across)


def _lattice(
    boxes: Boxes,
    mine: IntArray,
    length: FloatArray,
    width: FloatArray,
    along: int,
    across: int,
    grid: Grid,
) -> tuple[IntArray, IntArray]:
    """Box and cell of the points of those boxes that have as many of them."""
    x, y, cos, sin, long, wide = (
        values[mine, None, None].astype(np.float32)
        for values in (boxes.x, boxes.y, boxes.cos, boxes.sin, length, width)
    )
    ahead = long * ((np.arange(along, dtype=np.float32)[:, None] + 0.5) / along - 0.5)
    aside = wide * ((np.arange(across, dtype=np.float32) + 0.5) / across - 0.5)
    column = np.floor(
        (x - grid.ahead + 0.5 * grid.length + ahead * cos - aside * sin) / grid.cell_length
    )
    row = np.floor((0.5 * grid.width - y - ahead * sin - aside * cos) / grid.cell_width)
    rows, columns = grid.cells
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    return np.repeat(mine, inside.sum(axis=(1, 2))), (
        row[inside] * columns + column[inside]
    ).astype(np.int64)


def _motion(
    frames: Frames, boxes: Boxes, egos: IntArray, poses: IntArray
) -> dict[Channel, NDArray[np.uint8]]:
    """Codes of the boxes' speeds, and of their velocities relative to the ego's."""
    ego, h = egos[boxes.frame], frames.h[poses[boxes.frame]]
    vx, vy = frames.vx[boxes.row], frames.vy[boxes.row]
    dx, dy, cos, sin = vx - frames.vx[ego], vy - frames.vy[ego], np.cos(h), np.sin(h)
    along, left, speed = dx * cos + dy * sin, dy * cos - dx * sin, np.hypot(vx, vy)
    return {
        "speed": _code(speed, 0.0),
        "velocity_x": _code(along, 128.0),
        "velocity_y": _code(left, 128.0),
    }


def _code(velocity: FloatArray, zero: float) -> NDArray[np.uint8]:
    # From 1, as 0 stands for a cell without a box.
    return np.clip(np.rint(velocity / VELOCITY_STEP) + zero, 1, 255).astype(np.uint8)


def _roads(
    frames: Frames, poses: IntArray, grid: Grid, network: RoadNetwork
) -> dict[Channel, NDArray[np.uint8]]:
    """The channels that show the road, as seen from each pose: (frames of the
    batch, rows, columns) each.
    """
    # With one pose for the window all its frames show the same road.
    distinct = 1 if grid.pose == "window" else grid.frames
    seen = poses[:, :distinct].ravel()
    road = picture(network, min(grid.cell_length, grid.cell_width))
    cos, sin = (turn(frames.h[seen])[:, None, None].astype(np.float32) for turn in (np.cos, np.sin))
    ahead, aside = cell_centres(grid)
    x = (frames.x[seen] - road.x)[:, None, None].astype(np.float32) + ahead * cos - aside * sin
    y = (frames.y[seen] - road.y)[:, None, None].astype(np.float32) + ahead * sin + aside * cos
    planes = np.repeat(road.at(x, y), grid.frames // distinct, axis=0)
    return {
        channel: planes[..., plane]
        for plane, channel in enumerate(ROAD_CHANNELS)
        if channel in grid.channels
    }
