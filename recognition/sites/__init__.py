"""Sites: where recordings were made, with their roads and what each lane is for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from recognition.datasets import Source
from recognition.sites.lanes import LaneGraph, graph
from recognition.sites.proposal import propose
from recognition.sites.roles import Entry, Role, Roles, roles_beside
from runner.recording import Recording
from schemas.errors import UsageError
from xodr.network import RoadNetwork
from xodr.reader import load

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


def site_at(path: Path, network: RoadNetwork | None = None) -> Site:
    """The site with this OpenDRIVE file; its roles are those in the file beside it, proposed and written there where it is new.

    Args:
        network: what the file describes, where it is loaded already.

    Raises:
        InvalidFile: the map or the roles are malformed, or don't fit each other.
    """
    network = network or load(path)
    return Site(path, network, roles_beside(network, propose(network, graph(network))))


def site_of(source: Source, recording: Recording, roads: Path) -> Site:
    """The site of a recording.

    Args:
        source: where the recording is from.
        roads: folder for roads that have to be made.

    Raises:
        UsageError: nothing tells of the roads.
    """
    if recording.network is not None:
        return site_at(Path(recording.network.path), recording.network)
    beside = source.path.parent / f"{source.site}.xodr"
    if beside.is_file():
        return site_at(beside)
    raise UsageError(f"nothing tells of the roads of {source.name}", path=source.path)
