"""OpenDRIVE roads: exact geometry, positions, lanes, routes.

`xodr.load(path)` reads a file; see `RoadNetwork` for what can be asked of it.
"""

from typing import TYPE_CHECKING

from schemas.common.packages import public
from xodr.graph.network import RoadNetwork
from xodr.graph.routes import Relative, RoadPath
from xodr.graph.travel import Travel
from xodr.model import LaneLink, RoadError, RoadPoint, WorldPose
from xodr.model.road import Road
from xodr.reader import load

__all__ = [
    "LaneLink",
    "Relative",
    "Road",
    "RoadError",
    "RoadNetwork",
    "RoadPath",
    "RoadPoint",
    "Travel",
    "WorldPose",
    "load",
]

if TYPE_CHECKING:
    __version__: str
else:
    __getattr__, __dir__ = public(__name__, {})
