"""SUMO networks of OpenDRIVE files: `build(path)` converts, or finds what was converted before; see `SumoNet`."""

from xodr.sumo_net.building import build
from xodr.sumo_net.net import DOCK, SignalLink, SumoNet, Track
from xodr.sumo_net.netconvert import sumo_home

__all__ = ["DOCK", "SignalLink", "SumoNet", "Track", "build", "sumo_home"]
