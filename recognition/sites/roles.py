"""What the lanes of a site are for: the roles that labelling rules ask for, and the file that keeps them.

`<map>.roles.json` lies beside the map, or in the folder for what is made of recordings. It lists a role for every lane of
every road, or for stretches of a lane:

    {"roles": [{"road": "1", "lane": -1, "role": "main"},
               {"road": "2", "lane": -3, "from": 0.0, "to": 250.0, "role": "on_ramp"}, …]}

A file that a person has edited is only read: its `proposal` entry, a digest of the roles as they were proposed, then no longer
fits, and it is neither renewed nor overwritten. An unedited file is renewed when the map or the proposal changes.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from recognition.sites.lanes import LaneGraph
from schemas.errors import InvalidFile
from schemas.storage import digest, keep, read_object
from xodr.array_types import FloatArray, IntArray
from xodr.network import RoadNetwork

ENDING = ".roles.json"
_HELP = "edit the file, or delete it to have roles proposed anew"
_TOLERANCE = 0.01
"""Stretches may miss the ends of a road by this, m: files round."""


class Role(StrEnum):
    """What a lane is for."""

    MAIN = "main"
    """through lane of a motorway or another road faster than 70 km/h"""
    ON_RAMP = "on_ramp"
    """lane that leads onto main lanes, the acceleration lane included"""
    OFF_RAMP = "off_ramp"
    """lane that leads off main lanes, the deceleration lane included"""
    WEAVING = "weaving"
    """lane from an on-ramp to an off-ramp, which is part of both"""
    URBAN = "urban"
    """lane of a road with a limit of at most 70 km/h"""
    APPROACH = "approach"
    """urban lane that leads to a junction or roundabout"""
    INSIDE = "inside"
    """lane through a junction without traffic lights"""
    SIGNALISED = "signalised"
    """lane through a junction with traffic lights"""
    ENTRY = "entry"
    """lane from an approach into a roundabout's ring"""
    RING = "ring"
    """lane of a roundabout's ring"""
    EXIT = "exit"
    """lane out of a roundabout's ring"""
    OTHER = "other"
    """lane that no rule asks for"""


ROLES = tuple(Role)
"""All roles; their indices are the codes of `Roles.codes`."""


class Entry(NamedTuple):
    """The role of a lane of a road, from one s to another (m)."""

    road: str
    lane: int
    start: float
    end: float
    role: Role


@dataclass(frozen=True)
class Roles:
    """Roles of all driving lanes of one map. Lanes without an entry (shoulders, pavements) have the role `other`."""

    entries: tuple[Entry, ...]

    def codes(self, graph: LaneGraph, strip: IntArray, s: FloatArray) -> IntArray:
        """Index into `ROLES` of each row's role; rows on no strip have that of `other`."""
        other = ROLES.index(Role.OTHER)
        found = np.full(len(graph.strips) + 1, other, np.int64)
        parts: list[tuple[int, Entry]] = []
        for entry in self.entries:
            for number in graph.numbers(entry.road, entry.lane, entry.start, entry.end):
                piece = graph.strips[number]
                if entry.start <= piece.start + _TOLERANCE and entry.end >= piece.end - _TOLERANCE:
                    found[number] = ROLES.index(entry.role)
                else:
                    parts.append((number, entry))
        codes = found[strip]
        for number, entry in parts:
            codes[(strip == number) & (s >= entry.start) & (s <= entry.end)] = ROLES.index(entry.role)
        return codes


def roles_of(network: RoadNetwork, proposed: Sequence[Entry], folder: Path) -> Roles:
    """The roles in an edited file, beside the map or in a folder for proposals; without one those proposed, which are written
    into that folder if it allows.

    Raises:
        InvalidFile: an edited file is malformed, or does not fit the map; names the entry.
    """
    beside = Path(network.path).with_suffix(ENDING)
    own = folder / beside.name
    for path in dict.fromkeys((beside, own)):
        if path.is_file():
            document = _document(path)
            if document.get("proposal") != _digest(document.get("roles")):
                return Roles(tuple(_checked(document.get("roles"), network, path)))
    proposal = Roles(tuple(proposed))
    _keep(_text(proposal), own)
    return proposal


# writing ------------------------------------------------------------------------------------


def _text(roles: Roles) -> str:
    listed = [
        {"road": entry.road, "lane": entry.lane, "from": entry.start, "to": entry.end, "role": str(entry.role)}
        for entry in roles.entries
    ]
    lines = ",\n  ".join(json.dumps(one, ensure_ascii=False) for one in listed)
    return f'{{"proposal": "{_digest(listed)}",\n "roles": [\n  {lines}\n]}}\n'


def _digest(listed: object) -> str:
    return digest(json.dumps(listed, sort_keys=True).encode())


def _keep(text: str, path: Path) -> None:
    with suppress(OSError):  # a folder for reading only keeps no file: the same roles are proposed next time
        keep(text.encode(), path)


# reading ------------------------------------------------------------------------------------


def _document(path: Path) -> dict[str, Any]:
    document = read_object(path, _HELP)
    if not isinstance(document.get("roles"), list):
        raise InvalidFile(f"lane roles are an object with a list `roles`; {_HELP}", path=path)
    return document


def _checked(listed: Any, network: RoadNetwork, path: Path) -> list[Entry]:
    entries = [_entry(one, number, network, path) for number, one in enumerate(listed, 1)]
    by_lane: dict[tuple[str, int], Entry] = {}
    for entry in sorted(entries):
        before = by_lane.get((entry.road, entry.lane))
        if before is not None and before.end > entry.start + _TOLERANCE:
            where = f"road {entry.road}, lane {entry.lane}"
            raise InvalidFile(f"{where}: s = {entry.start:g} to {before.end:g} m has two roles; {_HELP}", path=path)
        by_lane[entry.road, entry.lane] = entry
    return entries


def _entry(one: Any, number: int, network: RoadNetwork, path: Path) -> Entry:
    def wrong(message: str) -> InvalidFile:
        return InvalidFile(f"{message}; {_HELP}", path=path, element=f"entry {number}")

    if not isinstance(one, dict) or not {"road", "lane", "role"} <= one.keys() <= {"road", "lane", "role", "from", "to"}:
        raise wrong("an entry has road, lane and role, and perhaps from and to")
    road = network.roads.get(str(one["road"]))
    if road is None:
        raise wrong(f"the map has no road {one['road']!r}")
    if one["role"] not in ROLES:
        raise wrong(f"{one['role']!r} is none of the roles {', '.join(ROLES)}")
    start, end = one.get("from", 0.0), one.get("to", road.length)
    if not all(isinstance(value, int | float) and not isinstance(value, bool) for value in (start, end)):
        raise wrong("from and to are numbers, m")
    if not -_TOLERANCE <= start < end <= road.length + _TOLERANCE:
        raise wrong(f"from {start:g} to {end:g} m is no stretch of road {road.id}, which is {road.length:g} m long")
    lanes = {lane for section in road.sections if section.end > start and section.s < end for lane in section.lanes if lane}
    if isinstance(one["lane"], bool) or one["lane"] not in lanes:
        raise wrong(f"road {road.id} has no lane {one['lane']!r} from {start:g} to {end:g} m")
    return Entry(road.id, one["lane"], float(start), float(end), Role(one["role"]))
