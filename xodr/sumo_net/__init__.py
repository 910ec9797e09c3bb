"""SUMO networks of OpenDRIVE files: `build(path)` converts, or finds what was converted before; see `SumoNet`."""

from xodr.sumo_net.building import build, sumo_home
from xodr.sumo_net.net import DOCK, SignalLink, SumoNet, Track

__all__ = ["DOCK", "SignalLink", "SumoNet", "Track", "build", "sumo_home"]
