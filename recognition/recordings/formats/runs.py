"""Results of this project's own runs: folders with `trajectories.parquet` and `result.json`, as
`xosc-run --out` writes them.

The road network is the file that the run was on, where it is still there. The scenario's
first EnvironmentAction gives weather, daylight and surface.
"""

from __future__ import annotations

import math
import os
from functools import partial
from pathlib import Path

import numpy as np

import xosc
from recognition.recordings.conditions import UNKNOWN, OddConditions, phase_of
from recognition.recordings.intake import Report
from recognition.recordings.rows import Clock, cut, in_order
from recognition.recordings.source import SiteRoad, Source, TrackParticipant
from recognition.recordings.table import Kind, read_table
from runner.batch.outputs.folder import RESULT, TRAJECTORIES, read_setup
from runner.engine.worlds.surroundings import Environment
from runner.recording import COLUMNS, Recording
from schemas.common.errors import InvalidFile, ToolchainError
from schemas.common.storage import read_object
from xodr.graph.network import RoadNetwork
from xodr.reader import load
from xosc.document.node import Node
from xosc.resolve import resolve

FORMAT = "run"
TITLE = "results of xosc-run"
BY_CONTENT = False
_KINDS: dict[str, Kind] = {
    "entity": "text",
    **dict.fromkeys(COLUMNS, "number"),
    "road_id": "label",
    "lane_id": "integer",
}
_PER_SECOND = 1e6
"""Times are compared in µs."""


def claims(path: Path) -> bool:
    """Whether a file is the trajectories of a run."""
    return path.name == TRAJECTORIES and path.with_name(RESULT).is_file()


def sources(path: Path, roads: Path) -> list[Source]:
    """The run that a trajectory file belongs to; runs of one scenario have one site."""
    name = path.parent.name
    return [
        Source(
            name,
            name.partition("~")[0],
            FORMAT,
            path,
            partial(_read, path),
            simulated=True,
            road=lambda recording, folder: SiteRoad(road(path)),
            ego=partial(ego, path),
            odd=partial(_conditions, path),
        )
    ]


def road(path: Path) -> Path:
    """The OpenDRIVE file of the run that a trajectory file belongs to.

    Raises:
        InvalidFile: the run had none, or it is not there any more.
    """
    return _there("road", read_setup(path.with_name(RESULT)).road, path)


def scenario(path: Path) -> Path:
    """The scenario that a trajectory file is the run of.

    Raises:
        InvalidFile: it is not there any more.
    """
    return _there("scenario", read_setup(path.with_name(RESULT)).scenario, path)


def ego(path: Path) -> str | None:
    """Name of the ego of the run that a trajectory file belongs to; None where it has none."""
    return read_setup(path.with_name(RESULT)).ego


_WETNESS = {
    "dry": "dry", "moist": "wet", "wetWithPuddles": "standing water", "lowFlooded": "flooded",
    "highFlooded": "flooded",
}  # fmt: skip
"""Surface by the standard's wetness (from version 1.2 on)"""
_CLEAR = ("free", "zeroOktas", "oneOktas", "twoOktas")
"""Clouds of a clear sky: up to two eighths"""
_FOG = 1000.0
"""Visual range (m) below which it is foggy, by meteorology"""


def _conditions(path: Path) -> OddConditions:
    """Conditions that the scenario of a run sets first, with the parameters of the run; unknown
    where the scenario, or a catalogue that it names, is not there any more."""
    result = path.with_name(RESULT)
    file = read_setup(result).scenario
    if not os.path.isfile(file):
        return OddConditions()
    given = {
        name: text
        for name, text in read_object(result).get("parameters", {}).items()
        if isinstance(text, str)
    }
    try:
        found = resolve(xosc.load(file), given, enforce_constraints=False)
    except ToolchainError:
        return OddConditions()
    action = next(found.node.iter("EnvironmentAction"), None)
    environment = action.find("Environment") if action is not None else None
    return OddConditions() if environment is None else _of_environment(environment)


def _of_environment(environment: Node) -> OddConditions:
    """Weather, daylight and surface of an Environment, as far as it states them."""
    stated = Environment().after(environment, 0.0).weather
    falls = stated.get("Precipitation.precipitationType", "dry")
    amount = stated.get(
        "Precipitation.precipitationIntensity", stated.get("Precipitation.intensity", "0")
    )
    clouds = stated.get("fractionalCloudCover", stated.get("cloudState", "skyOff"))
    weather = "clear" if clouds in _CLEAR else UNKNOWN if clouds == "skyOff" else "cloudy"
    if falls in ("rain", "snow") and float(amount) > 0.0:
        weather = falls
    elif float(stated.get("Fog.visualRange", "inf")) < _FOG:
        weather = "fog"
    sun = stated.get("Sun.elevation")
    daylight = UNKNOWN if sun is None else phase_of(math.degrees(float(sun)))
    road = environment.find("RoadCondition")
    wetness = road.get("wetness", "") if road is not None else ""
    return OddConditions(weather, daylight, _WETNESS.get(wetness, UNKNOWN))


def _there(what: str, file: Path | None, path: Path) -> Path:
    if file is None:
        raise InvalidFile(f"the run has no {what}", path=path.with_name(RESULT))
    if not os.path.isfile(file):  # unlike Path.is_file it takes names of any length
        raise InvalidFile(
            f"the {what} of this run, {file}, is not there", path=path.with_name(RESULT)
        )
    return file


def _read(path: Path) -> tuple[Recording, Report]:
    setup = read_setup(path.with_name(RESULT))
    table = read_table(path, _KINDS)
    names = list(dict.fromkeys(table["entity"]))
    absent = set(names) - setup.entities.keys()
    if absent:
        raise InvalidFile(f"{min(absent)!r} is not among the entities of {RESULT}", path=path)
    number = {name: index for index, name in enumerate(names)}
    track = np.fromiter((number[name] for name in table["entity"]), np.int64, len(table))
    # Times were written as decimal fractions of a second: rounded, they are whole steps again.
    clock = Clock(
        "time", np.round(table["time"] * _PER_SECOND).astype(np.int64), _PER_SECOND, setup.timestep
    )
    rows = in_order(table, track, clock, names=names)
    who = [TrackParticipant(name, *setup.entities[name][:3]) for name in names]
    # Runs have no measurement noise: nothing is smoothed.
    columns = {name: table[name][rows.order] for name in COLUMNS}
    report = rows.report(names)
    return Recording(cut(rows, who, columns), setup.timestep, _network(setup.road, report)), report


def _network(road: Path | None, report: Report) -> RoadNetwork | None:
    if road is None:
        return None
    if os.path.isfile(road):
        return load(road)
    report.remarks.append(f"the road network {road} is not there any more")
    return None
