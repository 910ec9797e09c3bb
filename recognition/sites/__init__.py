"""Sites: where recordings were made, with their roads and what each lane is for."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from recognition.datasets import Source
from recognition.sites.fit import require_fit
from recognition.sites.lanes import LaneGraph, graph
from recognition.sites.maps import map_of
from recognition.sites.proposal import propose
from recognition.sites.roles import Entry, Role, Roles, roles_of
from runner.recording import Recording
from xodr.network import RoadNetwork
from xodr.reader import load

_FREE = 0.95
"""Quantile of the speeds of motor vehicles at which one drives freely, if any does"""

__all__ = ["Entry", "Role", "Roles", "Site", "site_at", "site_of"]


@dataclass(frozen=True, eq=False)
class Site:
    """A place of recordings.

    Attributes:
        path: its OpenDRIVE file.
        network: the roads in it.
        roles: what its lanes are for.
    """

    path: Path
    network: RoadNetwork
    roles: Roles

    @property
    def lanes(self) -> LaneGraph:
        """The lanes of its roads."""
        return graph(self.network)


def site_at(
    path: Path,
    network: RoadNetwork | None = None,
    lights: frozenset[str] = frozenset(),
    folder: Path | None = None,
    driven: float = math.inf,
) -> Site:
    """The site with this OpenDRIVE file; its roles are those in an edited file, else proposed ones.

    Args:
        network: what the file describes, where it is loaded already.
        lights: roads that traffic lights are for, besides those with signals.
        folder: where proposals are written, to be edited; by default beside the map.
        driven: speed (m/s) that free vehicles have there; it decides about roads of which the map gives neither kind nor limit.

    Raises:
        InvalidFile: the map or the roles are malformed, or don't fit each other.
    """
    network = network or load(path)
    return Site(path, network, roles_of(network, propose(network, graph(network), lights, driven), folder or path.parent))


def site_of(source: Source, recording: Recording, roads: Path) -> Site:
    """The site of a recording. What was assumed, changed or left out to make its road joins the remarks of the source's report.

    highD: the road that the recording brings along. Own runs: theirs. Others: `<site>.xodr` beside the tracks, else a road made
    of the site's Lanelet2 map, of the scenario's lanelets (CommonRoad), or of the lateral positions (NGSIM tables).

    Args:
        source: where the recording is from.
        roads: folder for roads that have to be made, and for proposed roles.

    Raises:
        InvalidFile: a map or its roles are malformed, or don't fit each other, or the map is that of another place.
        UsageError: the source has no information about its roads.
    """
    road = map_of(source, recording, roads)
    if source.report is not None:
        source.report.remarks += (note for note in road.notes if note not in source.report.remarks)
    network = recording.network or load(road.path)
    lights = frozenset(network.roads) if road.signalised else road.lights
    site = site_at(road.path, network, lights, roads, _driven(recording))
    if recording.network is None:
        require_fit(recording, site.network, (source.map or road.path).name, source.path)
    return site


def _driven(recording: Recording) -> float:
    """Speed (m/s) of the free motor vehicles of a recording; infinite without any."""
    motor = [track for track in recording.tracks.values() if track.kind == "vehicle" and track.category != "bicycle"]
    speeds = [np.abs(track.columns["speed"]) for track in motor]
    return float(np.quantile(np.concatenate(speeds), _FREE)) if speeds else math.inf
