"""Lanes of road networks (OpenDRIVE): level, access, borders, widths, links, and layers; their ways
through junctions."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from lxml import etree

from schemas.checks.document import CheckedDocument
from schemas.checks.registry import Finding, rule
from xodr.rules.sections import (
    PERMANENT,
    SAME_BORDER,
    TEMPORARY,
    Record,
    Section,
    at,
    connected_road,
    connections,
    integer,
    meetings,
    records,
    sections_by_layer,
    width_at,
)

_NO_WIDTH = 1e-6
"""Lanes narrower than this have no width, m."""
_SAME = 1e-6
"""Numbers that differ by less are the same."""
DRIVABLE = frozenset(
    {
        *(
            "driving",
            "entry",
            "exit",
            "onRamp",
            "offRamp",
            "connectingRamp",
            "slipLane",
            "shared",
            "bus",
            "taxi",
            "HOV",
        ),
        *("bidirectional", "stop", "restricted", "mwyEntry", "mwyExit"),
    }
)
"""Types of lanes on which vehicles drive."""


@rule("asam.net:xodr:1.7.0:road.lane.level_true_one_side", since=(1, 7))
def level_holds_to_the_edge(document: CheckedDocument) -> Iterator[Finding]:
    """Once a lane is level, the lanes beyond it shall be level, too; the lanes that link each other
    should be alike."""
    for section in _sections(document):
        for sign in (1, -1):
            level = False
            # From the centre outwards.
            for lane in section.side(sign):
                if level and not _level(lane):
                    yield Finding(
                        lane,
                        f"the lane {lane.get('id')} is not level, but a lane "
                        "nearer to the centre is",
                    )
                level = level or _level(lane)
    for meeting in meetings(document):
        for lane, other, _ in meeting.links:
            if _level(lane) != _level(other):
                message = (
                    f"level differs between the lane {lane.get('id')} and the lane "
                    f"{other.get('id')} that it is linked with"
                )
                yield Finding(lane, message, "warning")


def _sections(document: CheckedDocument) -> Iterator[Section]:
    for road in document.elements("road"):
        for sections in sections_by_layer(document, road).values():
            yield from sections


def _level(lane: etree._Element) -> bool:
    return lane.get("level") in ("true", "1")


@rule("asam.net:xodr:1.7.0:road.lane.access.no_mix_of_deny_or_allow", since=(1, 7))
def access_is_allowed_or_denied(document: CheckedDocument) -> Iterator[Finding]:
    """The access elements of a lane at one place must all allow, or all deny."""
    for lane in document.elements("lane"):
        seen: list[tuple[float, str]] = []
        for access in lane.iterfind("{*}access"):
            start, kind = document.number(access, "sOffset") or 0.0, access.get("rule") or "deny"
            if any(abs(start - s) < _SAME and kind != other for s, other in seen):
                yield Finding(
                    access,
                    f"rule={kind!r} at sOffset={start:g}, where another access "
                    "element says the opposite",
                )
            seen.append((start, kind))


@rule("asam.net:xodr:1.4.0:road.lane.border.overlap_with_inner_lanes")
def borders_stay_outside(document: CheckedDocument) -> Iterator[Finding]:
    """The border of a lane must not lie inside the border of the next lane towards the centre."""
    for section in _sections(document):
        # t grows to the left, so on the right a border farther out is the smaller number.
        for sign in (1, -1):
            for inner, outer in pairwise(section.side(sign)):
                near, far = records(document, inner, "border"), records(document, outer, "border")
                if (
                    near
                    and far
                    and any(
                        sign * (b - a) < -_SAME
                        for a, b in _sampled(near, far, section.end - section.start)
                    )
                ):
                    message = (
                        f"the border of the lane {outer.get('id')} crosses that of the lane "
                        f"{inner.get('id')}"
                    )
                    yield Finding(outer, message)


_SAMPLES = 64


def _sampled(near: list[Record], far: list[Record], length: float) -> Iterator[tuple[float, float]]:
    """Both borders at places along a section: at each start of a record, and on a fine grid."""
    # Starts of records are taken as they are: borders may jump there, which an even grid misses.
    places = {record.start for record in (*near, *far)} | {
        length * index / _SAMPLES for index in range(_SAMPLES + 1)
    }
    for ds in places:
        a, b = at(near, ds), at(far, ds)
        if a is not None and b is not None and 0.0 <= ds <= length:
            yield a, b


@rule("asam.net:xodr:1.4.0:road.lane.link.lanes_across_lane_sections", since=(1, 4))
def links_are_declared_by_both_lanes(document: CheckedDocument) -> Iterator[Finding]:
    """A lane that goes on over lane sections or roads must be linked in both directions."""
    for meeting in meetings(document):
        # Lanes of incoming roads name none of the junction: its connections link them, one way
        # only.
        if meeting.place == "junction" or (
            meeting.place == "road" and _of_junction(meeting.here, meeting.there)
        ):
            continue
        back = "predecessor" if meeting.there_start else "successor"
        for lane, other, _ in meeting.links:
            linked = {
                (integer(link, "id"), link.get("layer") or PERMANENT)
                for link in other.iterfind(f"{{*}}link/{{*}}{back}")
            }
            if (integer(lane, "id"), meeting.here.layer) not in linked:
                message = (
                    f"the lane {other.get('id')} does not name the lane {lane.get('id')}, which "
                    f"links it, as its {back}"
                )
                yield Finding(other, message)


def _of_junction(*sections: Section) -> bool:
    roads = (next(section.element.iterancestors("{*}road"), None) for section in sections)
    return any(road is not None and (road.get("junction") or "-1") != "-1" for road in roads)


@rule("asam.net:xodr:1.7.0:road.lane.link.zero_width_at_start", since=(1, 7))
def a_lane_that_opens_has_no_predecessor(document: CheckedDocument) -> Iterator[Finding]:
    """Lanes that have a width of zero at the beginning of the lane section shall have no
    predecessor."""
    yield from _linked_without_width(document, True)


@rule("asam.net:xodr:1.7.0:road.lane.link.zero_width_at_end", since=(1, 7))
def a_lane_that_closes_has_no_successor(document: CheckedDocument) -> Iterator[Finding]:
    """Lanes that have a width of zero at the end of the lane section shall have no successor."""
    yield from _linked_without_width(document, False)


def _linked_without_width(document: CheckedDocument, at_start: bool) -> Iterator[Finding]:
    name, end = ("predecessor", "beginning") if at_start else ("successor", "end")
    for section in _sections(document):
        for lane in section.lanes.values():
            width = width_at(document, section, lane, at_start)
            if (
                width is not None
                and width < _NO_WIDTH
                and lane.find(f"{{*}}link/{{*}}{name}") is not None
            ):
                yield Finding(
                    lane, f"the lane has no width at the {end} of its section, but a {name}"
                )


@rule("asam.net:xodr:1.4.0:road.lane.link.new_lane_appear")
def only_the_continuing_lane_is_linked(document: CheckedDocument) -> Iterator[Finding]:
    """If a new lane appears beside, only the continuing lane shall be connected to the original
    lane, not the appearing one."""
    for meeting in meetings(document):
        for lane, other, link in meeting.links:
            width = width_at(document, meeting.there, other, meeting.there_start)
            if width is not None and width < _NO_WIDTH:
                yield Finding(
                    link,
                    f"the lane {lane.get('id')} links the lane {other.get('id')}, "
                    "which has no width there",
                )


# layers of OpenDRIVE 1.9 ------------------------------------------------------------------------


@rule("asam.net:xodr:1.9.0:road.lane.layer.layer_limits")
def layers_are_few(document: CheckedDocument) -> Iterator[Finding]:
    """Each road shall have exactly one permanent and up to one temporary lane layer."""
    for road in document.elements("road"):
        seen: set[str] = set()
        for lanes in road.iterfind("{*}lanes"):
            layer = lanes.get("layer") or PERMANENT
            if layer in seen:
                yield Finding(lanes, f"the road has another {layer} layer of lanes")
            seen.add(layer)
        if seen and PERMANENT not in seen:
            yield Finding(road, "the road has no permanent layer of lanes")


@rule("asam.net:xodr:1.9.0:road.lane.layer.layer_mandatory_permanent", since=(1, 9))
def permanent_lanes_are_everywhere(document: CheckedDocument) -> Iterator[Finding]:
    """There shall be at least one lane in the permanent layer at each s of the road."""
    for road in document.elements("road"):
        for section in sections_by_layer(document, road).get(PERMANENT, []):
            if not section.lanes and section.element.get("singleSide") not in ("true", "1"):
                yield Finding(
                    section.element,
                    f"there is no permanent lane from s={section.start:g} to s={section.end:g}",
                    "warning",
                )


@rule("asam.net:xodr:1.9.0:road.lane.layer.center_lane_permanent", since=(1, 9))
def permanent_sections_have_a_centre(document: CheckedDocument) -> Iterator[Finding]:
    """Each lane section in the permanent layer shall have a centre lane."""
    for section in _sections(document):
        if section.layer == PERMANENT and section.element.find("{*}center/{*}lane") is None:
            yield Finding(section.element, "the permanent lane section has no centre lane")


@rule("asam.net:xodr:1.9.0:road.lane.layer.length_only_temporary", since=(1, 9))
def permanent_sections_have_no_length(document: CheckedDocument) -> Iterator[Finding]:
    """Lane sections in the permanent layer shall not have a length of their own."""
    for section in _sections(document):
        if section.layer == PERMANENT and section.element.get("length") is not None:
            yield Finding(
                section.element,
                f"length={section.element.get('length')} is for sections of the "
                "temporary layer only",
            )


@rule("asam.net:xodr:1.9.0:road.lane.layer.lane_phys_attr_temporary", since=(1, 9))
def temporary_lanes_have_no_surface(document: CheckedDocument) -> Iterator[Finding]:
    """Temporary lanes shall have no height and no material: the permanent layer has them."""
    for section in _sections(document):
        for lane in section.lanes.values() if section.layer == TEMPORARY else ():
            for element in (*lane.iterfind("{*}height"), *lane.iterfind("{*}material")):
                yield Finding(
                    element, "temporary lanes have the surface of the permanent ones, no own one"
                )


@rule("asam.net:xodr:1.9.0:road.lane_section.lanesec_length_limit_road", since=(1, 9))
def sections_end_on_the_road(document: CheckedDocument) -> Iterator[Finding]:
    """A lane section with a length shall not extend beyond the end of the road."""
    for road in document.elements("road"):
        total = document.number(road, "length")
        for section in road.iterfind("{*}lanes/{*}laneSection"):
            s, length = document.number(section, "s"), document.number(section, "length")
            if (
                None not in (s, length, total)
                and (s or 0.0) + (length or 0.0) > (total or 0.0) + SAME_BORDER
            ):
                yield Finding(
                    section,
                    f"the section ends at s={(s or 0.0) + (length or 0.0):g}, "
                    f"the road at {total:g}",
                )


@rule("asam.net:xodr:1.9.0:road.lane_section.new_lanesec_link_temp_to_perm", since=(1, 9))
def linked_layers_share_a_border(document: CheckedDocument) -> Iterator[Finding]:
    """If lanes of both layers are linked, a lane section of the other layer shall begin or end at
    that place."""
    for road in document.elements("road"):
        layers, length = sections_by_layer(document, road), document.number(road, "length") or 0.0
        for here in (section for sections in layers.values() for section in sections):
            for name, border in (("predecessor", here.start), ("successor", here.end)):
                if not SAME_BORDER < border < length - SAME_BORDER:
                    continue  # lanes of another road are linked
                others = layers.get(TEMPORARY if here.layer == PERMANENT else PERMANENT, [])
                ends = [other.end if name == "predecessor" else other.start for other in others]
                for link in here.element.iterfind(f"{{*}}*/{{*}}lane/{{*}}link/{{*}}{name}"):
                    across = (link.get("layer") or PERMANENT) != here.layer
                    if across and not any(abs(end - border) <= SAME_BORDER for end in ends):
                        message = (
                            f"no {link.get('layer') or PERMANENT} lane section meets this one at "
                            f"s={border:g}"
                        )
                        yield Finding(link, message)


@rule("asam.net:xodr:1.9.0:road.lane.link.temporary_layer_section_link_permanent", since=(1, 9))
def temporary_lanes_can_be_entered_and_left(document: CheckedDocument) -> Iterator[Finding]:
    """Temporary drivable lanes that begin or end on a road shall be linked with permanent lanes."""
    for road in document.elements("road"):
        length = document.number(road, "length") or 0.0
        temporary = sections_by_layer(document, road).get(TEMPORARY, [])
        for section in temporary:
            for name, border, at_start in (
                ("predecessor", section.start, True),
                ("successor", section.end, False),
            ):
                others = (
                    other.end if at_start else other.start
                    for other in temporary
                    if other is not section
                )
                if not SAME_BORDER < border < length - SAME_BORDER or any(
                    abs(end - border) <= SAME_BORDER for end in others
                ):
                    continue  # other temporary lanes, or those of another road, go on there
                for lane in section.lanes.values():
                    links = {
                        link.get("layer") or PERMANENT
                        for link in lane.iterfind(f"{{*}}link/{{*}}{name}")
                    }
                    width = width_at(document, section, lane, at_start)
                    if (
                        lane.get("type") in DRIVABLE
                        and (width or 0.0) > _NO_WIDTH
                        and PERMANENT not in links
                    ):
                        yield Finding(
                            lane,
                            f"the temporary lane {lane.get('id')} has no permanent {name} at "
                            f"s={border:g}",
                        )


@rule(
    "asam.net:xodr:1.9.0:road.lane.layer.lane_group_width_temporary", level="warning", since=(1, 9)
)
def temporary_lanes_lie_on_the_road(document: CheckedDocument) -> Iterator[Finding]:
    """The lanes of the temporary layer shall not extend beyond those of the permanent layer."""
    for road in document.elements("road"):
        layers = sections_by_layer(document, road)
        for section in layers.get(TEMPORARY, []):
            places = [
                # Middles of equal parts: at the borders themselves the neighbouring sections hold.
                section.start + (section.end - section.start) * (index + 0.5) / _SAMPLES
                for index in range(_SAMPLES)
            ]
            for s in places:
                usual = next(
                    (
                        section
                        for section in layers.get(PERMANENT, [])
                        if section.start <= s < section.end
                    ),
                    None,
                )
                if usual is None:
                    continue
                right, left = (_edge(document, road, section, s, sign) for sign in (-1, 1))
                bounds = [_edge(document, road, usual, s, sign) for sign in (-1, 1)]
                if right < bounds[0] - _BEYOND or left > bounds[1] + _BEYOND:
                    by = max(bounds[0] - right, left - bounds[1])
                    message = (
                        f"temporary lanes reach {by:.2f} m beyond the permanent ones at s={s:.1f}"
                    )
                    yield Finding(section.element, message)
                    break


_BEYOND = 0.01
"""By how much temporary lanes may reach beyond permanent ones, m: the numbers in files are rounded.
"""


def _edge(
    document: CheckedDocument, road: etree._Element, section: Section, s: float, sign: int
) -> float:
    """t of the outer edge of a side of a lane section."""
    centre, ds = _offset(document, section, s), s - section.start
    t = centre
    for lane in section.side(sign):
        width, border = (
            at(records(document, lane, "width"), ds),
            at(records(document, lane, "border"), ds),
        )
        # Widths add up from the centre; a border is its distance from the centre lane at once.
        t = t + sign * width if width is not None else centre + border if border is not None else t
    return t


def _offset(document: CheckedDocument, section: Section, s: float) -> float:
    lanes = section.element.getparent()
    offsets = lanes.findall("{*}laneOffset") if lanes is not None else []
    holding = [offset for offset in offsets if (document.number(offset, "s") or 0.0) <= s]
    if not holding:
        return 0.0
    start, a, b, c, d = (document.number(holding[-1], name) or 0.0 for name in ("s", *"abcd"))
    return Record(start, (a, b, c, d))(s)


# junctions --------------------------------------------------------------------------------------


@rule("asam.net:xodr:1.4.0:junctions.connection.connect_road_no_incoming_road")
def connecting_roads_are_not_incoming(document: CheckedDocument) -> Iterator[Finding]:
    """Connecting roads shall not be incoming roads."""
    roads = _roads(document)
    for _, connection in _connections(document):
        incoming = roads.get(connection.get("incomingRoad") or "")
        if incoming is not None and (incoming.get("junction") or "-1") != "-1":
            yield Finding(
                connection,
                f"incomingRoad={incoming.get('id')!r} is a connecting road of a junction",
            )


def _roads(document: CheckedDocument) -> dict[str, etree._Element]:
    return {road.get("id") or "": road for road in document.elements("road")}


def _connections(document: CheckedDocument) -> Iterator[tuple[etree._Element, etree._Element]]:
    for junction in document.elements("junction"):
        yield from ((junction, connection) for connection in connections(junction))


@rule("asam.net:xodr:1.7.0:junctions.connection.one_connection_element", since=(1, 7))
def connecting_roads_have_one_connection(document: CheckedDocument) -> Iterator[Finding]:
    """In version 1.7, each connecting road shall have exactly one connection."""
    # Since 1.8 a connecting road may have one connection for each incoming road.
    if document.type.version > (1, 7):
        return
    seen: set[str] = set()
    for _, connection in _connections(document):
        road = connection.get("connectingRoad")
        if road is not None and road in seen:
            yield Finding(connection, f"connectingRoad={road!r} has another connection")
        seen |= {road} if road is not None else set()


@rule("asam.net:xodr:1.8.0:junctions.connection.one_link_to_incoming", since=(1, 8))
def connections_lead_into_the_junction(document: CheckedDocument) -> Iterator[Finding]:
    """A connecting road shall have one connection for each incoming road, with lane links in the
    direction of traffic only."""
    seen: set[tuple[str | None, str]] = set()
    for _, connection in _connections(document):
        ends = connection.get("incomingRoad"), connected_road(connection)
        if connection.get("connectingRoad") and ends in seen:
            yield Finding(
                connection,
                f"another connection leads from the road {ends[0]!r} to the road {ends[1]!r}",
            )
        seen.add(ends)
    for meeting in meetings(document):
        if meeting.place != "junction":
            continue
        for lane, other, link in meeting.links:
            # Traffic leaves over a road's start when it drives towards -s, and enters there towards
            # +s.
            leaves = _ways(lane) & ({-1} if meeting.here_start else {1})
            enters = _ways(other) & ({1} if meeting.there_start else {-1})
            if not leaves or not enters:
                message = (
                    f"no traffic leads from the lane {lane.get('id')} to the lane "
                    f"{other.get('id')} of the connection"
                )
                yield Finding(link, message)


def _ways(lane: etree._Element) -> set[int]:
    """The directions in which a lane's traffic drives: 1 for +s, -1 for -s."""
    road = next(lane.iterancestors("{*}road"), None)
    if lane.get("direction") == "both" or lane.get("type") == "bidirectional":
        return {1, -1}
    # Right-hand traffic drives towards +s on lanes with negative ids (OpenDRIVE 1.9, 10.1).
    right_hand = road is None or (road.get("rule") or "RHT") == "RHT"
    way = 1 if ((integer(lane, "id") or 0) < 0) == right_hand else -1
    return {-way} if lane.get("direction") == "reversed" else {way}


