"""Hand-made Lanelet2 maps for tests: lanes between bounds whose points are
shared where they are the same.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

Line = Sequence[tuple[float, float]]


def straight(
    start: tuple[float, float], end: tuple[float, float], t: float = 0.0, count: int = 2
) -> list[tuple[float, float]]:
    """Points on the line from start to end, t metres to its left."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    length = math.hypot(dx, dy)
    x, y = start[0] - t * dy / length, start[1] + t * dx / length
    return [(x + share * dx, y + share * dy) for share in np.linspace(0.0, 1.0, count).tolist()]


def arc(
    centre: tuple[float, float], radius: float, start: float, end: float, count: int = 12
) -> list[tuple[float, float]]:
    """Points on a circle from angle to angle [rad]."""
    angles = np.linspace(start, end, count).tolist()
    return [
        (centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle))
        for angle in angles
    ]


def turn(
    start: tuple[float, float, float], end: tuple[float, float, float], t: float, count: int = 15
) -> list[tuple[float, float]]:
    """Points of a smooth curve between two poses (x, y, heading), t metres to its left."""
    reach = math.dist(start[:2], end[:2])
    p = np.linspace(0.0, 1.0, count)[:, None]
    h0, h1 = (np.array([math.cos(pose[2]), math.sin(pose[2])]) * reach for pose in (start, end))
    p0, p1 = np.array(start[:2]), np.array(end[:2])
    points = (
        (2 * p**3 - 3 * p**2 + 1) * p0
        + (p**3 - 2 * p**2 + p) * h0
        + (3 * p**2 - 2 * p**3) * p1
        + (p**3 - p**2) * h1
    )
    slopes = (6 * p**2 - 6 * p) * (p0 - p1) + (3 * p**2 - 4 * p + 1) * h0 + (3 * p**2 - 2 * p) * h1
    slopes /= np.hypot(*slopes.T)[:, None]
    return [
        (x, y) for x, y in (points + t * np.column_stack([-slopes[:, 1], slopes[:, 0]])).tolist()
    ]


class LaneletMap:
    """Collects lanelets and writes them as an OSM file with local coordinates."""

    def __init__(self) -> None:
        self.nodes: dict[tuple[float, float], int] = {}
        self.ways: dict[tuple[int, ...], tuple[int, dict[str, str]]] = {}
        self.relations: list[str] = []

    def lanelet(
        self,
        name: int,
        left: Line,
        right: Line,
        members: str = "",
        marks: Sequence[str] = ("", ""),
        **tags: str,
    ) -> None:
        """Add a lanelet with the id `name`. marks: type and subtype of the
        bounds, as in "line_thin dashed".

        Bounds of several ways are in `members`, and `left` or `right` is empty.
        """
        bounds = "".join(
            f'<member type="way" role="{role}" ref="{self.way(line, mark)}"/>'
            for role, line, mark in (("left", left, marks[0]), ("right", right, marks[1]))
            if len(line)
        )
        self.relation(name, bounds + members, type="lanelet", **tags)

    def way(self, line: Line, mark: str = "") -> int:
        """The way through points; the one there is where its points are the
        same, in either direction.
        """
        nodes = tuple(self._node(point) for point in line)
        kind, _, subtype = mark.partition(" ")
        tags = {key: value for key, value in (("type", kind), ("subtype", subtype)) if value}
        known = nodes if nodes in self.ways else nodes[::-1]
        return self.ways.setdefault(
            known if known in self.ways else nodes, (1000 + len(self.ways), tags)
        )[0]

    def relation(self, name: int, members: str = "", **tags: str) -> None:
        """Add any relation."""
        self.relations.append(f'<relation id="{name}">{members}{_tags(tags)}</relation>')

    def _node(self, point: tuple[float, float]) -> int:
        x, y = (round(value, 6) for value in point)
        return self.nodes.setdefault((x, y), 1 + len(self.nodes))

    def text(self) -> str:
        """The file, one element a line."""
        nodes = (
            (
                f'<node id="{number}" lat="" '
                f'lon="">{_tags({"local_x": repr(x), "local_y": repr(y)})}</node>'
            )
            for (x, y), number in self.nodes.items()
        )
        ways = (
            f'<way id="{number}">{_nodes(way)}{_tags(tags)}</way>'
            for way, (number, tags) in self.ways.items()
        )
        return _osm([*nodes, *ways, *self.relations])

    def write(self, folder: Path, name: str = "map") -> Path:
        """Write the file."""
        path = folder / f"{name}.osm"
        path.write_text(self.text())
        return path


def _osm(lines: Iterable[str]) -> str:
    body = "\n".join(lines)
    return f'<?xml version="1.0"?>\n<osm version="0.6">\n{body}\n</osm>\n'


def _nodes(way: Iterable[int]) -> str:
    return "".join(f'<nd ref="{node}"/>' for node in way)


def _tags(tags: dict[str, str]) -> str:
    return "".join(f'<tag k="{key}" v="{value}"/>' for key, value in tags.items())


# maps ---------------------------------------------------------------------------------------------

WIDTH = 3.5


