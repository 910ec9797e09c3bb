"""SUMO networks of OpenDRIVE files: `build(path)` converts, or finds what was converted before; see `SumoNet`."""

from xodr.sumo_net.building import build, georeference, lift, sumo_home
from xodr.sumo_net.net import DOCK, LaneTrack, SignalLink, SumoNet

__all__ = ["DOCK", "LaneTrack", "SignalLink", "SumoNet", "build", "georeference", "lift", "sumo_home"]
