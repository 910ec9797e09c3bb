"""Runs as pictures: views from above, as PNG stills, animated GIF, or MP4 where ffmpeg is
installed; two runs are stacked."""

from __future__ import annotations

import math
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import matplotlib as mpl
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from runner.engine.participants.boxes import box_corners
from runner.view.replay import account
from runner.view.replay.account import partners
from runner.view.replay.player import extent
from runner.view.replay.scene_roads import Area, Line, marks, surfaces
from schemas.common.errors import UsageError
from schemas.common.storage import drafted, writing

if TYPE_CHECKING:
    from runner.judging.result import RunResult
    from runner.recording import Track

_SIZE = (720, 320)
"""Size of each run's view, pixels"""
_HEAD = 30
"""Height of the strip above it, which has the run's name, the time and the scale, pixels"""
_FINER = 2
"""Frames are drawn so many times larger, and then reduced: smooth edges"""
_WIDTH = 110.0
"""Width of what is seen around an ego that is alone, m"""
_CLOSEST, _BESIDE = 16.0, (90, 70)
"""Pixels per m at which a pair is seen at most, and the pixels left free on both sides of it and
above"""
_SMOOTH = 0.8
"""Over how long the camera's way is smoothed, s"""
_LABELLED = 8
"""Up to so many participants have names; of more only those that matter"""
_LATE = 0.1
"""Time (s) after its last sample for which an entity is drawn"""
_ROOM = 20.0
"""Room around everything, m"""
_DASH, _GAP = 3.0, 6.0
"""Lengths of broken lines, m"""
_GROUND, _TEXT, _EGO, _OTHER, _PAPER, _BAD = (
    "#e4eadf",
    "#17202b",
    "#d9480f",
    "#2458a6",
    "#ffffff",
    "#c42121",
)
_KINDS = {"pedestrian": "#7b1fa2", "miscellaneous": "#4a4f57"}
_SURFACES = {
    "verge": "#cfdcc4",
    "walk": "#cbc6bd",
    "shoulder": "#a5acb6",
    "bike": "#b98f86",
    "road": "#8b939f",
}
_MARKS = {"yellow": "#f0be00", "standard": "#ffffff", "white": "#ffffff"}


class _Shape(NamedTuple):
    """A filled ring or a line (width in m) in the world."""

    points: Line
    colour: str
    width: float | None


class _Camera(NamedTuple):
    """View: the place in the middle (m), and pixels per m."""

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
        """Visible area."""
        across, up = (size / (2 * self.scale) for size in _SIZE)
        return Area(self.x - across, self.y - up, self.x + across, self.y + up)


def frames(results: Sequence[RunResult], times: Sequence[float]) -> Iterator[Image.Image]:
    """The pictures of one run or more at some times (s); the same runs give the same pictures."""
    views = [_View(result, times) for result in results]
    width, height = _SIZE[0], _SIZE[1] + _HEAD
    for index in range(len(times)):
        frame = Image.new("RGB", (width, height * len(views)))
        for number, view in enumerate(views):
            frame.paste(view.draw(index), (0, number * height))
        yield frame


