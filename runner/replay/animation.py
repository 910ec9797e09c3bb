"""Runs as an animated GIF: the view from above in real time, the ego in the middle; of two runs one above the other."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import matplotlib as mpl
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from runner.participants.boxes import box_corners
from runner.replay.scene.roads import Area, Line, marks, surfaces
from runner.replay.scene.scene import extent

if TYPE_CHECKING:
    from runner.interpreter.result import RunResult
    from runner.recording import Track

_SIZE = (720, 320)
"""Size of each run's view, pixels"""
_FINER = 2
"""Frames are drawn so many times larger, and then reduced: smooth edges"""
_PER_SECOND = 10
_WIDTH = 110.0
"""Width of what is seen around the ego, m"""
_ROOM = 20.0
"""Room around everything, m"""
_DASH, _GAP = 3.0, 6.0
"""Lengths of broken lines, m"""
_GROUND, _TEXT, _EGO, _OTHER = "#e4eadf", "#17202b", "#d9480f", "#2458a6"
_KINDS = {"pedestrian": "#7b1fa2", "miscellaneous": "#4a4f57"}
_SURFACES = {"verge": "#cfdcc4", "walk": "#cbc6bd", "shoulder": "#a5acb6", "bike": "#b98f86", "road": "#8b939f"}
_MARKS = {"yellow": "#f0be00", "standard": "#ffffff", "white": "#ffffff"}


class _Shape(NamedTuple):
    """A filled ring or a line (width in m) in the world."""

    points: Line
    colour: str
    width: float | None


class _Camera(NamedTuple):
    """What is seen: the place in the middle (m), and pixels per m."""

    x: float
    y: float
    scale: float

    def pixels(self, points: Line) -> list[tuple[float, float]]:
        """World coordinates in the finer frame."""
        width, height = _SIZE
        x = (points[:, 0] - self.x) * self.scale + width / 2
        y = height / 2 - (points[:, 1] - self.y) * self.scale
        return list(zip((x * _FINER).tolist(), (y * _FINER).tolist(), strict=True))

    def sight(self) -> Area:
        """What is in sight."""
        across, up = (size / (2 * self.scale) for size in _SIZE)
        return Area(self.x - across, self.y - up, self.x + across, self.y + up)


