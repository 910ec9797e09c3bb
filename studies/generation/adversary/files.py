"""Failures that an adversary has found as scenarios of the standard: the actor follows a trajectory
with times.

The ego begins where and as fast as it did in the episode, with its system under test; no search and
no policy is needed to see the failure again, by `xosc-run FILE --sut NAME`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from lxml import etree

import xosc
from runner.judging.execution import prepare
from runner.judging.settings import RunSettings
from schemas.common.array_types import FloatArray
from schemas.common.errors import InvalidFile
from studies.generation.adversary.course import START, Scene
from studies.generation.adversary.environment import Episodes
from xodr.model.road import Road
from xosc.document import Document, to_bytes
from xosc.exports import standard
from xosc.exports.concrete import concrete
from xosc.exports.draft import ExportSettings, Folder, roads_in
from xosc.writing import maneuvers
from xosc.writing.tags import Tag, annotated
from xosc.writing.tags import to_bytes as as_openlabel

_AS_USUAL = RunSettings()

AUTHOR = "xosc-toolchain"


class Writer:
    """Writes scenarios into a folder, with a copy of the road.

    Args:
        scenario: the manoeuvre scenario whose actor is the adversary. scene: of it. folder: where
            to; nothing is overwritten.
        dt: time step of the episodes, s. run: where road networks and catalogues are that are not
            where the scenario says.

    Raises:
        UsageError: something else is in the way there.
    """

    def __init__(
        self, scenario: Path, scene: Scene, folder: Path, dt: float, run: RunSettings = _AS_USUAL
    ) -> None:
        document = xosc.load(scenario)
        self._scene, self._folder, self._dt, self._stem = scene, Folder(folder), dt, scenario.stem
        settings = ExportSettings(roads=roads_in(*run.road_path), catalog_path=run.catalog_path)
        standard.export(scenario, ".".join(map(str, document.version)), self._folder, settings)
        network = prepare(folder / scenario.name).scenario.network
        assert network is not None
        self._road = next(iter(network.roads.values()))
        self._base = concrete(xosc.load(folder / scenario.name))

    def write(self, episodes: Episodes, row: int, number: int, tags: Sequence[Tag]) -> Path:
        """Write an episode; the path of its scenario, with tags in it and beside it."""
        path = self._folder.path / f"{self._stem}_adversary_{number:06d}.xosc"
        document = _replaced(
            replace(self._base, path=path),
            self._storyboard(episodes.starts[row], episodes.ways[row]),
        )
        self._folder.write(f"{path.stem}.openlabel.json", as_openlabel(tags, path.name, AUTHOR))
        self._folder.write(path.name, to_bytes(annotated(document, tags)))
        return path

    def remove(self, path: Path) -> None:
        """Remove what `write` wrote."""
        path.unlink()
        path.with_suffix(".openlabel.json").unlink()

    def _storyboard(self, start: FloatArray, way: FloatArray) -> etree._Element:
        scene, road = self._scene, self._road
        ego, actor = scene.ego.name, scene.actor.name
        _, speed, ego_speed = (float(each) for each in start)
        places = [_place(road, float(s), float(t)) for s, t in way]
        turns = [
            _turn(road, a, b)
            for a, b in zip(places[:1] + places[:-1], places[:1] + places[1:], strict=True)
        ]
        times = [round(step * self._dt, 9) for step in range(len(way))]
        x, y = zip(*places, strict=True)
        follow = maneuvers.follow_trajectory(
            maneuvers.trajectory(actor, times, x, y, h=turns), domain="absolute"
        )
        begins = maneuvers.simulation_time(0.0, "greaterOrEqual")
        init: dict[str, list[Any]] = {
            ego: [
                maneuvers.teleport(maneuvers.lane_position(road.id, scene.lane, START)),
                maneuvers.speed(ego_speed),
            ],
            actor: [
                maneuvers.teleport(maneuvers.world_position(x[0], y[0], h=turns[0])),
                maneuvers.speed(speed),
            ],
        }
        return maneuvers.storyboard(
            init,
            [
                (
                    actor,
                    maneuvers.maneuver("adversary", [maneuvers.event("follow", [follow], begins)]),
                )
            ],
            [
                [maneuvers.collision(ego, actor)],
                [maneuvers.simulation_time(times[-1], "greaterOrEqual")],
            ],
        )


def _place(road: Road, s: float, t: float) -> tuple[float, float]:
    pose = road.pose(s, t)
    return pose.x, pose.y


def _turn(road: Road, before: tuple[float, float], after: tuple[float, float]) -> float:
    """Heading (rad) of the way between two places; the road's, where one stands."""
    dx, dy = after[0] - before[0], after[1] - before[1]
    return math.atan2(dy, dx) if math.hypot(dx, dy) > 1e-6 else road.heading(START)


def _replaced(document: Document, storyboard: etree._Element) -> Document:
    """The document with another storyboard."""
    root = document.root
    before = root.find("Storyboard")
    if before is None:
        raise InvalidFile("there is no Storyboard", path=document.path)
    root.replace(before, storyboard)
    return document
