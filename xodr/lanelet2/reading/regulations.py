"""Regulatory elements of a Lanelet2 map: speed limits, traffic lights, and who goes first.

Source: Lanelet2 documentation, "RegulatoryElementTagging".
"""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple

from xodr.lanelet2.reading.osm import Osm, Relation
from xodr.lanelet2.reading.tags import speed, speed_limit


class Regulations(NamedTuple):
    """What regulatory elements say of lanelets.

    limits: speed limits [m/s]. lights: ids of traffic lights. priorities: pairs of which the first goes before the second.
    left_out: ids of the relations that say nothing of this, by type and subtype.
    """

    limits: dict[str, float]
    lights: dict[str, tuple[str, ...]]
    priorities: list[tuple[str, str]]
    left_out: dict[str, list[str]]


def regulations(osm: Osm) -> Regulations:
    """What the regulatory elements of a map say, and which relations are neither this nor lanelets.

    Raises:
        InvalidFile: a speed limit is no speed.
    """
    found = Regulations({}, {}, [], defaultdict(list))
    users = defaultdict(list)
    for relation in osm.relations.values():
        for ref in relation.refs("regulatory_element", "relation"):
            users[ref].append(relation.id)
    for relation in osm.relations.values():
        kind, subtype = relation.tags.get("type", "relation without a type"), relation.tags.get("subtype", "")
        if kind != "lanelet" and not (kind == "regulatory_element" and _read(found, relation, subtype, users[relation.id])):
            found.left_out[f"{kind} {subtype}".strip()].append(relation.id)
    return found


def _read(found: Regulations, rule: Relation, subtype: str, lanelets: list[str]) -> bool:
    """Put down what a regulatory element says of the lanelets that refer to it; whether it says anything."""
    if subtype == "speed_limit":
        limit = _limit(rule)
        if limit is not None:
            found.limits.update({name: min(limit, found.limits.get(name, limit)) for name in lanelets})
        return limit is not None
    if subtype == "traffic_light":
        found.lights.update({name: (*found.lights.get(name, ()), rule.id) for name in lanelets})
        return bool(lanelets)
    if subtype == "right_of_way":
        first, waiting = (rule.refs(role, "relation") for role in ("right_of_way", "yield"))
        found.priorities.extend((high, low) for high in first for low in waiting)
        return bool(first and waiting)
    return False


def _limit(rule: Relation) -> float | None:
    """The limit of a regulatory element "speed_limit": its own, or the number of a German sign 274."""
    own = speed_limit(rule)
    sign = rule.tags.get("sign_type")
    if own is not None or sign is None:
        return own
    return speed(rule, "sign_type", sign.removeprefix("de274-"))
