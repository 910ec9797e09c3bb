"""Runs as one picture: that of each, one above the other."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from runner.interpreter.result import RunResult


def write_pictures(results: Sequence[RunResult], path: Path) -> None:
    """Write a PNG of one run or more: views from above, speeds, criticality."""
    from PIL import Image

    from runner.outputs.picture import write_picture

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
    whole.save(path, "PNG")
