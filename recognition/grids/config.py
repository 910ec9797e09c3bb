"""What the occupancy grids look like: their geometry, channels, times and frame of reference."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from schemas.errors import UsageError

Channel = Literal["others", "ego", "speed", "velocity_x", "velocity_y", "area", "borders"]
"""Name of a channel; `CHANNELS` says what each holds."""
CHANNELS: tuple[Channel, ...] = ("others", "ego", "speed", "velocity_x", "velocity_y", "area", "borders")
"""Channels by name:

- `others`, `ego`: the share of each cell that boxes cover, 0 to 255;
- `speed`: the ego's speed, v / `VELOCITY_STEP`, from 1 to 255, in the cells that its box touches;
- `velocity_x`, `velocity_y`: velocity of others relative to the ego's, in the axes of the grid: 128 + v / `VELOCITY_STEP`,
  from 1 to 255; 0 where no one is;
- `area`: the share of each cell that is drivable lane; `borders`: the same of the lanes' borders, drawn as lines.
"""
ROAD_CHANNELS = ("area", "borders")
VELOCITY_STEP = 0.25
"""m/s for each step of the code of a velocity: speeds up to 63.75 m/s differ in it, velocities up to ±31.75 m/s."""


@dataclass(frozen=True)
class Grid:
    """Grids about an ego vehicle: cells along its heading (columns, rear to front) and across (rows, left to right).

    Attributes:
        length, width: extent along and across the heading, m.
        cell_length, cell_width: size of a cell, m.
        ahead: distance of the grid's centre in front of the centre of the ego's box, m.
        channels: some of `CHANNELS`, in any order.
        pose: what the grids are aligned to: the ego in each `frame`, so that the motion of others relative to it shows, and its
            own on the road; or the ego at the centre of the `window`, for all frames.
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
                raise UsageError(f"{name} of a grid must be a positive length, not {getattr(self, name)}")
        if not set(self.channels) <= set(CHANNELS) or len(set(self.channels)) < max(len(self.channels), 1):
            raise UsageError(f"channels of a grid are different ones of {', '.join(CHANNELS)}, not {self.channels}")
        if self.pose not in ("window", "frame"):
            raise UsageError(f"a grid is aligned to the window or the frame, not {self.pose!r}")
        if self.frames < 2 or not 0.0 < self.span < math.inf:
            raise UsageError("a grid needs two or more frames over a positive time")

    @property
    def cells(self) -> tuple[int, int]:
        """Number of rows (across) and columns (along)."""
        return math.ceil(self.width / self.cell_width - 1e-9), math.ceil(self.length / self.cell_length - 1e-9)

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Shape of one window: frames, channels, rows, columns."""
        return (self.frames, len(self.channels), *self.cells)

    @property
    def offsets(self) -> tuple[float, ...]:
        """Times of the frames relative to the event's, s."""
        return tuple(self.span * (k / (self.frames - 1) - 0.5) for k in range(self.frames))
