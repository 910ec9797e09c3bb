"""Lanes of OpenDRIVE documents as rules need them: sections by layer, widths, and where lanes meet
others that they link."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from lxml import etree

from schemas.checks.document import CheckedDocument

PERMANENT, TEMPORARY = "permanent", "temporary"
SAME_BORDER = 1e-3
"""Lane sections that end and begin so near each other, in m, are neighbours."""


class Section(NamedTuple):
    """A lane section from `start` to `end`, m."""

    element: etree._Element
    start: float
    end: float
    layer: str = PERMANENT

    @property
    def lanes(self) -> dict[int, etree._Element]:
        """The lanes of both sides by id."""
        sides = (self.element.iterfind(f"{{*}}{side}/{{*}}lane") for side in ("left", "right"))
        return {
            number: lane for lanes in sides for lane in lanes if (number := integer(lane, "id"))
        }

    def side(self, sign: int) -> list[etree._Element]:
        """The lanes on the left (1) or right (-1) side, from the centre outwards."""
        lanes = self.lanes
        return [lanes[number] for number in sorted(lanes, key=abs) if number * sign > 0]


def integer(element: etree._Element, name: str) -> int | None:
    """An attribute as an integer; None where it is absent or none."""
    try:
        return int(element.get(name) or "")
    except ValueError:
        return None


def layer_of(section: etree._Element) -> str:
    """The layer of a lane section."""
    lanes = section.getparent()
    return (lanes.get("layer") if lanes is not None else None) or PERMANENT


def single_sided(section: etree._Element) -> bool:
    """Whether a lane section is about one side of the road only."""
    return section.get("singleSide") in ("true", "1")


def sections_by_layer(document: CheckedDocument, road: etree._Element) -> dict[str, list[Section]]:
    """Lane sections of a road by layer, each up to the next one of its side, or its own end."""
    length, sections = document.number(road, "length"), dict[str, list[Section]]()
    for lanes in road.iterfind("{*}lanes"):
        layer = lanes.get("layer") or PERMANENT
        starts = [
            (section, document.number(section, "s")) for section in lanes.iterfind("{*}laneSection")
        ]
        # Sections without a readable s have no place among the others.
        known = [(section, s) for section, s in starts if s is not None]
        for index, (section, s) in enumerate(known):
            after = (
                other
                for sibling, other in known[index + 1 :]
                if not single_sided(section) or _same_side(section, sibling)
            )
            end = next(after, length if length is not None else math.inf)
            own = document.number(section, "length")
            end = min(end, s + own) if own is not None else end
            sections.setdefault(layer, []).append(Section(section, s, end, layer))
    return sections


def _same_side(section: etree._Element, other: etree._Element) -> bool:
    sides = [side for side in ("left", "right") if section.find(f"{{*}}{side}") is not None]
    return not single_sided(other) or any(other.find(f"{{*}}{side}") is not None for side in sides)


class Record(NamedTuple):
    """A polynomial from `start` on: of the width of a lane, or of its border (t); ds counts from
    there."""

    start: float
    coefficients: tuple[float, float, float, float]

    def __call__(self, ds: float) -> float:
        """Value at a distance from the section's start, m."""
        a, b, c, d = self.coefficients
        x = ds - self.start
        return a + x * (b + x * (c + x * d))


def records(document: CheckedDocument, lane: etree._Element, tag: str) -> list[Record]:
    """The width or border records of a lane that can be read."""
    found = []
    for element in lane.iterfind(f"{{*}}{tag}"):
        start, *values = (document.number(element, name) for name in ("sOffset", *"abcd"))
        numbers = [0.0 if value is None else value for value in values]
        found.append(Record(start or 0.0, (numbers[0], numbers[1], numbers[2], numbers[3])))
    return sorted(found, key=lambda record: record.start)


def at(found: Sequence[Record], ds: float) -> float | None:
    """Value of the records at a distance from the section's start, m; None where there is none."""
    # With the tolerance, a record counts at a place that the file rounds.
    holding = [record for record in found if record.start <= ds + SAME_BORDER]
    return holding[-1](ds) if holding else None


def width_at(
    document: CheckedDocument, section: Section, lane: etree._Element, at_start: bool
) -> float | None:
    """Width of a lane at an end of its section, m; None where it has no widths."""
    return at(records(document, lane, "width"), 0.0 if at_start else section.end - section.start)


class SectionMeeting(NamedTuple):
    """Two ends of lane sections that touch.

    place: "section", "road" or "junction". here_start, there_start: whether the sections touch with
    their start. links: the lanes here with those that they link there, and the element that says
    so.
    """

    place: str
    here: Section
    here_start: bool
    there: Section
    there_start: bool
    links: list[tuple[etree._Element, etree._Element, etree._Element]]


