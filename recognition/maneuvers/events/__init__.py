"""The manoeuvre of a recognised event: who takes part, the values of its parameters, and the place where it has one.

The actor is who changes lane (in car following the lead, who changes its speed). In lane changes, at ramps, junctions and
roundabouts and in free cruise that is the ego, else the other one. Before the manoeuvre, everyone keeps its speed. What is no
such manoeuvre is refused by name.
"""

from recognition.maneuvers.events.event import Maneuvers
from recognition.maneuvers.events.maneuver import Conflict, Maneuver, Passage, Span

__all__ = ["Conflict", "Maneuver", "Maneuvers", "Passage", "Span"]