def two_lanes(**tags: str) -> LaneletMap:
    """Lanelets 1 (left) and 2 (right), 100 m to the east."""
    made = LaneletMap()
    lines = [straight((0.0, 0.0), (100.0, 0.0), t) for t in (WIDTH, 0.0, -WIDTH)]
    made.lanelet(1, lines[0], lines[1], marks=("curbstone", "line_thin dashed"), **tags)
    made.lanelet(2, lines[1], lines[2], marks=("", "line_thin solid"), **tags)
    return made


def fork() -> LaneletMap:
    """Lanelet 1 splits into 2, straight on, and 3, to the right; 4 goes on from 2."""
    made = LaneletMap()
    for name, (start, end) in {1: (0.0, 50.0), 2: (50.0, 100.0), 4: (100.0, 150.0)}.items():
        made.lanelet(
            name,
            straight((start, 0.0), (end, 0.0), WIDTH / 2),
            straight((start, 0.0), (end, 0.0), -WIDTH / 2),
        )
    ends = (50.0, 0.0, 0.0), (90.0, -20.0, -0.9)
    made.lanelet(3, turn(*ends, WIDTH / 2), turn(*ends, -WIDTH / 2))
    return made


def merge() -> LaneletMap:
    """Lanelets 1 and 3 lead into 2."""
    made = LaneletMap()
    for name, (start, end) in {1: (0.0, 50.0), 2: (50.0, 100.0)}.items():
        made.lanelet(
            name,
            straight((start, 0.0), (end, 0.0), WIDTH / 2),
            straight((start, 0.0), (end, 0.0), -WIDTH / 2),
        )
    ends = (10.0, 20.0, -0.9), (50.0, 0.0, 0.0)
    made.lanelet(3, turn(*ends, WIDTH / 2), turn(*ends, -WIDTH / 2))
    return made


ARMS = 4


def four_way(members: Mapping[int, str] | None = None) -> LaneletMap:
    """A junction of four arms: lanelets 1 to 4 lead in, 11 to 14 out, 100 + 10 ·
    from + to across. Arm 1 is in the east.

    members: more members of lanelets, by their ids.
    """
    made = LaneletMap()
    for arm in range(1, ARMS + 1):
        entry, exit_ = _entry(arm), _exit(arm)
        for name, (x, y, h), sign in ((arm, entry, -1.0), (10 + arm, exit_, 1.0)):
            far = (x + 60.0 * sign * math.cos(h), y + 60.0 * sign * math.sin(h))
            ends = (far, (x, y)) if sign < 0.0 else ((x, y), far)
            sides = (straight(*ends, t) for t in (WIDTH / 2, -WIDTH / 2))
            made.lanelet(name, *sides, members=(members or {}).get(name, ""), location="urban")
        for to in range(1, ARMS + 1):
            if to != arm:
                ends2 = entry, _exit(to)
                made.lanelet(
                    100 + 10 * arm + to,
                    turn(*ends2, WIDTH / 2),
                    turn(*ends2, -WIDTH / 2),
                    location="urban",
                )
    return made


def _entry(arm: int) -> tuple[float, float, float]:
    """Pose at the end of the lanelet that leads in from an arm."""
    angle = (arm - 1) * math.pi / 2
    x, y = 15.0, WIDTH / 2
    return (
        x * math.cos(angle) - y * math.sin(angle),
        x * math.sin(angle) + y * math.cos(angle),
        angle + math.pi,
    )


def _exit(arm: int) -> tuple[float, float, float]:
    """Pose at the start of the lanelet that leads out to an arm."""
    angle = (arm - 1) * math.pi / 2
    x, y = 15.0, -WIDTH / 2
    return (
        x * math.cos(angle) - y * math.sin(angle),
        x * math.sin(angle) + y * math.cos(angle),
        angle,
    )


def ring() -> LaneletMap:
    """A roundabout of radius 20 m with three arms.

    Lanelets 1 to 3 are the ring beside the arms, 11 to 13 between them, 21 to 23 lead in, 31 to 33
    out.
    """
    made = LaneletMap()
    step, half = math.tau / 3, 0.4
    for arm in range(3):
        angle = arm * step
        for name, start, end in (
            (1 + arm, angle - half, angle + half),
            (11 + arm, angle + half, angle + step - half),
        ):
            made.lanelet(
                name,
                arc((0.0, 0.0), 20.0 - WIDTH / 2, start, end),
                arc((0.0, 0.0), 20.0 + WIDTH / 2, start, end),
            )
        onto, off = (_on_ring(angle + side) for side in (half, -half))
        far = [
            (60.0 * math.cos(angle + side), 60.0 * math.sin(angle + side)) for side in (0.06, -0.06)
        ]
        for name, ends in (
            (21 + arm, ((*far[0], angle + math.pi), onto)),
            (31 + arm, (off, (*far[1], angle))),
        ):
            made.lanelet(name, turn(*ends, WIDTH / 2, 25), turn(*ends, -WIDTH / 2, 25))
    return made


def _on_ring(angle: float) -> tuple[float, float, float]:
    return 20.0 * math.cos(angle), 20.0 * math.sin(angle), angle + math.pi / 2