def meetings(document: CheckedDocument) -> Iterator[SectionMeeting]:
    """Every place where lane sections meet, once from each side that declares links."""
    roads = {road.get("id") or "": road for road in document.elements("road")}
    layers = {name: sections_by_layer(document, road) for name, road in roads.items()}
    for road_id, road in roads.items():
        yield from _within(layers[road_id])
        for at_start, name in ((True, "predecessor"), (False, "successor")):
            link = road.find(f"{{*}}link/{{*}}{name}")
            if link is None or link.get("elementType") != "road" or link.get("elementS"):
                continue
            other, contact = layers.get(link.get("elementId") or ""), link.get("contactPoint")
            if other is not None and contact in ("start", "end"):
                yield from _ends("road", (layers[road_id], at_start), (other, contact == "start"))
    for junction in document.elements("junction"):
        for connection in connections(junction):
            yield from _connected(junction, connection, roads, layers)


def connections(junction: etree._Element) -> list[etree._Element]:
    """The connections of a junction that lead from the end of a road to another road."""
    if (junction.get("type") or "default") not in ("default", "direct"):
        return []
    return junction.findall("{*}connection")


def connected_road(connection: etree._Element) -> str:
    """Id of the road that a connection leads to."""
    return connection.get("linkedRoad") or connection.get("connectingRoad") or ""


def _within(layers: dict[str, list[Section]]) -> Iterator[SectionMeeting]:
    # Of all layers, for lanes may link those of the other layer (OpenDRIVE 1.9).
    every = sorted(
        (section for sections in layers.values() for section in sections),
        key=lambda section: section.start,
    )
    starts = [section.start for section in every]
    # Sorted starts let each border find its sections without comparing all pairs, which is slow on
    # roads of thousands.
    for before in every:
        for after in every[
            bisect_left(starts, before.end - SAME_BORDER) : bisect_right(
                starts, before.end + SAME_BORDER
            )
        ]:
            if before is not after:
                yield _meeting("section", before, False, after, True)
                yield _meeting("section", after, True, before, False)


_End = tuple[dict[str, list[Section]], bool]


def _ends(place: str, one: _End, other: _End) -> Iterator[SectionMeeting]:
    for here in _at_end(*one):
        for there in _at_end(*other):
            yield _meeting(place, here, one[1], there, other[1])


def _at_end(layers: dict[str, list[Section]], at_start: bool) -> Iterator[Section]:
    """The sections of each layer that reach an end of their road."""
    length = max((section.end for section in layers.get(PERMANENT, [])), default=0.0)
    for sections in layers.values():
        section = sections[0 if at_start else -1]
        # Temporary sections need not reach the ends of their road.
        if section.start <= SAME_BORDER if at_start else section.end >= length - SAME_BORDER:
            yield section


def _meeting(
    place: str, here: Section, here_start: bool, there: Section, there_start: bool
) -> SectionMeeting:
    direction, known = "predecessor" if here_start else "successor", there.lanes
    links = [
        (lane, known[number], link)
        for lane in here.lanes.values()
        for link in lane.iterfind(f"{{*}}link/{{*}}{direction}")
        if (number := integer(link, "id")) in known
        and number is not None
        and (link.get("layer") or PERMANENT) == there.layer
    ]
    return SectionMeeting(place, here, here_start, there, there_start, links)


def _connected(
    junction: etree._Element,
    connection: etree._Element,
    roads: dict[str, etree._Element],
    layers: dict[str, dict[str, list[Section]]],
) -> Iterator[SectionMeeting]:
    incoming, onward = connection.get("incomingRoad") or "", connected_road(connection)
    contact, here_start = (
        connection.get("contactPoint"),
        touches_with_start(roads.get(incoming), junction),
    )
    if (
        incoming not in roads
        or onward not in roads
        or contact not in ("start", "end")
        or here_start is None
    ):
        return
    for one in _at_end(layers[incoming], here_start):
        for other in _at_end(layers[onward], contact == "start"):
            links = []
            for link in connection.iterfind("{*}laneLink"):
                named = (link.get("fromLayer") or PERMANENT, link.get("toLayer") or PERMANENT) == (
                    one.layer,
                    other.layer,
                )
                lane, target = (
                    one.lanes.get(integer(link, "from") or 0),
                    other.lanes.get(integer(link, "to") or 0),
                )
                if named and lane is not None and target is not None:
                    links.append((lane, target, link))
            yield SectionMeeting("junction", one, here_start, other, contact == "start", links)


def touches_with_start(road: etree._Element | None, junction: etree._Element) -> bool | None:
    """Whether a road touches a junction with its start; None where it does not,
    or with both ends.
    """
    if road is None:
        return None
    ends = [
        name == "predecessor"
        for name in ("predecessor", "successor")
        for link in road.iterfind(f"{{*}}link/{{*}}{name}")
        if link.get("elementType") == "junction" and link.get("elementId") == junction.get("id")
    ]
    # A road may loop back to its junction: which end is meant then is unknown.
    return ends[0] if len(ends) == 1 else None
