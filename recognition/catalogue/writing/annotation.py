"""What a scenario of the catalogue says about itself, as tags."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from recognition.catalogue.scenes.scenes import EGO, Part, Scene
from recognition.labels.classes import Label
from runner.measures.criticality import criticality
from runner.measures.relations import Motion
from xosc.tags import ASAM, Tag

MEASURES = {
    "min_ttc": "MinTimeToCollision",
    "min_thw": "MinTimeHeadway",
    "max_drac": "MaxDecelerationToAvoidCrash",
    "min_distance": "MinDistance",
    "pet": "PostEncroachmentTime",
}
"""Extremes of `runner.measures.criticality` and the tags for them; s, m and m/s²."""

_JUNCTION, _RING, _MOTORWAY = "JunctionIntersection", "JunctionRoundabout", "RoadTypeMotorway"
_CLASSES: dict[str, tuple[str, ...]] = {
    Label.FREE_CRUISE.title: ("MotionDrive", _MOTORWAY),
    Label.CAR_FOLLOWING.title: ("MotionDrive", _MOTORWAY),
    Label.CUT_IN.title: ("MotionCutIn", _MOTORWAY),
    Label.CUT_OUT.title: ("MotionCutOut", _MOTORWAY),
    Label.LANE_CHANGE_LEFT.title: ("MotionLaneChangeLeft",),
    Label.LANE_CHANGE_RIGHT.title: ("MotionLaneChangeRight",),
    Label.RAMP_ENTERING.title: ("MotionDrive", _MOTORWAY),
    Label.RAMP_EXITING.title: ("MotionDrive", _MOTORWAY),
    Label.URBAN_CUT_IN.title: ("MotionCutIn",),
    Label.URBAN_CUT_OUT.title: ("MotionCutOut",),
    Label.ROUNDABOUT_ENTERING.title: ("MotionDrive", _RING),
    Label.ROUNDABOUT_EXITING.title: ("MotionDrive", _RING),
    Label.ROUNDABOUT_CIRCULATING.title: ("MotionDrive", _RING),
    Label.LEFT_TURN.title: ("MotionTurnLeft", _JUNCTION),
    Label.RIGHT_TURN.title: ("MotionTurnRight", _JUNCTION),
    Label.STRAIGHT_CROSS.title: ("MotionDrive", _JUNCTION),
    Label.MERGING.title: ("MotionDrive", _JUNCTION),
}
"""What OpenLABEL's ontology has for a class, by the class's title"""
_PARTICIPANTS = {
    "car": "VehicleCar",
    "van": "VehicleVan",
    "truck": "VehicleTruck",
    "bus": "VehicleBus",
    "motorbike": "VehicleMotorcycle",
    "bicycle": "VehicleCycle",
    "pedestrian": "HumanPedestrian",
}


def measures(scene: Scene) -> dict[str, float | None]:
    """The ego's extremes of criticality in the recorded scene, by the names of `MEASURES`, and its shares of RSS violations.

    `collision_time` is when its box first touches another one, s from the scene's start: recorded sizes can be wrong.
    """
    ego, *others = (_motion(part, scene) for part in scene.parts)
    found = criticality(ego, others)
    extremes = {name: value["value"] if isinstance(value, dict) else value for name, value in found.summary.items()}
    return extremes | {"collision_time": found.impact.time - scene.start if found.impact is not None else None}


def _motion(part: Part, scene: Scene) -> Motion:
    """A participant within the scene."""
    columns = part.track.columns
    first, last = np.searchsorted(columns["time"], scene.start), np.searchsorted(columns["time"], scene.end, "right")
    return Motion.from_columns(part.name, part.track.box, {name: values[first:last] for name, values in columns.items()})


def tags(name: str, title: str, scene: Scene, facts: Mapping[str, Any]) -> list[Tag]:
    """The tags of a scenario.

    Args:
        name: of the scenario.
        title: of its class.
        facts: what else is known, by the names of the index's columns; None is left out.
    """
    named = {**facts, **{f"rule_{key}": value for key, value in facts["tags"].items()}}
    own = [Tag(_type(key), value) for key, value in named.items() if value is not None and key != "tags"]
    asam = ontology_tags(title, {part.track.category for part in scene.parts})
    return [*asam, Tag("scenarioName", name, ASAM), Tag("Ego", EGO), *own]


def ontology_tags(title: str, categories: Iterable[str]) -> list[Tag]:
    """What OpenLABEL's ontology has for a class, by its title, and for the categories of participants."""
    participants = sorted(_PARTICIPANTS[each] for each in set(categories) & _PARTICIPANTS.keys())
    return [Tag(each, None, ASAM) for each in (*_CLASSES.get(title, ("MotionDrive",)), *participants)]


def _type(name: str) -> str:
    """Name of a column as that of a tag."""
    return MEASURES.get(name) or "".join(word[:1].upper() + word[1:] for word in name.split("_"))
