"""Draws what is about the egos into grids: boxes by points spread over them, roads by looking them up in a picture."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from recognition.grids.config import ROAD_CHANNELS, VELOCITY_STEP, Channel, Grid
from recognition.grids.frames import Frames, Moments, ego_rows, frames_of
from recognition.grids.roads import cell_centres, picture
from runner.recording import Recording
from schemas.errors import UsageError
from xodr.array_types import BoolArray, FloatArray, IntArray
from xodr.network import RoadNetwork

_BATCH = 256
"""Windows drawn at once: their sums of area stay within tens of MB."""
_POINTS = 2.0
"""Points on a box along the shorter edge of a cell, in each direction."""


class Site(Protocol):
    """Where a recording was made: all that the grids need of it is its road network."""

    @property
    def network(self) -> RoadNetwork:
        """Its roads."""
        ...


class Boxes(NamedTuple):
    """Boxes in the axes of the grids: in which frame of the batch (`frame`), and which row of the recording (`row`) each is.

    x, y: centre ahead and to the left of the ego, m; cos, sin: of the heading relative to the grid's; own: whether it is the ego.
    """

    frame: IntArray
    row: IntArray
    x: FloatArray
    y: FloatArray
    cos: FloatArray
    sin: FloatArray
    own: BoolArray


def rasterise(recording: Recording, moments: Moments, grid: Grid, site: Site | None = None) -> NDArray[np.uint8]:
    """Grids about egos, from the frames nearest to the requested times, without interpolation.

    Args:
        moments: name of the ego's track and time at the window's centre (s) of each window.
        site: the road, for channels that show it.

    Returns:
        uint8 (n, frames, channels, rows, columns), see `Grid`.

    Raises:
        UsageError: a moment names no track, or a time that the ego's track does not cover (see `covered`), or there is no
            site although a channel shows the road.
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
        raise UsageError(f"the track of {ego!r} does not cover the {grid.span:g} s about {time:g} s")
    poses = np.repeat(rows[:, -1:], grid.frames, axis=1) if grid.pose == "window" else rows[:, :-1]
    order = np.argsort(rows[:, -1], kind="stable")  # neighbours in time lie near to each other in memory
    for first, last in pairwise([*range(0, len(moments), _BATCH), len(moments)]):
        chosen = order[first:last]
        drawn = _vehicles(frames, rows[chosen, :-1].ravel(), poses[chosen].ravel(), grid)
        if shows_road and site is not None:
            drawn |= _roads(frames, poses[chosen], grid, site.network)
        for channel, values in drawn.items():
            grids[chosen, :, grid.channels.index(channel)] = values.reshape(len(chosen), -1, *grid.cells)
    return grids


def _vehicles(frames: Frames, egos: IntArray, poses: IntArray, grid: Grid) -> dict[Channel, NDArray[np.uint8]]:
    """The channels that show boxes: (frames of the batch, cells) each."""
    boxes = _about(frames, egos, poses, grid)
    box, cell, area = _points(frames, boxes, grid)
    count = grid.cells[0] * grid.cells[1]
    place = boxes.frame[box] * count + cell
    shape = (len(egos), count)
    own = boxes.own[box]
    drawn: dict[Channel, NDArray[np.uint8]] = {}
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
    """Everyone who is in the frames of the egos' rows and within reach of the grids at the given poses."""
    start, end = frames.starts[frames.frame[egos]], frames.starts[frames.frame[egos] + 1]
    frame = np.repeat(np.arange(len(egos)), end - start)
    row = np.arange(len(frame)) + np.repeat(start - np.concatenate([[0], np.cumsum(end - start)[:-1]]), end - start)
    pose = poses[frame]
    dx, dy = frames.x[row] - frames.x[pose], frames.y[row] - frames.y[pose]
    cos, sin = np.cos(frames.h[pose]), np.sin(frames.h[pose])
    x, y = dx * cos + dy * sin, dy * cos - dx * sin
    radius = 0.5 * np.hypot(frames.length[row], frames.width[row])
    near = (np.abs(x - grid.ahead) < 0.5 * grid.length + radius) & (np.abs(y) < 0.5 * grid.width + radius)
    frame, row, x, y = frame[near], row[near], x[near], y[near]
    turn = frames.h[row] - frames.h[pose[near]]
    return Boxes(frame, row, x, y, np.cos(turn), np.sin(turn), frames.track[row] == frames.track[egos[frame]])


