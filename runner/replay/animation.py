"""Runs as an animated GIF, or as an MP4 where ffmpeg is there."""

from __future__ import annotations

import math
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image

from runner.replay.frames import frames, palette
from schemas.errors import UsageError

if TYPE_CHECKING:
    from runner.interpreter.result import RunResult

_GIF, _MP4 = 10, 20
"""Frames a second"""
_ENCODE = (
    "-c:v libx264 -pix_fmt yuv420p -crf 20 -threads 1 -fflags +bitexact -flags:v +bitexact -map_metadata -1 -movflags +faststart"
)
"""How ffmpeg writes an MP4 that every player takes, the same bytes each time"""


def write_animation(results: Sequence[RunResult], path: Path) -> None:
    """Write a GIF that plays one run or more in real time; the same runs give the same bytes."""
    colours = palette()
    made = (frame.quantize(palette=colours, dither=Image.Dither.NONE) for frame in frames(results, _times(results, _GIF)))
    first = next(made)
    first.save(path, "GIF", save_all=True, append_images=made, duration=1000 // _GIF, loop=0, optimize=False)


def write_film(results: Sequence[RunResult], path: Path) -> None:
    """Write an MP4 that plays one run or more in real time.

    Raises:
        UsageError: ffmpeg is not there, or can't do it.
    """
    ffmpeg = shutil.which("ffmpeg")
    if ffmpeg is None:
        raise UsageError("an .mp4 needs ffmpeg, which is not installed; a .gif does not", path=path)
    made = frames(results, _times(results, _MP4))
    first = next(made)
    size = f"{first.width}x{first.height}"
    given = [ffmpeg, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", str(_MP4), "-i", "-"]
    with subprocess.Popen(
        [*given, *_ENCODE.split(), str(path.absolute())], stdin=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdin is not None and process.stderr is not None
        try:
            for frame in (first, *made):
                process.stdin.write(frame.tobytes())
            process.stdin.close()
        except BrokenPipeError:
            pass  # it says why below
        told = process.stderr.read().decode(errors="replace").strip()
    if process.returncode:
        raise UsageError(f"ffmpeg can't write this: {told.splitlines()[-1] if told else process.returncode}", path=path)


def _times(results: Sequence[RunResult], per_second: int) -> list[float]:
    end = max(result.end_time for result in results)
    return [number / per_second for number in range(math.floor(end * per_second + 1e-6) + 1)]
