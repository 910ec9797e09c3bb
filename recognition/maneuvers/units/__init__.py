"""Recordings as units of manoeuvres with the seven parameters, and back.

`segment` finds the units of a recording, `parameters_of` gives their parameters, `extract` both for a whole data set;
`reconstruct` is the motion that a logical scenario makes of the parameters, `errors` how far it is from what was recorded.
"""

from recognition.maneuvers.estimation.motion import LaneMotion, lane_motion
from recognition.maneuvers.estimation.reconstruction import Errors, errors, reconstruct
from recognition.maneuvers.unit import ACCELERATION, BRAKING, CUT_IN, CUT_OUT, KINDS, LANE_CHANGE, Unit
from recognition.maneuvers.units.extraction import extract, extract_from, parameters_of
from recognition.maneuvers.units.samples import OWN, Samples
from recognition.maneuvers.units.segmentation import Thresholds, segment

__all__ = [
    "ACCELERATION",
    "BRAKING",
    "CUT_IN",
    "CUT_OUT",
    "KINDS",
    "LANE_CHANGE",
    "OWN",
    "Errors",
    "LaneMotion",
    "Samples",
    "Thresholds",
    "Unit",
    "errors",
    "extract",
    "extract_from",
    "lane_motion",
    "parameters_of",
    "reconstruct",
    "segment",
]
