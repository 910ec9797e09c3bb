"""SUMO networks of OpenDRIVE files: `build(path)` converts, or finds an earlier conversion.

See `SumoNet`.
"""

from xodr.formats.sumo_net.building import build, georeference, lift, sumo_home
from xodr.formats.sumo_net.net import DOCK, LaneTrack, SignalLink, SumoNet

__all__ = [
    "DOCK",
    "LaneTrack",
    "SignalLink",
    "SumoNet",
    "build",
    "georeference",
    "lift",
    "sumo_home",
]
