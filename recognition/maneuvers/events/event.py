"""Which manoeuvre an event is."""

from __future__ import annotations

from functools import cached_property

from recognition.labels.classes import Label
from recognition.labels.rules import Rules
from recognition.labels.scene.scene import prepare
from recognition.maneuvers.estimation.motion import lane_motion
from recognition.maneuvers.events.lanes import KINDS, in_lanes
from recognition.maneuvers.events.maneuver import Maneuver, Span
from recognition.maneuvers.events.passages import JUNCTION, ROUNDABOUT, passage
from recognition.maneuvers.units.segmentation import Segmentation
from recognition.sites import Site
from runner.recording import Recording
from schemas.errors import Unsupported


class Maneuvers:
    """The manoeuvres of a recording's events.

    Args:
        site: where it was recorded; its network is the one that the recording's road coordinates are on.
    """

    def __init__(self, recording: Recording, site: Site) -> None:
        self._recording, self._site = recording, site

    @cached_property
    def _segmentation(self) -> Segmentation:
        return Segmentation(lane_motion(prepare(self._recording, self._site, Rules())))

    def of(self, label: Label, ego: str, partner: str | None, span: Span) -> Maneuver:
        """The manoeuvre of an event.

        Args:
            partner: whom the event is about besides the ego.

        Raises:
            Unsupported: the class is none of the 17, or what was recorded is no manoeuvre that the parameters describe.
        """
        if label in KINDS:
            return in_lanes(self._segmentation, KINDS[label], ego, partner, span)
        if label in JUNCTION or label in ROUNDABOUT:
            return passage(self._recording, self._site.network, label, ego, partner, span)
        raise Unsupported("the manoeuvre is unknown: its class, unknown or discovered, is none of the 17")
