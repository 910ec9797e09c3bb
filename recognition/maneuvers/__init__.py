"""The manoeuvre in a recorded scene, as seven numbers: gap, speeds, times. What is no such manoeuvre is refused by name.

The actor is who changes lane (in car following the lead, who changes its speed). In lane changes, at ramps, junctions and
roundabouts and in free cruise that is the ego, else the other one. Before the manoeuvre, everyone is taken to keep its speed.
"""

from recognition.maneuvers.measuring import maneuver
from recognition.maneuvers.record import Maneuver, Meeting, Passage, Seven, Span

__all__ = ["Maneuver", "Meeting", "Passage", "Seven", "Span", "maneuver"]