@rule("asam.net:xodr:1.7.0:junctions.connection.start_along_linkage", since=(1, 7))
def connections_enter_at_the_start(document: CheckedDocument) -> Iterator[Finding]:
    """contactPoint="start" of a connection means that the incoming road is the predecessor of the
    connecting road."""
    yield from _entered(document, "start", "predecessor")


@rule("asam.net:xodr:1.7.0:junctions.connection.end_opposite_linkage", since=(1, 7))
def connections_enter_at_the_end(document: CheckedDocument) -> Iterator[Finding]:
    """contactPoint="end" of a connection means that the incoming road is the successor of the
    connecting road."""
    yield from _entered(document, "end", "successor")


def _entered(document: CheckedDocument, contact: str, name: str) -> Iterator[Finding]:
    roads = _roads(document)
    for _, connection in _connections(document):
        road = roads.get(connection.get("connectingRoad") or "")
        link = road.find(f"{{*}}link/{{*}}{name}") if road is not None else None
        if (
            connection.get("contactPoint") != contact
            or road is None
            or link is None
            or link.get("elementType") != "road"
        ):
            continue
        if link.get("elementId") != connection.get("incomingRoad"):
            message = (
                f"contactPoint={contact!r}, but the {name} of the road {road.get('id')!r} is the "
                f"road {link.get('elementId')!r},"
                f" not {connection.get('incomingRoad')!r}"
            )
            yield Finding(connection, message)


@rule("asam.net:xodr:1.4.0:road.linkage.is_junction_needed")
def ambiguous_links_need_a_junction(document: CheckedDocument) -> Iterator[Finding]:
    """Two roads must not link the same end of a road: where it goes on is ambiguous without a
    junction."""
    seen: set[tuple[str, str]] = set()
    for road in document.elements("road"):
        if (road.get("junction") or "-1") != "-1":
            continue
        for link in (
            *road.iterfind("{*}link/{*}predecessor"),
            *road.iterfind("{*}link/{*}successor"),
        ):
            end = link.get("elementId") or "", link.get("contactPoint") or ""
            # Without a contact point, it is unknown which end is meant.
            if link.get("elementType") != "road" or link.get("elementS") or not end[1]:
                continue
            if end in seen:
                yield Finding(
                    link,
                    f"another road links the {end[1]} of the road {end[0]!r}, too; "
                    "a junction is needed",
                )
            seen.add(end)
