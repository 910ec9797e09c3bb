"""Unknown-class screening (UCS): which samples belong to no known class, by the votes of a forest and by distances."""

from recognition.trfe.screening.base import Screening
from recognition.trfe.screening.evt_joint import EvtJoint

__all__ = ["EvtJoint", "Screening"]
