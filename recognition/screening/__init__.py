"""Unknown-class screening (UCS): which samples belong to no known class, told from the votes of a forest, and from distances.

One file for each reading of the method; all have the contract of `base.Screening`.
"""

from recognition.screening.base import Screening
from recognition.screening.evt_deficit import EvtDeficit
from recognition.screening.evt_joint import EvtJoint
from recognition.screening.evt_pooled import EvtPooled
from recognition.screening.threshold import VoteThreshold
from recognition.screening.weibull import WeibullVotes

__all__ = ["EvtDeficit", "EvtJoint", "EvtPooled", "Screening", "VoteThreshold", "WeibullVotes"]
