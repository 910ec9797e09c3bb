"""Recordings as units of manoeuvres, for densities.

`segment` finds the units of a recording, `extract` gives those of a whole data set with the values of their parameters
(`recognition.maneuvers.estimation`) as a table, `Samples`.
"""

from recognition.maneuvers.unit import ACCELERATION, BRAKING, CUT_IN, CUT_OUT, KINDS, LANE_CHANGE, Unit
from recognition.maneuvers.units.exposure import Exposure
from recognition.maneuvers.units.extraction import extract, extract_from
from recognition.maneuvers.units.samples import OWN, Samples
from recognition.maneuvers.units.segmentation import Segmentation, Thresholds, segment

__all__ = [
    "ACCELERATION",
    "BRAKING",
    "CUT_IN",
    "CUT_OUT",
    "KINDS",
    "LANE_CHANGE",
    "OWN",
    "Exposure",
    "Samples",
    "Segmentation",
    "Thresholds",
    "Unit",
    "extract",
    "extract_from",
    "segment",
]
