"""Labels: which of the 17 classes of scenarios happen when in a recording, by the rules of METHOD.md §2.

No label comes from anything but the recorded motion and the roles of the lanes it is on.
"""

from __future__ import annotations

from recognition.labels import highway, junction, ramps, roundabout, urban
from recognition.labels.classes import Event, Label, counts
from recognition.labels.hits import events
from recognition.labels.rules import Rules
from recognition.labels.scene.scene import prepare
from recognition.sites import Site
from runner.recording import Recording

__all__ = ["Event", "Label", "Rules", "counts", "label"]

RULES = (
    highway.free_cruise,
    highway.car_following,
    highway.cut_in,
    highway.cut_out,
    highway.lane_change_left,
    highway.lane_change_right,
    ramps.ramp_entering,
    ramps.ramp_exiting,
    urban.urban_cut_in,
    urban.urban_cut_out,
    roundabout.roundabout_entering,
    roundabout.roundabout_exiting,
    roundabout.roundabout_circulating,
    junction.left_turn,
    junction.right_turn,
    junction.straight_cross,
    junction.merging,
)
"""The rules in the order of the classes; each finds the events of one class in a scene."""


def label(recording: Recording, site: Site, name: str, config: Rules = Rules()) -> list[Event]:  # noqa: B008 - frozen
    """The events of a recording, by ego and time.

    The recording gets the road coordinates that it lacks.

    Args:
        name: of the recording, for the events.
        config: thresholds of the rules.
    """
    scene = prepare(recording, site, config)
    return events(scene, name, [rule(scene) for rule in RULES]) if len(scene.track) else []
