"""Roles of lanes: as they are proposed from maps, and as a person edits them."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from shapely import Point

from recognition.scenes import LaneRole, Site, roles, site_at
from recognition.scenes.lanes import graph
from recognition.scenes.roles import ROLES
from schemas.common.errors import InvalidFile
from tests.recognition.driving import site
from xodr import builders
from xodr.builders import RoadMap
from xodr.builders.elements import (
    LaneDesign,
    PlanPose,
    RoadDesign,
    SectionDesign,
    arc,
    connection,
    line,
)
from xodr.model import Connection, Junction, RoadLink
from xodr.model.geometry import Cubic


def roles_of(built: RoadMap, folder: Path) -> dict[tuple[str, int], set[LaneRole]]:
    """Roles of each lane of a map."""
    found: dict[tuple[str, int], set[LaneRole]] = {}
    for entry in site(built, folder).roles.entries:
        found.setdefault((entry.road, entry.lane), set()).add(entry.role)
    return found


def test_a_motorway_has_main_lanes_only(tmp_path: Path) -> None:
    found = roles_of(builders.straight_highway(opposite_lanes=2), tmp_path)
    assert found == {
        ("1", lane): {LaneRole.MAIN} for lane in (-1, -2, -3, 2, 3)
    }  # neither shoulders nor the median


def test_ramps_reach_from_their_road_to_the_end_of_the_extra_lane(tmp_path: Path) -> None:
    found = roles_of(builders.on_ramp(), tmp_path)
    assert {lane for lane, roles in found.items() if LaneRole.ON_RAMP in roles} == {
        ("3", -1),
        ("102", -1),
        ("2", -3),
    }
    assert {lane for lane, roles in found.items() if LaneRole.MAIN in roles} == {
        (r, lane) for r in ("1", "101", "2") for lane in (-1, -2)
    }


def test_ramps_are_told_by_their_ends_where_lane_types_say_nothing(tmp_path: Path) -> None:
    for build, role in (
        (builders.on_ramp, LaneRole.ON_RAMP),
        (builders.off_ramp, LaneRole.OFF_RAMP),
    ):
        path = build().write(tmp_path / f"{role}.xodr")
        text = path.read_text()
        for kind in ("onRamp", "offRamp", "entry", "exit"):
            text = text.replace(f'type="{kind}"', 'type="driving"')
        path.write_text(text)
        found = {
            (entry.road, entry.lane) for entry in site_at(path).roles.entries if entry.role is role
        }
        extra = ("2", -3) if role is LaneRole.ON_RAMP else ("1", -3)
        assert found == {("3", -1), ("102", -1), extra}


def carriageway(number: int, x: float, lanes: int, **links: object) -> RoadDesign:
    """A road of 100 m in the direction of x whose lanes are linked to those of the same id."""
    linked = {
        -lane: LaneDesign("driving", (Cubic(0.0, 3.5),), predecessor=-lane, successor=-lane)
        for lane in range(1, lanes + 1)
    }
    return RoadDesign(
        str(number),
        str(number),
        PlanPose(x, 0.0, 0.0),
        (line(100.0),),
        (SectionDesign(0.0, linked),),
        "motorway",
        36.0,
        **links,
    )


def mouth(junction: int) -> RoadLink:
    return RoadLink("junction", str(junction), None)


def direct(number: int, name: str, connections: Iterable[Connection]) -> Junction:
    return Junction(str(number), name, "direct", tuple(connections))


def way(before: int, after: int, lanes: Iterable[tuple[int, int]]) -> Connection:
    return connection(str(before), str(after), lanes)


def ramp(number: int, x: float, turn: float = 0.0, **links: object) -> RoadDesign:
    """A one-lane road along the third lane, or one that bends away from its
    beginning (turn < 0) or towards its end (> 0).
    """
    lanes = {-1: LaneDesign("driving", (Cubic(0.0, 3.5),))}
    back = 100.0 if turn > 0.0 else 0.0
    begin = PlanPose(x + back - back * math.cos(turn), -7.0 - back * math.sin(turn), turn)
    return RoadDesign(
        str(number),
        str(number),
        begin,
        (line(100.0),),
        (SectionDesign(0.0, lanes),),
        "motorway",
        22.0,
        **links,
    )


def test_a_lane_from_an_on_ramp_to_an_off_ramp_is_weaving(tmp_path: Path) -> None:
    into, out = mouth(10), mouth(11)
    roads = (
        carriageway(1, 0.0, 2, successor=into),
        carriageway(2, 100.0, 3, predecessor=into, successor=out),
        carriageway(3, 200.0, 2, predecessor=out), ramp(4, 0.0, 0.1, successor=into),
        ramp(5, 200.0, -0.1, predecessor=out),
    )  # fmt: skip
    both = ((-1, -1), (-2, -2))
    junctions = (
        direct(10, "in", (way(1, 2, both), way(4, 2, ((-1, -3),)))),
        direct(11, "out", (way(2, 3, both), way(2, 5, ((-3, -1),)))),
    )
    found = roles_of(RoadMap("weaving", roads, junctions), tmp_path)
    ramps = {
        ("4", -1): {LaneRole.ON_RAMP},
        ("2", -3): {LaneRole.WEAVING},
        ("5", -1): {LaneRole.OFF_RAMP},
    }
    assert {lane: roles for lane, roles in found.items() if roles != {LaneRole.MAIN}} == ramps


@pytest.mark.parametrize("reverse", [False, True], ids=["merging back", "parting before"])
def test_an_extra_lane_with_a_road_of_its_own_is_of_the_ramp_that_it_belongs_to(
    reverse: bool, tmp_path: Path
) -> None:
    """An acceleration lane that merges on a road of its own is no exit; a deceleration lane that
    parts on one is no entry.
    """
    xs = (300.0, 200.0, 100.0, 0.0) if reverse else (0.0, 100.0, 200.0, 300.0)
    before, after = ("successor", "predecessor") if reverse else ("predecessor", "successor")
    first, second, third = (mouth(number) for number in (10, 11, 12))
    roads = (
        carriageway(1, xs[0], 2, **{after: first}),
        ramp(4, xs[0], -0.1 if reverse else 0.1, **{after: first}),
        carriageway(2, xs[1], 3, **{before: first, after: second}),
        carriageway(3, xs[2], 2, **{before: second, after: third}),
        ramp(5, xs[2], **{before: second, after: third}),
        carriageway(6, xs[3], 2, **{before: third}),
    )  # fmt: skip

    def link(one: int, other: int, *lanes: tuple[int, int]) -> Connection:
        return (
            way(other, one, tuple((b, a) for a, b in lanes)) if reverse else way(one, other, lanes)
        )

    both = ((-1, -1), (-2, -2))
    junctions = (
        direct(10, "a", (link(1, 2, *both), link(4, 2, (-1, -3)))),
        direct(11, "b", (link(2, 3, *both), link(2, 5, (-3, -1)))),
        direct(12, "c", (link(3, 6, *both), link(5, 6, (-1, -2)))),
    )
    found = roles_of(RoadMap("extra", roads, junctions), tmp_path)
    role = LaneRole.OFF_RAMP if reverse else LaneRole.ON_RAMP
    ramps = {("4", -1): {role}, ("2", -3): {role}, ("5", -1): {role}}
    assert {lane: roles for lane, roles in found.items() if roles != {LaneRole.MAIN}} == ramps


@pytest.mark.parametrize(("before", "after"), [(3, 2), (2, 3)])
def test_a_lane_more_or_less_is_no_ramp(tmp_path: Path, before: int, after: int) -> None:
    one, two = (
        carriageway(1, 0.0, before, successor=RoadLink("road", "2", "start")),
        carriageway(2, 100.0, after, predecessor=RoadLink("road", "1", "end")),
    )
    assert set().union(*roles_of(RoadMap("lanes", (one, two)), tmp_path).values()) == {
        LaneRole.MAIN
    }


@pytest.mark.parametrize(("arms", "lanes", "rule"), [(4, 1, "RHT"), (5, 2, "RHT"), (3, 1, "LHT")])
def test_rings_are_found_with_their_entries_and_exits(
    tmp_path: Path, arms: int, lanes: int, rule: str
) -> None:
    found = roles_of(builders.roundabout(arms=arms, lanes=lanes, rule=rule), tmp_path)
    count = {role: sum(role in roles for roles in found.values()) for role in LaneRole}
    assert count[LaneRole.RING] == 2 * arms * lanes
    assert (
        count[LaneRole.ENTRY]
        == count[LaneRole.EXIT]
        == count[LaneRole.APPROACH]
        == count[LaneRole.URBAN]
        == arms * lanes
    )


@pytest.mark.parametrize(
    ("build", "inside"), [(builders.four_way_intersection, 12), (builders.t_junction, 6)]
)
def test_crossings_have_approaches_and_an_inside(
    tmp_path: Path, build: Callable[..., RoadMap], inside: int
) -> None:
    found = roles_of(build(), tmp_path)
    assert sum(roles == {LaneRole.INSIDE} for roles in found.values()) == inside
    assert {lane for lane, roles in found.items() if roles == {LaneRole.APPROACH}} == {
        (road, 1) for road, lane in found if lane == 1
    }


def test_traffic_lights_make_a_crossing_a_signalised_one(tmp_path: Path) -> None:
    found = roles_of(builders.four_way_intersection(signals=True), tmp_path)
    assert sum(roles == {LaneRole.SIGNALISED} for roles in found.values()) == 12
    assert all(LaneRole.INSIDE not in roles for roles in found.values())


@pytest.mark.parametrize(
    ("limit", "role"), [(50.0, LaneRole.URBAN), (70.0, LaneRole.URBAN), (80.0, LaneRole.MAIN)]
)
def test_the_speed_limit_parts_urban_from_fast_roads(
    tmp_path: Path, limit: float, role: LaneRole
) -> None:
    found = roles_of(builders.sharp_curve(speed_limit=limit / 3.6), tmp_path)
    assert set().union(*found.values()) == {role}


@pytest.mark.parametrize(
    ("driven", "role"), [(15.0, LaneRole.URBAN), (20.0, LaneRole.MAIN), (math.inf, LaneRole.MAIN)]
)
def test_traffic_tells_what_a_road_is_of_which_the_map_says_nothing(
    tmp_path: Path, driven: float, role: LaneRole
) -> None:
    path = builders.straight_highway().write(tmp_path / "site.xodr")
    path.write_text(re.sub("<type .*?</type>", "", path.read_text(), flags=re.DOTALL))
    assert {entry.role for entry in site_at(path, driven=driven).roles.entries} == {role}


# the file -------------------------------------------------------------------------------------


@pytest.fixture
def entered(tmp_path: Path) -> Site:
    return site(builders.on_ramp(), tmp_path)


def roles_file(place: Site) -> Path:
    return place.path.with_suffix(".roles.json")


def edit(place: Site, change: Callable[[list[dict[str, Any]]], object]) -> None:
    document = json.loads(roles_file(place).read_text())
    change(document["roles"])
    roles_file(place).write_text(json.dumps(document))


def test_what_was_proposed_is_read_back(entered: Site) -> None:
    assert site_at(entered.path).roles == entered.roles


def test_a_proposal_that_nobody_edited_follows_the_map(entered: Site) -> None:
    builders.straight_highway(lanes=2).write(entered.path)
    assert {entry.road for entry in site_at(entered.path).roles.entries} == {"1"}
    assert {one["road"] for one in json.loads(roles_file(entered).read_text())["roles"]} == {"1"}


def test_an_edit_counts_and_is_never_overwritten(entered: Site) -> None:
    edit(entered, lambda roles: roles.remove(next(one for one in roles if one["road"] == "3")))
    edited = roles_file(entered).read_bytes()
    found = site_at(entered.path).roles
    assert all(entry.road != "3" for entry in found.entries)
    assert roles_file(entered).read_bytes() == edited


def test_an_edit_beside_the_map_counts_where_proposals_go_elsewhere(
    entered: Site, tmp_path: Path
) -> None:
    edit(entered, lambda roles: roles.remove(next(one for one in roles if one["road"] == "3")))
    found = site_at(entered.path, folder=tmp_path / "elsewhere").roles
    assert all(entry.road != "3" for entry in found.entries)
    assert not (tmp_path / "elsewhere").exists()


def test_an_edit_may_part_a_lane_along_s(entered: Site) -> None:
    edit(
        entered,
        lambda roles: roles.append(
            {"road": "1", "lane": -3, "from": 100.0, "to": 200.0, "role": "urban"}
        ),
    )
    place, s = site_at(entered.path), np.array([50.0, 150.0, 250.0])
    strip = graph(place.network).find(np.full(3, "1", object), np.full(3, -3), s)
    assert [ROLES[code] for code in place.roles.codes(place.lanes, strip, s)] == [
        LaneRole.OTHER,
        LaneRole.URBAN,
        LaneRole.OTHER,
    ]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda roles: roles.append({"road": "9", "lane": -1, "role": "main"}), "no road '9'"),
        (lambda roles: roles.append({"road": "1", "lane": -8, "role": "main"}), "no lane -8"),
        (
            lambda roles: roles.append({"road": "1", "lane": [-3], "role": "main"}),
            r"no lane \[-3\]",
        ),
        (lambda roles: roles[0].update(role="fast"), "'fast' is none of the roles main, on_ramp"),
        (lambda roles: roles[0].pop("lane"), "an entry has road, lane and role"),
        (lambda roles: roles[0].update(to="end"), "from and to are numbers"),
        (lambda roles: roles[0].update({"from": 10.0, "to": 5.0}), "no stretch of road 1"),
        (lambda roles: roles[0].update({"to": 5000.0}), "which is 500 m long"),
        (lambda roles: roles.append(dict(roles[0], role="urban")), "has two roles"),
        (lambda roles: roles.append("main"), "an entry has road"),
    ],
)
def test_an_edit_that_does_not_fit_the_map_is_refused(
    entered: Site, change: Callable[[Any], object], message: str
) -> None:
    edit(entered, change)
    with pytest.raises(InvalidFile, match=message) as caught:
        site_at(entered.path)
    assert str(roles_file(entered)) in str(
        caught.value
    ) and "delete it to have roles proposed anew" in str(caught.value)


@pytest.mark.parametrize("content", ["", "{", "[]", '{"roles": 3}', '{"roles": [', "\udc80"])
def test_a_file_that_is_none_is_refused(entered: Site, content: str) -> None:
    roles_file(entered).write_text(content, errors="surrogateescape")
    with pytest.raises(InvalidFile):
        site_at(entered.path)


def test_a_folder_for_reading_only_is_no_obstacle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(content: bytes, path: Path) -> Path:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("recognition.scenes.roles.keep", refuse)
    place = site(builders.on_ramp(), tmp_path)
    assert place.roles.entries and not roles_file(place).exists()


def block(straight: float, radius: float) -> RoadMap:
    """A one-way street about a block, with rounded corners, and a street that leads in and one that
    leads out at two corners.
    """
    linked = {-1: LaneDesign("driving", (Cubic(0.0, 3.5),), predecessor=-1, successor=-1)}
    side = straight + 2.0 * radius
    corners = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)]
    roads = []
    for number, (x, y) in enumerate(corners):
        h = number * math.pi / 2
        begin = PlanPose(x + radius * math.cos(h), y + radius * math.sin(h), h)
        parts = (line(straight), arc(radius * math.pi / 2, 1.0 / radius))
        ends = {"predecessor": mouth(20 + (number - 1) % 4), "successor": mouth(20 + number)}
        roads.append(
            RoadDesign(
                str(number + 1),
                f"side {number}",
                begin,
                parts,
                (SectionDesign(0.0, linked),),
                "town",
                13.0,
                **ends,
            )
        )
    junctions = []
    for number, road in enumerate(roads[:4]):
        after = roads[(number + 1) % 4]
        link = mouth(20 + number)
        way, h = after.start, (number + 1) * math.pi / 2
        back = PlanPose(way.x - 30.0 * math.cos(h), way.y - 30.0 * math.sin(h), h)
        into = RoadDesign(
            str(10 + number),
            "in",
            back,
            (line(30.0),),
            (SectionDesign(0.0, linked),),
            "town",
            13.0,
            successor=link,
        )
        out = RoadDesign(
            str(15 + number),
            "out",
            way,
            (line(30.0),),
            (SectionDesign(0.0, linked),),
            "town",
            13.0,
            predecessor=link,
        )
        roads += [into, out] if number % 2 else []
        links = [connection(road.id, after.id, ((-1, -1),))]
        if number % 2:
            links += [
                connection(into.id, after.id, ((-1, -1),)),
                connection(road.id, out.id, ((-1, -1),)),
            ]
        junctions.append(direct(20 + number, f"corner {number}", tuple(links)))
    return RoadMap("block", tuple(roads), tuple(junctions))


@pytest.mark.parametrize(
    ("straight", "radius", "ring"), [(1.0, 12.0, True), (10.0, 4.6, True), (30.0, 8.0, False)]
)
def test_a_block_with_rounded_corners_is_no_roundabout(
    tmp_path: Path, straight: float, radius: float, ring: bool
) -> None:
    found = roles_of(block(straight, radius), tmp_path)
    assert [LaneRole.RING in found[str(number), -1] for number in range(1, 5)] == [ring] * 4


@pytest.mark.parametrize(
    ("points", "linked", "inside"),
    [
        ([(20.0, 0.0), (5.0, 0.0), (40.0, 0.0)], True, False),
        ([(20.0, 0.0), (5.0, 0.0), (40.0, 0.0)], False, True),
        ([(20.0, 0.0), (5.0, 0.0)], True, True),
        ([(20.0, 0.0), (40.0, 0.0)], True, False),
    ],
)
def test_a_way_out_of_the_ring_that_a_map_bends_inwards_is_no_lane_on_the_island(
    points: list[tuple[float, float]], linked: bool, inside: bool
) -> None:
    strips = [SimpleNamespace(kind="driving")] * 2
    found: Any = SimpleNamespace(
        strips=strips,
        preceding=[[], [0] if linked else []],
        following=[[], []],
        centre_line=lambda _: np.array(points),
    )
    assert roles._has_lanes_inside(found, Point(0.0, 0.0).buffer(20.0), {0}) == inside
