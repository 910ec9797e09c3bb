"""Draw the rooms of the house and the three ways through it that docs/architecture.md describes.

    python docs/picture.py

makes docs/architecture.svg anew: rooms are the folders of the packages, dots the modules that the
page's numbered steps name.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PAGE, PICTURE = ROOT / "docs" / "architecture.md", ROOT / "docs" / "architecture.svg"

FLOORS = [
    {"generation": "edge cases by search"},
    {"recognition": "recordings to catalogues"},
    {"runner": "scenarios executed, on SUMO"},
    {"xosc": "OpenSCENARIO documents", "xodr": "OpenDRIVE roads"},
    {"schemas": "standards, checks, values"},
]
"""Packages of each floor, the highest first, and what they are for."""
NAMED = re.compile(rf"`((?:{'|'.join(name for floor in FLOORS for name in floor)})(?:\.\w+)+)`")
"""Dotted names on the page."""

_WIDTH, _LEFT, _MARGIN = 1000, 250, 16
_ROW, _ROOM, _GAP = 36, 28, 8
_CHARACTER, _DOT = 8.0, 18
_STEP = re.compile(r"^(\d+)\. (.*?)(?=^\d+\. |\Z)", re.DOTALL | re.MULTILINE)
_STYLE = """
  text { font: 13px system-ui, "DejaVu Sans", sans-serif; fill: #1f2328 }
  .name { font-weight: 600; font-size: 16px } .small { fill: #59636e; font-size: 12px }
  .paper { fill: #ffffff } .floor { fill: #eef1f4 } .room { fill: #ffffff; stroke: #8b949e }
  .study { stroke-dasharray: 4 3 }
  .way0 { fill: #0b5cad } .way1 { fill: #b04a00 } .way2 { fill: #7a3db8 }
  .step { fill: #ffffff; font-size: 11px; font-weight: 600; text-anchor: middle }
  @media (prefers-color-scheme: dark) {
    text { fill: #e6edf3 } .small { fill: #9da7b1 }
    .paper { fill: #0d1117 } .floor { fill: #1b222b } .room { fill: #0d1117; stroke: #6e7681 }
    .step { fill: #ffffff }
  }"""


class Way(NamedTuple):
    """A way through the house: its title, and the dotted names in each of its steps."""

    title: str
    steps: list[list[str]]


class Dot(NamedTuple):
    """A step of a way."""

    way: int
    step: int


def ways(text: str) -> list[Way]:
    """The sections of the page that consist of numbered steps."""
    sections = (section.partition("\n") for section in text.split("\n## ")[1:])
    return [
        Way(title, [NAMED.findall(step) for _, step in _STEP.findall(body)])
        for title, _, body in sections
    ]


def rooms(package: str) -> list[str]:
    """The folders of a package that hold modules, by name."""
    return sorted(path.parent.name for path in (ROOT / package).glob("*/__init__.py"))


def dots(found: list[Way]) -> dict[str, list[Dot]]:
    """Steps by the room (`runner.engine.motion`) that they are in, or by the package where they are
    in none."""
    by_room: dict[str, list[Dot]] = {}
    for way, (_, steps) in enumerate(found):
        for number, names in enumerate(steps, start=1):
            for name in names:
                package, inner = name.split(".")[:2]
                room = f"{package}.{inner}" if inner in rooms(package) else package
                if Dot(way, number) not in by_room.setdefault(room, []):
                    by_room[room].append(Dot(way, number))
    return by_room


def picture(text: str) -> str:
    """The SVG of the rooms, with the steps of the page's ways."""
    found = ways(text)
    marked, y, parts = dots(found), _MARGIN, []
    for floor in FLOORS:
        width = (_WIDTH - _MARGIN * (len(floor) + 1)) // len(floor)
        left = _LEFT if len(floor) == 1 else 190
        rows = [list(_rows(package, width - left, marked)) for package in floor]
        height = max(len(each) for each in rows) * _ROW + 2 * _GAP
        height = max(height, 76)
        for column, ((package, meaning), each) in enumerate(zip(floor.items(), rows, strict=True)):
            x = _MARGIN + column * (width + _MARGIN)
            parts += _package(package, meaning, each, marked, x, y, width, left, height)
        y += height + _GAP
    parts += _legend(found, y + 20)
    height = y + 20 + 24 * len(found) + 6
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" '
        f'width="{_WIDTH}" height="{height}">'
    )
    paper = f'<rect class="paper" width="{_WIDTH}" height="{height}" rx="8"/>'
    return "\n".join([head, f"<style>{_STYLE}\n</style>", paper, *parts, "</svg>", ""])


def _length(package: str, room: str, marked: dict[str, list[Dot]]) -> int:
    return round(len(room) * _CHARACTER) + 20 + _DOT * len(marked.get(f"{package}.{room}", []))


def _rows(package: str, width: int, marked: dict[str, list[Dot]]) -> Iterator[list[str]]:
    """Rooms, broken into rows of a width."""
    row: list[str] = []
    used = 0
    for room in rooms(package):
        length = _length(package, room, marked) + _GAP
        if row and used + length > width:
            yield row
            row, used = [], 0
        row.append(room)
        used += length
    yield row


def _package(
    package: str,
    meaning: str,
    rows: list[list[str]],
    marked: dict[str, list[Dot]],
    x: int,
    y: int,
    width: int,
    left: int,
    height: int,
) -> Iterator[str]:
    yield f'<rect class="floor" x="{x}" y="{y}" width="{width}" height="{height}" rx="6"/>'
    yield f'<text class="name" x="{x + 12}" y="{y + 26}">{package}</text>'
    yield f'<text class="small" x="{x + 12}" y="{y + 44}">{escape(meaning)}</text>'
    yield from _marks(marked.get(package, []), x + 21, y + 60)
    for number, row in enumerate(rows):
        at, top = x + left, y + _GAP + 4 + number * _ROW
        for room in row:
            length = _length(package, room, marked)
            kind = "room study" if room == "study" else "room"
            yield (
                f'<rect class="{kind}" x="{at}" y="{top}" width="{length}" '
                f'height="{_ROOM}" rx="4"/>'
            )
            yield f'<text x="{at + 9}" y="{top + 19}">{room}</text>'
            steps = marked.get(f"{package}.{room}", [])
            yield from _marks(steps, at + length - _DOT * len(steps) + 5, top + _ROOM // 2)
            at += length + _GAP


def _marks(steps: list[Dot], x: int, y: int) -> Iterator[str]:
    for number, (way, step) in enumerate(steps):
        yield from _mark(way, str(step), x + _DOT * number, y)


def _mark(way: int, text: str, x: int, y: int) -> Iterator[str]:
    """A dot: a circle, a square or a diamond, so that ways differ without colours too."""
    if way == 0:
        yield f'<circle class="way0" cx="{x}" cy="{y}" r="8"/>'
    elif way == 1:
        yield f'<rect class="way1" x="{x - 7.5}" y="{y - 7.5}" width="15" height="15" rx="2"/>'
    else:
        yield f'<path class="way2" d="M{x} {y - 10}L{x + 9} {y}L{x} {y + 10}L{x - 9} {y}Z"/>'
    yield f'<text class="step" x="{x}" y="{y + 4}">{text}</text>'


def _legend(found: list[Way], y: int) -> Iterator[str]:
    for way, (title, steps) in enumerate(found):
        yield from _mark(way, "1", _MARGIN + 12, y + 24 * way - 4)
        yield (
            f'<text x="{_MARGIN + 30}" y="{y + 24 * way}">{escape(title.replace("`", ""))}: '
            f"{len(steps)} steps</text>"
        )
    note = "Imports lead downward only. Dashed: experiments, which nothing imports."
    yield f'<text class="small" x="{_LEFT + 260}" y="{y}">{note}</text>'


def main() -> None:
    """Write the picture."""
    PICTURE.write_text(picture(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
