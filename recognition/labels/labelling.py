"""Labelling of a recording: events of the 17 classes by all rules, and ways through junctions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from recognition.labels import rules
from recognition.labels.classes import LabelledEvent, Rules
from recognition.labels.scene import events, prepare
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
    return events(scene, name, [rule(scene) for rule in RULES]) if len(scene.track) else []


class JunctionWay(NamedTuple):
    """Time (s) that a vehicle is on its way through a junction, and whether the way is straight and crosses no other one."""

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
    found: dict[str, list[JunctionWay]] = {}
    if len(scene.track):
        ways, time = scene.passages, scene.time
        uncrossed = (
            ways.arrived & (np.abs(ways.turn) < np.radians(config.straight)) & ~rules.crosses(scene)
        )
        for first, last, alone in zip(
            ways.first.tolist(), ways.last.tolist(), uncrossed.tolist(), strict=True
        ):
            name = scene.names[scene.track[first]]
            found.setdefault(name, []).append(
                JunctionWay(float(time[first]), float(time[last]), alone)
            )
    return found
