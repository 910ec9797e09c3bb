"""The cut-in of the library with the knots of a trajectory as its parameters."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from scenariogeneration import xosc as sg

import xodr
from generation.search.variations import AUTHOR
from generation.space.logical.library import ROADS, SCENARIOS
from generation.space.logical.maneuvers import EGO, MANEUVERS
from generation.space.logical.roads import GEOMETRIES
from generation.space.space import Space
from recognition.labels.maneuvers.parameters import PARAMETERS, declared_name
from schemas.common.array_types import FloatArray
from schemas.common.errors import UsageError
from studies.generation.knots.motion import NUMBER, Setting, box, knots_of, weights
from xosc.document import Document
from xosc.exports import standard
from xosc.exports.draft import DEFAULTS, Draft, Folder
from xosc.writing import maneuvers
from xosc.writing.maneuvers import FileHeader
from xosc.writing.maneuvers.entities import Number

LOGICAL = "cut_in_highway"
"""The logical scenario that this is the trajectory-level one of."""
_PLACE, _ACTOR, _SPEED = GEOMETRIES["highway"], MANEUVERS["cut_in"].actor, f"{EGO}_Speed_mps"
_DATE = datetime(2026, 11, 21)
_START = 600.0
"""s (m) of the ego at the beginning: no trajectory of the box leaves the road"""
_PIECES = 30
"""Straight pieces of a trajectory in the file"""
TIME = f"{_ACTOR}_SceneTime_s"
AHEAD = tuple(f"{_ACTOR}_Ahead{number}_m" for number in range(NUMBER))
ASIDE = tuple(f"{_ACTOR}_Aside{number}_m" for number in range(1, NUMBER - 1))


def setting_of(scenario: Path, space: Space) -> Setting:
    """Return the description of trajectories for a logical scenario.

    Raises:
        UsageError: there are none beside this scenario, or beside a part of its parameters.
    """
    seven = tuple(declared_name(_ACTOR, role) for role in PARAMETERS)
    if scenario.stem != LOGICAL or space.names != seven:
        raise UsageError(
            f"No-Maneuver has trajectories in the place of all seven parameters of {LOGICAL} only",
            path=scenario,
        )
    road = xodr.load(ROADS / f"{_PLACE.file}.xodr").roads[_PLACE.road]
    widths = [road.lane_width(_PLACE.spot, lane) for lane in (_PLACE.left, _PLACE.right)]
    return Setting(float(space.pinned[_SPEED]), 0.5 * sum(widths))


def write(folder: Path, space: Space, setting: Setting) -> Path:
    """Write the scenario with its road and catalogue into a folder; its path.

    Args:
        space: of the seven parameters, whose manoeuvres say how far knots may go.

    Raises:
        UsageError: another file is in the way.
    """
    name = f"{LOGICAL}_knots.xosc"
    standard.scenario(
        _document(SCENARIOS / name, space, setting), None, Draft(Folder(folder), DEFAULTS)
    )
    return folder / name


def _document(path: Path, space: Space, setting: Setting) -> Document:
    stop = [
        [maneuvers.collision(EGO, _ACTOR)],
        [maneuvers.simulation_time(f"${TIME}", "greaterOrEqual")],
    ]
    return maneuvers.scenario(
        path,
        FileHeader(
            "A vehicle cuts in from the left in front of the ego along a trajectory, on a "
            "straight motorway",
            AUTHOR,
            _DATE,
        ),
        road=f"../../xodr/library/{_PLACE.file}.xodr",
        entities={name: maneuvers.reference("vehicle_catalog", "car") for name in (EGO, _ACTOR)},
        init={
            EGO: [maneuvers.teleport(_position(_START)), maneuvers.speed(f"${_SPEED}")],
            _ACTOR: [
                maneuvers.teleport(_vertices(setting)[0][1]),
                maneuvers.follow_trajectory(_trajectory(setting)),
            ],
        },
        parameters=_parameters(space, setting),
        catalogs={"Vehicle": "catalogs/vehicles"},
        stop=stop,
    )


def _parameters(space: Space, setting: Setting) -> list[Any]:
    """The knots within what the manoeuvres reach, by default those of the middle one; the ego's
    speed."""
    middle = knots_of(0.5 * (space.low + space.high), setting)[0]
    columns = zip((TIME, *AHEAD, *ASIDE), middle.tolist(), *box(space, setting), strict=True)
    knots = [
        maneuvers.parameter(
            name,
            "double",
            round(value, 3),
            [[("greaterOrEqual", float(low)), ("lessOrEqual", float(high))]],
        )
        for name, value, low, high in columns
    ]
    return [*knots, maneuvers.parameter(_SPEED, "double", setting.ego_speed)]


def _trajectory(setting: Setting) -> Any:
    times, positions = zip(*_vertices(setting), strict=True)
    built = sg.Trajectory("cut in", False)
    built.add_shape(sg.Polyline(list(times), list(positions)))
    return built


def _vertices(setting: Setting) -> list[tuple[str, Any]]:
    """Times and positions as expressions of the parameters."""
    shares = np.linspace(0.0, 1.0, _PIECES + 1)
    return [
        (
            f"${{{share:.6g} * ${TIME}}}",
            _position(
                f"${{{_START} + {share:.6g} * ${_SPEED} * ${TIME}{_sum(row, AHEAD)}}}",
                f"${{{row[0] * setting.aside:.6g}{_sum(row[1:-1], ASIDE)}}}",
            ),
        )
        for share, row in zip(shares.tolist(), weights(shares), strict=True)
    ]


def _sum(row: FloatArray, names: tuple[str, ...]) -> str:
    """Weighted parameters, to be added."""
    return "".join(
        f" {'-' if weight < 0.0 else '+'} {abs(weight):.6g} * ${name}"
        for weight, name in zip(row, names, strict=True)
    )


def _position(s: Number, offset: Number = 0.0) -> Any:
    """Somewhere in or beside the ego's lane."""
    return maneuvers.lane_position(_PLACE.road, _PLACE.right, s, offset)