def palette() -> Image.Image:
    """Palette of all colours, and of the means of pairs for smoothed edges."""
    names = [
        _GROUND,
        _TEXT,
        _EGO,
        _OTHER,
        _BAD,
        *_KINDS.values(),
        *_SURFACES.values(),
        *sorted(set(_MARKS.values())),
    ]
    colours = np.array([[int(name[at : at + 2], 16) for at in (1, 3, 5)] for name in names])
    pairs = [(a, b) for a in range(len(names)) for b in range(a)]
    mixed = [(colours[a] + colours[b]) // 2 for a, b in pairs]
    image = Image.new("P", (1, 1))
    image.putpalette(np.concatenate([colours, mixed])[:256].astype(np.uint8).tobytes())
    return image


class _View:
    """Draws a run's view at any of some times (s); while the camera stands, the
    road is drawn once.
    """

    def __init__(self, result: RunResult, times: Sequence[float]) -> None:
        self._result = result
        recording = result.recording
        self._times = [min(time, result.end_time) for time in times]
        self._area = area = extent(recording.tracks.values())
        self._shapes = _shapes(result, area.wider(_WIDTH))
        edges = [
            (*shape.points.min(axis=0)[:2], *shape.points.max(axis=0)[:2]) for shape in self._shapes
        ]
        self._edges = np.array(edges).reshape(-1, 4)
        self._tracks = {
            name: track for name, track in recording.tracks.items() if len(track.columns["time"])
        }
        self._contacts = [
            (row.who, start, result.end_time if end is None else end)
            for row in account.rows(result.events, {}, recording.tracks)
            if row.level == "collision"
            for start, end, _ in row.bars
        ]
        measures, dt = result.criticality, result.settings["timestep"]
        self._partners = partners(measures, dt, 1) if measures is not None else []
        self._cameras = self._film(times)
        self._road: tuple[_Camera, Image.Image] | None = None

    def draw(self, index: int) -> Image.Image:
        """The view at the time of this number; after the run's end, that at its end."""
        at, camera = self._times[index], self._cameras[index]
        if self._road is None or self._road[0] != camera:
            self._road = camera, self._draw_road(camera)
        image = self._road[1].copy()
        canvas = ImageDraw.Draw(image)
        touching = {
            name for who, start, end in self._contacts if start <= at <= end for name in who
        }
        for track in self._tracks.values():
            _participant(
                canvas,
                camera,
                track,
                at,
                _EGO if track.name == self._result.ego else None,
                track.name in touching,
            )
        self._label(canvas, camera, at)
        whole = Image.new("RGB", (_SIZE[0] * _FINER, (_SIZE[1] + _HEAD) * _FINER), _PAPER)
        whole.paste(image, (0, _HEAD * _FINER))
        _head(ImageDraw.Draw(whole), f"{self._result.name}  {at:.1f} s", touching, camera)
        return whole.reduce(_FINER)

    def _pair(self, time: float) -> list[str]:
        """Return the ego and its partner, as far as they exist at a time."""
        sample = round(time / self._result.settings["timestep"])
        partner = next((name for start, name in reversed(self._partners) if start <= sample), "")
        names = [self._result.ego or "", partner]
        return [
            name
            for name in names
            if name in self._tracks and _row(self._tracks[name], time) is not None
        ]

    def _film(self, times: Sequence[float]) -> list[_Camera]:
        """The camera at each time, moving smoothly."""
        film = np.array([self._camera(time) for time in self._times])
        step = times[1] - times[0] if len(times) > 1 else 1.0
        side = round(_SMOOTH / step / 2)
        # Padded by its ends, so that the mean has as many places as there are frames.
        padded = np.pad(film, ((side, side), (0, 0)), mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * side + 1, axis=0)
        return [_Camera(*row) for row in windows.mean(axis=2).tolist()]

    def _camera(self, time: float) -> _Camera:
        """Above ego and partner; above everything while there is no ego."""
        pair = self._pair(time)
        if not pair:
            west, south, east, north = self._area
            scale = min(
                _SIZE[0] / (east - west + _ROOM),
                _SIZE[1] / (north - south + _ROOM),
                _SIZE[0] / _WIDTH,
            )
            return _Camera((west + east) / 2, (south + north) / 2, scale)
        corners = np.concatenate([_corners(self._tracks[name], time) for name in pair])
        low, high = corners.min(axis=0), corners.max(axis=0)
        room = [
            (size - 2 * free) / span
            for size, free, span in zip(_SIZE, _BESIDE, high - low, strict=True)
        ]
        x, y = ((low + high) / 2).tolist()
        # An ego alone is seen at the usual width, a pair as near as it fits.
        return _Camera(x, y, min(*room, _CLOSEST if len(pair) > 1 else _SIZE[0] / _WIDTH))

    def _label(self, canvas: ImageDraw.ImageDraw, camera: _Camera, time: float) -> None:
        """Names with speeds, none above another."""
        named = self._pair(time) if len(self._tracks) > _LABELLED else list(self._tracks)
        taken: list[tuple[float, float, float]] = []
        for name in named:
            track = self._tracks[name]
            row = _row(track, time)
            if row is None:
                continue
            points = np.array(camera.pixels(_corners(track, time)))
            text = f"{name} {track.columns['speed'][row]:.1f} m/s"
            wide, x, y = (
                _font().getlength(text),
                float(points[:, 0].mean()),
                float(points[:, 1].min()) - 4 * _FINER,
            )
            # Upwards until it is free: names of neighbours would cover each other.
            while any(
                abs(x - u) < (wide + w) / 2 and abs(y - v) < 16 * _FINER for u, v, w in taken
            ):
                y -= 16 * _FINER
            taken.append((x, y, wide))
            canvas.text(
                (x, y),
                text,
                fill=_TEXT,
                font=_font(),
                anchor="ms",
                stroke_width=2 * _FINER,
                stroke_fill=_PAPER,
            )

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
    """Surfaces and marks in the order of drawing."""
    network = result.recording.network
    if network is None:
        return []
    rings = surfaces(network, area)
    # In the order of `_SURFACES`: carriageways lie above verges where outlines meet.
    shapes = [
        _Shape(ring, colour, None)
        for look, colour in _SURFACES.items()
        for ring in rings.get(look, ())
    ]
    for look, lines in marks(network, area).items():
        pieces = (
            lines
            if look.pattern in ("solid", "unmarked")
            else [dash for line in lines for dash in dashes(line)]
        )
        colour = (
            _MARKS.get(look.colour, "#ffffff")
            if look.pattern != "unmarked"
            else _SURFACES["shoulder"]
        )
        shapes += [_Shape(piece, colour, look.width) for piece in pieces]
    return shapes


def dashes(line: Line) -> list[Line]:
    """The dashes of a broken line, rows x, y (m)."""
    lengths = np.hypot(*np.diff(line[:, :2], axis=0).T)
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
        canvas.line(
            points, fill=shape.colour, width=max(_FINER, round(shape.width * camera.scale * _FINER))
        )


def _participant(
    canvas: ImageDraw.ImageDraw,
    camera: _Camera,
    track: Track,
    time: float,
    own: str | None,
    touched: bool,
) -> None:
    if _row(track, time) is None:
        return
    corners = _corners(track, time)
    points = camera.pixels(corners)
    if touched:
        canvas.line([*points, points[0], points[1]], fill=_BAD, width=6 * _FINER, joint="curve")
    canvas.polygon(points, fill=own or _KINDS.get(track.kind, _OTHER), outline=_TEXT)
    if track.kind == "vehicle":  # the front, where its windscreen is
        left, right = (
            corners[0] + 0.25 * (corners[1] - corners[0]),
            corners[3] + 0.25 * (corners[2] - corners[3]),
        )
        canvas.line(camera.pixels(np.array([left, right])), fill=_TEXT, width=_FINER * 2)


def _head(canvas: ImageDraw.ImageDraw, title: str, touching: set[str], camera: _Camera) -> None:
    """The strip above the road: name, time, contact, and how long a round number of metres is."""
    middle = _HEAD * _FINER // 2
    canvas.text((10 * _FINER, middle), title, fill=_TEXT, font=_font(), anchor="lm")
    if touching:
        start = 24 * _FINER + _font().getlength(title)
        canvas.text(
            (start, middle),
            f"contact: {', '.join(sorted(touching))}",
            fill=_BAD,
            font=_font(),
            anchor="lm",
        )
    metres = max(
        length
        for length in (1, 2, 5, 10, 20, 50, 100, 200, 500)
        if length == 1 or length * camera.scale <= 100
    )
    right, long = (_SIZE[0] - 10) * _FINER, metres * camera.scale * _FINER
    ends = [
        (right - long, middle - 4 * _FINER),
        (right - long, middle),
        (right, middle),
        (right, middle - 4 * _FINER),
    ]
    canvas.line(ends, fill=_TEXT, width=2 * _FINER)
    canvas.text(
        (right - long - 6 * _FINER, middle), f"{metres} m", fill=_TEXT, font=_font(), anchor="rm"
    )


def _corners(track: Track, time: float) -> Line:
    """The corners of a participant's box while it is there, rows x, y (m)."""
    row = _row(track, time)
    x, y, h = (float(track.columns[name][row]) for name in ("x", "y", "h"))
    return np.array(box_corners(x, y, h, track.box))


def _row(track: Track, time: float) -> int | None:
    """The row of a track at a time; None while it is absent."""
    times = track.columns["time"]
    row = int(np.searchsorted(times, time + 1e-6, side="right")) - 1
    return row if row >= 0 and time - times[row] < _LATE else None


@cache
def _font() -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(
        str(Path(mpl.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"), 13 * _FINER
    )


_GIF, _MP4 = 10, 20
"""Frames a second"""
_ENCODE = (
    "-c:v libx264 -pix_fmt yuv420p -crf 20 -threads 1 -fflags +bitexact -flags:v +bitexact "
    "-map_metadata -1 -movflags +faststart"
)
"""Options of ffmpeg for an MP4 that every player reads, with the same bytes each time"""


def write_animation(results: Sequence[RunResult], path: Path) -> None:
    """Write a GIF that plays one run or more in real time; the same runs give the same bytes.

    Raises:
        UsageError: it can't be written.
    """
    colours = palette()
    made = (
        frame.quantize(palette=colours, dither=Image.Dither.NONE)
        for frame in frames(results, _times(results, _GIF))
    )
    # Before a file is opened: a run that can't be drawn leaves none behind.
    first = next(made)
    with writing("the animation", path), drafted(path) as draft:
        first.save(
            draft,
            "GIF",
            save_all=True,
            append_images=made,
            duration=1000 // _GIF,
            loop=0,
            optimize=False,
        )


def write_film(results: Sequence[RunResult], path: Path) -> None:
    """Write an MP4 that plays one run or more in real time.

    Raises:
        UsageError: ffmpeg is not there, or can't do it.
    """
    ffmpeg = shutil.which("ffmpeg")
    if ffmpeg is None:
        raise UsageError("an .mp4 needs ffmpeg, which is not installed; a .gif does not", path=path)
    made = frames(results, _times(results, _MP4))
    # Before a file is opened: a run that can't be drawn leaves none behind.
    first = next(made)
    size = f"{first.width}x{first.height}"
    given = [
        ffmpeg,
        "-y",
        "-loglevel",
        "error",
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgb24",
        "-s",
        size,
        "-r",
        str(_MP4),
        "-i",
        "-",
    ]
    with writing("the film", path), drafted(path) as draft:
        target = [*_ENCODE.split(), str(draft.absolute())]
        with subprocess.Popen(
            [*given, *target], stdin=subprocess.PIPE, stderr=subprocess.PIPE
        ) as process:
            assert process.stdin is not None and process.stderr is not None
            try:
                for frame in (first, *made):
                    process.stdin.write(frame.tobytes())
                process.stdin.close()
            except BrokenPipeError:
                pass  # it says why below
            told = (
                process.stderr.read()
                .decode(errors="replace")
                .replace(draft.name, path.name)
                .strip()
            )
        if process.returncode:
            raise UsageError(
                f"ffmpeg can't write this: {told.splitlines()[-1] if told else process.returncode}",
                path=path,
            )


def _times(results: Sequence[RunResult], per_second: int) -> list[float]:
    end = max(result.end_time for result in results)
    return [number / per_second for number in range(math.floor(end * per_second + 1e-6) + 1)]


def write_pictures(results: Sequence[RunResult], path: Path) -> None:
    """Write a PNG of one run or more: views from above, speeds, criticality.

    Raises:
        UsageError: it can't be written.
    """
    from PIL import Image

    from runner.batch.outputs.picture import write_picture

    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f"{number}.png" for number in range(len(results))]
        for result, file in zip(results, files, strict=True):
            write_picture(result, file)
        pictures = [Image.open(file).convert("RGB") for file in files]
    size = max(picture.width for picture in pictures), sum(picture.height for picture in pictures)
    whole = Image.new("RGB", size, "white")
    top = 0
    for picture in pictures:
        whole.paste(picture, (0, top))
        top += picture.height
    with writing("the picture", path), drafted(path) as draft:
        whole.save(draft, "PNG")
