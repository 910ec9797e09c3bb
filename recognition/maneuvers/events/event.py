"""Which manoeuvre an event is."""

from __future__ import annotations

from recognition.labels.classes import Label
from recognition.maneuvers.events.lanes import KINDS, in_lanes
from recognition.maneuvers.events.maneuver import Maneuver, Span
from recognition.maneuvers.events.passages import JUNCTION, ROUNDABOUT, passage
from runner.recording import Recording
from schemas.errors import Unsupported
from xodr.network import RoadNetwork


def maneuver(recording: Recording, network: RoadNetwork, label: Label, ego: str, partner: str | None, span: Span) -> Maneuver:
    """The manoeuvre of an event.

    Args:
        network: the roads that the recording's road coordinates are on.
        partner: whom the event is about besides the ego.

    Raises:
        Unsupported: the class is none of the 17, or what was recorded is no manoeuvre that the parameters describe.
    """
    if label in KINDS:
        return in_lanes(recording, network, KINDS[label], ego, partner, span)
    if label in JUNCTION or label in ROUNDABOUT:
        return passage(recording, network, label, ego, partner, span)
    raise Unsupported("which manoeuvre this is can't be told: its class, unknown or discovered, is none of the 17")
