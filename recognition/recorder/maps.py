"""Maps that only the recorder needs."""

from __future__ import annotations

from xodr.builders import RoadMap
from xodr.builders.curves import Pose, line
from xodr.builders.elements import Cubic, Lane, Road, Section
from xodr.builders.lanes import carriageway, closing, constant, linked, opening


def kerbside(
    *, lanes: int = 2, lane_width: float = 3.25, approach: float = 200.0, taper: float = 25.0, kerb: float = 250.0,
    speed_limit: float = 50 / 3.6,
) -> RoadMap:  # fmt: skip
    """A straight street along the x axis with a lane at either kerb, for a while, in which people stop.

    Args:
        lanes: through lanes each way, with ids ±1 … ±lanes; the kerb's lanes come next.
        approach: length of road before and behind. kerb: of the lane at full width. taper: of its beginning and end.
        lane_width: m. speed_limit: m/s.
    """
    extra = lanes + 1

    def wide(s: float, width: tuple[Cubic, ...], before: bool, behind: bool) -> Section:
        layout = carriageway(extra, lane_width) | carriageway(extra, lane_width, side=1)
        layout |= {side * extra: Lane("driving", width, mark="solid") for side in (1, -1)}
        through = {key: key for key in layout if abs(key) <= lanes}
        return linked(Section(s, layout, "solid solid"), None if before else through, None if behind else through)

    plain = carriageway(lanes, lane_width) | carriageway(lanes, lane_width, side=1)
    ends = approach + taper, approach + taper + kerb, approach + 2 * taper + kerb
    sections = (
        linked(Section(0.0, plain, "solid solid"), {}, None),
        wide(approach, opening(lane_width, taper), before=False, behind=True),
        wide(ends[0], constant(lane_width), before=True, behind=True),
        wide(ends[1], closing(lane_width, taper), before=True, behind=False),
        linked(Section(ends[2], plain, "solid solid"), None, {}),
    )
    road = Road(1, "Street", Pose(0.0, 0.0, 0.0), (line(ends[2] + approach),), sections, "town", speed_limit)
    return RoadMap("Street with stops at the kerb", (road,))
