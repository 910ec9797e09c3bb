"""Writes small OpenDRIVE files for the tests of `xodr`."""

from __future__ import annotations

from itertools import count
from pathlib import Path

import pytest

import xodr
from xodr.graph.network import RoadNetwork


class Files:
    """Text of OpenDRIVE elements, and networks read from them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.numbers = count()

    def load(self, *elements: str, header: str = "", root: str = "<OpenDRIVE>") -> RoadNetwork:
        """Write a file with these roads and junctions, and read it."""
        return xodr.load(self.write(*elements, header=header, root=root))

    def write(self, *elements: str, header: str = "", root: str = "<OpenDRIVE>") -> Path:
        """Write a file with these roads and junctions."""
        path = self.folder / f"{next(self.numbers)}.xodr"
        body = "\n".join(elements)
        path.write_text(
            f'{root}\n<header revMajor="1" revMinor="6" '
            f'name="test">{header}</header>\n{body}\n</OpenDRIVE>\n'
        )
        return path

    @staticmethod
    def road(
        road_id: str = "1",
        *,
        length: float = 100.0,
        geometry: str = "",
        lanes: str = "",
        link: str = "",
        rule: str = "RHT",
        junction: str = "-1",
        more: str = "",
        start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> str:
        """A road: a straight line with two lanes on each side, unless said otherwise."""
        geometry = geometry or Files.geometry("<line/>", length, start=start)
        lanes = lanes or Files.section(left=2, right=2)
        return (
            f'<road id="{road_id}" length="{length!r}" junction="{junction}" '
            f'rule="{rule}"><link>{link}</link>'
            f"<planView>{geometry}</planView>{more}<lanes>{lanes}</lanes></road>"
        )

    @staticmethod
    def geometry(
        shape: str,
        length: float,
        s: float = 0.0,
        start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> str:
        """A plan-view element."""
        x, y, h = start
        return (
            f'<geometry s="{s!r}" x="{x!r}" y="{y!r}" hdg="{h!r}" '
            f'length="{length!r}">{shape}</geometry>'
        )

    @staticmethod
    def section(
        left: int = 0,
        right: int = 0,
        s: float = 0.0,
        width: str = '<width sOffset="0" a="3.5"/>',
        linked: bool = True,
    ) -> str:
        """A lane section with driving lanes, each linked to the same id before and after."""

        def lane(lane_id: int) -> str:
            link = (
                f'<link><predecessor id="{lane_id}"/><successor id="{lane_id}"/></link>'
                if linked
                else ""
            )
            return f'<lane id="{lane_id}" type="driving">{link}{width}</lane>'

        sides = {"left": range(left, 0, -1), "right": range(-1, -right - 1, -1)}
        text = {side: "".join(lane(lane_id) for lane_id in ids) for side, ids in sides.items()}
        return (
            f'<laneSection s="{s!r}"><left>{text["left"]}</left><center><lane id="0" '
            'type="none"/></center>'
            f"<right>{text['right']}</right></laneSection>"
        )

    @staticmethod
    def connection(
        incoming: str, other: str, lane_from: int = -1, lane_to: int = -1, direct: bool = False
    ) -> str:
        """A junction's connection that enters the other road at its start."""
        road = "linkedRoad" if direct else "connectingRoad"
        return (
            f'<connection id="0" incomingRoad="{incoming}" {road}="{other}" contactPoint="start">'
            f'<laneLink from="{lane_from}" to="{lane_to}"/></connection>'
        )

    @staticmethod
    def to_road(kind: str, road_id: str, contact: str) -> str:
        """A predecessor or successor that is a road."""
        return f'<{kind} elementType="road" elementId="{road_id}" contactPoint="{contact}"/>'

    @staticmethod
    def to_junction(kind: str, junction_id: str) -> str:
        """A predecessor or successor that is a junction."""
        return f'<{kind} elementType="junction" elementId="{junction_id}"/>'

    @staticmethod
    def speed_limit(speed: float) -> str:
        """A road type with a speed limit [m/s]."""
        return f'<type s="0" type="rural"><speed max="{speed}"/></type>'


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    """Writer of small OpenDRIVE files."""
    return Files(tmp_path_factory.mktemp("xodr"))


@pytest.fixture(scope="session")
def two_ways(files: Files) -> RoadNetwork:
    """Two ways from road 1 to road 4: over the short slow road 2 with a
    junction, or the long fast road 3 without one.

    1 ──┬── 10 (in the junction, 10 m) ── 2 (90 m, 10 m/s) ──┬── 4
        └── 3 (300 m, 50 m/s, leaves the direct junction) ───┘
    """
    one = files.section(right=1, left=1)
    single = files.section(right=1)
    return files.load(
        files.road("1", lanes=one, link=files.to_junction("successor", "a")),
        files.road(
            "10",
            length=10.0,
            lanes=single,
            junction="a",
            link=files.to_road("predecessor", "1", "end")
            + files.to_road("successor", "2", "start"),
        ),
        files.road(
            "2",
            length=90.0,
            lanes=single,
            link=files.to_junction("predecessor", "a") + files.to_junction("successor", "b"),
            more=files.speed_limit(10),
        ),
        files.road(
            "3",
            length=300.0,
            lanes=single,
            link=files.to_junction("predecessor", "a") + files.to_junction("successor", "b"),
            more=files.speed_limit(50),
        ),
        files.road("4", lanes=one, link=files.to_junction("predecessor", "b")),
        files.road("5", lanes=one),
        "<junction "
        f'id="a">{files.connection("1", "10")}{files.connection("1", "3", direct=True)}</junction>',
        f'<junction id="b" type="direct">{files.connection("2", "4", direct=True)}'
        f"{files.connection('3', '4', direct=True)}</junction>",
    )