def _points(frames: Frames, boxes: Boxes, grid: Grid) -> tuple[IntArray, IntArray, FloatArray]:
    """Points spread evenly over the boxes: the box and the cell of each that lies in the grid; and the area (m²) that each
    point of a box stands for."""
    length, width = frames.length[boxes.row], frames.width[boxes.row]
    spacing = min(grid.cell_length, grid.cell_width) / _POINTS
    along, across = (np.maximum(np.ceil(size / spacing), 1.0) for size in (length, width))
    counts, kind = np.unique(np.stack([along, across]).astype(np.int64), axis=1, return_inverse=True)
    found = [(np.zeros(0, np.int64), np.zeros(0, np.int64))]
    for number, (many, more) in enumerate(counts.T.tolist()):
        found.append(_lattice(boxes, np.flatnonzero(kind == number), length, width, many, more, grid))
    box, cell = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return box, cell, length * width / (along * across)


def _lattice(
    boxes: Boxes, mine: IntArray, length: FloatArray, width: FloatArray, along: int, across: int, grid: Grid
) -> tuple[IntArray, IntArray]:
    """Box and cell of the points of those boxes that have as many of them."""
    x, y, cos, sin, long, wide = (
        values[mine, None, None].astype(np.float32) for values in (boxes.x, boxes.y, boxes.cos, boxes.sin, length, width)
    )
    ahead = long * ((np.arange(along, dtype=np.float32)[:, None] + 0.5) / along - 0.5)
    aside = wide * ((np.arange(across, dtype=np.float32) + 0.5) / across - 0.5)
    column = np.floor((x - grid.ahead + 0.5 * grid.length + ahead * cos - aside * sin) / grid.cell_length)
    row = np.floor((0.5 * grid.width - y - ahead * sin - aside * cos) / grid.cell_width)
    rows, columns = grid.cells
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    return np.repeat(mine, inside.sum(axis=(1, 2))), (row[inside] * columns + column[inside]).astype(np.int64)


def _motion(frames: Frames, boxes: Boxes, egos: IntArray, poses: IntArray) -> dict[Channel, NDArray[np.uint8]]:
    """Codes of the boxes' speeds, and of their velocities relative to the ego's."""
    ego, h = egos[boxes.frame], frames.h[poses[boxes.frame]]
    vx, vy = frames.vx[boxes.row], frames.vy[boxes.row]
    dx, dy, cos, sin = vx - frames.vx[ego], vy - frames.vy[ego], np.cos(h), np.sin(h)
    along, left, speed = dx * cos + dy * sin, dy * cos - dx * sin, np.hypot(vx, vy)
    return {"speed": _code(speed, 0.0), "velocity_x": _code(along, 128.0), "velocity_y": _code(left, 128.0)}


def _code(velocity: FloatArray, zero: float) -> NDArray[np.uint8]:
    return np.clip(np.rint(velocity / VELOCITY_STEP) + zero, 1, 255).astype(np.uint8)


def _roads(frames: Frames, poses: IntArray, grid: Grid, network: RoadNetwork) -> dict[Channel, NDArray[np.uint8]]:
    """The channels that show the road, as seen from each pose: (frames of the batch, rows, columns) each."""
    distinct = 1 if grid.pose == "window" else grid.frames
    seen = poses[:, :distinct].ravel()
    road = picture(network, min(grid.cell_length, grid.cell_width))
    cos, sin = (turn(frames.h[seen])[:, None, None].astype(np.float32) for turn in (np.cos, np.sin))
    ahead, aside = cell_centres(grid)
    x = (frames.x[seen] - road.x)[:, None, None].astype(np.float32) + ahead * cos - aside * sin
    y = (frames.y[seen] - road.y)[:, None, None].astype(np.float32) + ahead * sin + aside * cos
    planes = np.repeat(road.at(x, y), grid.frames // distinct, axis=0)
    return {channel: planes[..., plane] for plane, channel in enumerate(ROAD_CHANNELS) if channel in grid.channels}
