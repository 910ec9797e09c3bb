"""Labelling of a recording: events of the 17 classes by all rules, and ways through junctions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from recognition.labels import rules
from recognition.labels.changes import always
from recognition.labels.classes import Label, LabelledEvent, Rules
from recognition.labels.scene import Hits, Scene, events, prepare
from recognition.scenes import Site
from runner.recording import Recording

RULES = (
    rules.free_cruise,
    rules.car_following,
    rules.cut_in,
    rules.cut_out,
    rules.lane_change_left,
    rules.lane_change_right,
    rules.ramp_entering,
    rules.ramp_exiting,
    rules.urban_cut_in,
    rules.urban_cut_out,
    rules.roundabout_entering,
    rules.roundabout_exiting,
    rules.roundabout_circulating,
    rules.left_turn,
    rules.right_turn,
    rules.straight_cross,
    rules.merging,
)
"""The rules in the order of the classes; each finds the events of one class in a scene."""


def label(
    recording: Recording,
    site: Site,
    name: str,
    config: Rules = Rules(),  # noqa: B008
) -> list[LabelledEvent]:
    """The events of a recording, by ego and time.

    The recording gets the road coordinates that it lacks.

    Args:
        name: of the recording, for the events.
        config: thresholds of the rules.
    """
    scene = prepare(recording, site, config)
    if not len(scene.track):
        return []
    return events(scene, name, [_certain(scene, rule(scene)) for rule in RULES])


BY_ROLE = (Label.RAMP_ENTERING, Label.RAMP_EXITING)
"""Classes that ask whether a lane is a ramp; changes of lanes beside them have to know that it is
none"""


def _certain(scene: Scene, hits: Hits) -> Hits:
    """Hits without those that depend on a role that is not sure."""
    if hits.label not in (*BY_ROLE, Label.LANE_CHANGE_LEFT, Label.LANE_CHANGE_RIGHT):
        return hits
    half = scene.rows(0.5 * scene.rules.window)
    sure = always(scene.certain, half, scene.first, scene.last)[hits.row]
    tags = {name: values[sure] for name, values in hits.tags.items()}
    return Hits(hits.label, hits.row[sure], hits.partner[sure], tags)


class JunctionWay(NamedTuple):
    """Time (s) that a vehicle is on its way through a junction, and whether the way is straight and
    crosses no other one."""

    start: float
    end: float
    uncrossed: bool


def passing(
    recording: Recording,
    site: Site,
    config: Rules = Rules(),  # noqa: B008
) -> dict[str, list[JunctionWay]]:
    """Ways of vehicles through junctions, by their names.

    Where no rule finds anything there, something may happen all the same: a way that bends by 20 to
    45 degrees is neither straight nor a turn, and one that is cut off may become either. Nothing
    happens on a whole straight way that no vehicle of the recording crosses.
    """
    scene = prepare(recording, site, config)
    passages: dict[str, list[JunctionWay]] = {}
    if len(scene.track):
        ways, time = scene.passages, scene.time
        uncrossed = (
            # NaN turns (too little was recorded) compare false: such ways are not called uncrossed.
            ways.arrived & (np.abs(ways.turn) < np.radians(config.straight)) & ~rules.crosses(scene)
        )
        for first, last, alone in zip(
            ways.first.tolist(), ways.last.tolist(), uncrossed.tolist(), strict=True
        ):
            name = scene.names[scene.track[first]]
            passages.setdefault(name, []).append(
                JunctionWay(float(time[first]), float(time[last]), alone)
            )
    return passages
