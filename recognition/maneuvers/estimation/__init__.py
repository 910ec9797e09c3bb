"""Estimating the parameters from recorded motion: when a lane change begins and ends, the gap, the speeds; and back.

`lane_changes` says when, `estimate` gives the values of a unit's parameters; `reconstruct` is the motion that they stand for,
`errors` how far it is from the recorded one.
"""

from recognition.maneuvers.estimation.estimate import Estimate, estimate
from recognition.maneuvers.estimation.lane_change import LaneChange, lane_changes
from recognition.maneuvers.estimation.motion import LaneMotion, lane_motion
from recognition.maneuvers.estimation.reconstruction import Errors, errors, reconstruct

__all__ = [
    "Errors",
    "Estimate",
    "LaneChange",
    "LaneMotion",
    "errors",
    "estimate",
    "lane_changes",
    "lane_motion",
    "reconstruct",
]
