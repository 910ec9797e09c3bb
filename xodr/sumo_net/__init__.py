"""SUMO networks of OpenDRIVE files: `build(path)` converts, or finds what was converted before; see `SumoNet`."""

from xodr.sumo_net.convert import build
from xodr.sumo_net.net import SignalLink, SumoNet, Track
from xodr.sumo_net.netconvert import sumo_home
from xodr.sumo_net.plain import DOCK

__all__ = ["DOCK", "SignalLink", "SumoNet", "Track", "build", "sumo_home"]
