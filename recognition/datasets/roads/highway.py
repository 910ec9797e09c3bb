"""The straight OpenDRIVE road that highD's lane markings describe.

highD's image has x to the right and y downwards; the world has x as it is and y upwards, so y changes its sign. The road
runs along +x, its reference line is the middle of the median. Traffic keeps right: the lower carriageway (driving
direction 2, towards +x) lies on the right and has the ids -1 (its half of the median), -2, … outwards, the upper one (driving
direction 1, towards -x) on the left 1, 2, … outwards. Places on it are exact in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schemas.storage import digest, keep, writing
from xodr.array_types import FloatArray
from xodr.builders.curves import Pose, line
from xodr.builders.elements import Cubic, Lane, Road, RoadMap, Section

ROAD_ID = "1"


@dataclass(frozen=True)
class Highway:
    """Two straight carriageways.

    Attributes:
        upper, lower: y of the markings in the image, ascending, two or more each (m).
        start, end: x of the road's ends, m.
        speed_limit: m/s, infinite for none.
    """

    upper: tuple[float, ...]
    lower: tuple[float, ...]
    start: float
    end: float
    speed_limit: float

    @property
    def middle(self) -> float:
        """y of the reference line in the world, m."""
        return -0.5 * (self.upper[-1] + self.lower[0])

    @property
    def median(self) -> bool:
        """Whether there is ground between the carriageways."""
        return self.upper[-1] < self.lower[0]

    def borders(self, side: int) -> list[float]:
        """Distances of a side's lane borders from the reference line, ascending from 0; side is 1 (left) or -1 (right)."""
        markings = reversed(self.upper) if side > 0 else self.lower
        away = [side * (-y - self.middle) for y in markings]
        return [0.0, *away] if self.median else away

    def road_map(self, name: str) -> RoadMap:
        """The road, to be written as a file."""
        lanes: dict[int, Lane] = {}
        for side in (1, -1):
            borders = self.borders(side)
            for number, (inner, outer) in enumerate(pairwise(borders), 1):
                kind = "median" if self.median and number == 1 else "driving"
                edge = kind == "median" or number == len(borders) - 1
                lanes[side * number] = Lane(kind, (Cubic(0.0, outer - inner),), mark="solid" if edge else "broken")
        start = Pose(self.start, self.middle, 0.0)
        plan = (line(self.end - self.start),)
        road = Road(int(ROAD_ID), name, start, plan, (Section(0.0, lanes, "solid"),), "motorway", self.speed_limit)
        return RoadMap(name, (road,))

    def places(self, x: FloatArray, y: FloatArray) -> dict[str, NDArray[Any]]:
        """Road coordinates of world positions: columns road_id, lane_id, s, t and lane_offset of a recording.

        As `xodr.road.Road.point` has it: beside the road the nearest lane counts, on a border the inner one.
        """
        t = y - self.middle
        lane = np.zeros(len(t), np.int64)
        centre = np.zeros(len(t))
        for side, mine in ((1, t > 0.0), (-1, t <= 0.0)):
            borders = np.array(self.borders(side))
            number = np.clip(np.searchsorted(borders, side * t[mine]), 1, len(borders) - 1)
            lane[mine] = side * number
            centre[mine] = side * 0.5 * (borders[number - 1] + borders[number])
        road = np.full(len(t), ROAD_ID, dtype=object)
        return {"road_id": road, "lane_id": lane, "s": x - self.start, "t": t, "lane_offset": t - centre}

    def write(self, name: str, folder: Path) -> Path:
        """Write the road into a folder, under a name that differs for roads of other content; the file's path.

        Raises:
            UsageError: the folder can't be written.
        """
        content = self.road_map(name).to_xml()
        with writing("the road", folder):
            return keep(content, folder / f"{name}-{digest(content)}.xodr")
