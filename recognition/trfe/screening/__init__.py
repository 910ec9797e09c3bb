"""Unknown-class screening (UCS): which samples belong to no known class, told from the votes of a forest, and from distances.

One file for each reading of the method; all have the contract of `base.Screening`.
"""

from recognition.trfe.screening.base import Screening
from recognition.trfe.screening.evt_deficit import EvtDeficit
from recognition.trfe.screening.evt_joint import EvtJoint
from recognition.trfe.screening.evt_pooled import EvtPooled
from recognition.trfe.screening.threshold import VoteThreshold
from recognition.trfe.screening.weibull import WeibullVotes

__all__ = ["EvtDeficit", "EvtJoint", "EvtPooled", "Screening", "VoteThreshold", "WeibullVotes"]