def write_animation(results: Sequence[RunResult], path: Path) -> None:
    """Write a GIF that plays one run or more in real time; the same runs give the same bytes."""
    end = max(result.end_time for result in results)
    views = [_View(result) for result in results]
    times = [number / _PER_SECOND for number in range(math.floor(end * _PER_SECOND + 1e-6) + 1)]
    frames = _frames(views, times)
    first = next(frames)
    first.save(path, "GIF", save_all=True, append_images=frames, duration=1000 // _PER_SECOND, loop=0, optimize=False)


def _frames(views: Sequence[_View], times: Sequence[float]) -> Iterator[Image.Image]:
    """All frames, in the same colours, so that they do not flicker."""
    palette = _palette()
    width, height = _SIZE
    for time in times:
        frame = Image.new("RGB", (width, height * len(views)))
        for number, view in enumerate(views):
            frame.paste(view.draw(time), (0, number * height))
        yield frame.quantize(palette=palette, dither=Image.Dither.NONE)


def _palette() -> Image.Image:
    """The colours used and what lies between each two of them, where edges are smoothed."""
    names = [_GROUND, _TEXT, _EGO, _OTHER, *_KINDS.values(), *_SURFACES.values(), *sorted(set(_MARKS.values()))]
    colours = np.array([[int(name[at : at + 2], 16) for at in (1, 3, 5)] for name in names])
    pairs = [(a, b) for a in range(len(names)) for b in range(a)]
    mixed = [(colours[a] + colours[b]) // 2 for a, b in pairs]
    image = Image.new("P", (1, 1))
    image.putpalette(np.concatenate([colours, mixed])[:256].astype(np.uint8).tobytes())
    return image


class _View:
    """Draws a run's view at any time; while the camera stands, the road is drawn once."""

    def __init__(self, result: RunResult) -> None:
        self._result = result
        recording = result.recording
        self._area = area = extent(recording.tracks.values())
        self._shapes = _shapes(result, area.wider(_WIDTH))
        edges = [(*shape.points.min(axis=0), *shape.points.max(axis=0)) for shape in self._shapes]
        self._edges = np.array(edges).reshape(-1, 4)
        self._ego = recording.tracks.get(result.ego) if result.ego is not None else None
        self._tracks = [track for track in recording.tracks.values() if len(track.columns["time"])]
        self._road: tuple[_Camera, Image.Image] | None = None

    def draw(self, time: float) -> Image.Image:
        """The view at a time (s); after the run's end, that at its end."""
        at = min(time, self._result.end_time)
        camera = self._camera(at)
        if self._road is None or self._road[0] != camera:
            self._road = camera, self._draw_road(camera)
        image = self._road[1].copy()
        canvas = ImageDraw.Draw(image)
        for track in self._tracks:
            _participant(canvas, camera, track, at, self._result.ego)
        canvas.text((12, 8), f"{self._result.name}  {at:.1f} s", fill=_TEXT, font=_font())
        return image.reduce(_FINER)

    def _camera(self, time: float) -> _Camera:
        """Above the ego; above everything while there is none."""
        row = _row(self._ego, time) if self._ego is not None else None
        if self._ego is not None and row is not None:
            x, y = (float(self._ego.columns[axis][row]) for axis in ("x", "y"))
            return _Camera(x, y, _SIZE[0] / _WIDTH)
        west, south, east, north = self._area
        scale = min(_SIZE[0] / (east - west + _ROOM), _SIZE[1] / (north - south + _ROOM), _SIZE[0] / _WIDTH)
        return _Camera((west + east) / 2, (south + north) / 2, scale)

    def _draw_road(self, camera: _Camera) -> Image.Image:
        image = Image.new("RGB", (_SIZE[0] * _FINER, _SIZE[1] * _FINER), _GROUND)
        canvas = ImageDraw.Draw(image)
        west, south, east, north = camera.sight()
        seen = (
            (self._edges[:, 0] <= east)
            & (self._edges[:, 2] >= west)
            & (self._edges[:, 1] <= north)
            & (self._edges[:, 3] >= south)
        )
        for index in np.flatnonzero(seen).tolist():
            _paint(canvas, camera, self._shapes[index])
        return image


def _shapes(result: RunResult, area: Area) -> list[_Shape]:
    """Surfaces and marks in the order in which they are drawn."""
    network = result.recording.network
    if network is None:
        return []
    rings = surfaces(network, area)
    shapes = [_Shape(ring, colour, None) for look, colour in _SURFACES.items() for ring in rings.get(look, ())]
    for look, lines in marks(network, area).items():
        pieces = lines if look.pattern in ("solid", "unmarked") else [dash for line in lines for dash in dashes(line)]
        colour = _MARKS.get(look.colour, "#ffffff") if look.pattern != "unmarked" else _SURFACES["shoulder"]
        shapes += [_Shape(piece, colour, look.width) for piece in pieces]
    return shapes


def dashes(line: Line) -> list[Line]:
    """The dashes of a broken line, rows x, y (m)."""
    lengths = np.hypot(*np.diff(line, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    starts = np.arange(0.0, along[-1], _DASH + _GAP)
    ends = np.minimum(starts + _DASH, along[-1])
    places = np.stack([starts, ends], axis=1)
    return list(np.stack([np.interp(places, along, line[:, axis]) for axis in (0, 1)], axis=2))


def _paint(canvas: ImageDraw.ImageDraw, camera: _Camera, shape: _Shape) -> None:
    points = camera.pixels(shape.points)
    if shape.width is None:
        canvas.polygon(points, fill=shape.colour)
    else:
        canvas.line(points, fill=shape.colour, width=max(_FINER, round(shape.width * camera.scale * _FINER)))


def _participant(canvas: ImageDraw.ImageDraw, camera: _Camera, track: Track, time: float, ego: str | None) -> None:
    row = _row(track, time)
    if row is None:
        return
    x, y, h = (float(track.columns[name][row]) for name in ("x", "y", "h"))
    corners = np.array(box_corners(x, y, h, track.box))
    colour = _EGO if track.name == ego else _KINDS.get(track.kind, _OTHER)
    points = camera.pixels(corners)
    canvas.polygon(points, fill=colour, outline=_TEXT)
    if track.kind == "vehicle":  # the front, where its windscreen is
        left, right = corners[0] + 0.25 * (corners[1] - corners[0]), corners[3] + 0.25 * (corners[2] - corners[3])
        canvas.line(camera.pixels(np.array([left, right])), fill=_TEXT, width=_FINER * 2)


def _row(track: Track, time: float) -> int | None:
    """The row of a track at a time; None while it is absent."""
    times = track.columns["time"]
    row = int(np.searchsorted(times, time + 1e-6, side="right")) - 1
    return row if row >= 0 and time - times[row] < 1.0 / _PER_SECOND else None


@cache
def _font() -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(str(Path(mpl.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"), 13 * _FINER)
