"""Roles of lanes: as they are proposed from maps, and as a person edits them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from recognition.sites import Role, Site, site_at
from recognition.sites.lanes import graph
from recognition.sites.roles import ROLES
from schemas.errors import InvalidFile
from tests.recognition.driving import site
from xodr import builders
from xodr.builders import RoadMap


def roles_of(built: RoadMap, folder: Path) -> dict[tuple[str, int], set[Role]]:
    """Roles of each lane of a map."""
    found: dict[tuple[str, int], set[Role]] = {}
    for entry in site(built, folder).roles.entries:
        found.setdefault((entry.road, entry.lane), set()).add(entry.role)
    return found


def test_a_motorway_has_main_lanes_only(tmp_path: Path) -> None:
    found = roles_of(builders.straight_highway(opposite_lanes=2), tmp_path)
    assert found == {("1", lane): {Role.MAIN} for lane in (-1, -2, -3, 2, 3)}  # neither shoulders nor the median


def test_ramps_reach_from_their_road_to_the_end_of_the_extra_lane(tmp_path: Path) -> None:
    found = roles_of(builders.on_ramp(), tmp_path)
    assert {lane for lane, roles in found.items() if Role.ON_RAMP in roles} == {("3", -1), ("102", -1), ("2", -3)}
    assert {lane for lane, roles in found.items() if Role.MAIN in roles} == {
        (r, lane) for r in ("1", "101", "2") for lane in (-1, -2)
    }


def test_ramps_are_told_by_their_ends_where_lane_types_say_nothing(tmp_path: Path) -> None:
    for build, role in ((builders.on_ramp, Role.ON_RAMP), (builders.off_ramp, Role.OFF_RAMP)):
        path = build().write(tmp_path / f"{role}.xodr")
        text = path.read_text()
        for kind in ("onRamp", "offRamp", "entry", "exit"):
            text = text.replace(f'type="{kind}"', 'type="driving"')
        path.write_text(text)
        found = {(entry.road, entry.lane) for entry in site_at(path).roles.entries if entry.role is role}
        extra = ("2", -3) if role is Role.ON_RAMP else ("1", -3)
        assert found == {("3", -1), ("102", -1), extra}


@pytest.mark.parametrize(("arms", "lanes", "rule"), [(4, 1, "RHT"), (5, 2, "RHT"), (3, 1, "LHT")])
def test_rings_are_found_with_their_entries_and_exits(tmp_path: Path, arms: int, lanes: int, rule: str) -> None:
    found = roles_of(builders.roundabout(arms=arms, lanes=lanes, rule=rule), tmp_path)
    count = {role: sum(role in roles for roles in found.values()) for role in Role}
    assert count[Role.RING] == 2 * arms * lanes
    assert count[Role.ENTRY] == count[Role.EXIT] == count[Role.APPROACH] == count[Role.URBAN] == arms * lanes


@pytest.mark.parametrize(("build", "inside"), [(builders.four_way_intersection, 12), (builders.t_junction, 6)])
def test_crossings_have_approaches_and_an_inside(tmp_path: Path, build: Callable[..., RoadMap], inside: int) -> None:
    found = roles_of(build(), tmp_path)
    assert sum(roles == {Role.INSIDE} for roles in found.values()) == inside
    assert {lane for lane, roles in found.items() if roles == {Role.APPROACH}} == {(road, 1) for road, lane in found if lane == 1}


def test_traffic_lights_make_a_crossing_a_signalised_one(tmp_path: Path) -> None:
    found = roles_of(builders.four_way_intersection(signals=True), tmp_path)
    assert sum(roles == {Role.SIGNALISED} for roles in found.values()) == 12
    assert all(Role.INSIDE not in roles for roles in found.values())


@pytest.mark.parametrize(("limit", "role"), [(50.0, Role.URBAN), (70.0, Role.URBAN), (80.0, Role.MAIN)])
def test_the_speed_limit_parts_urban_from_fast_roads(tmp_path: Path, limit: float, role: Role) -> None:
    found = roles_of(builders.sharp_curve(speed_limit=limit / 3.6), tmp_path)
    assert set().union(*found.values()) == {role}


# the file -------------------------------------------------------------------------------------


@pytest.fixture
def ramp(tmp_path: Path) -> Site:
    return site(builders.on_ramp(), tmp_path)


def roles_file(place: Site) -> Path:
    return place.path.with_suffix(".roles.json")


def edit(place: Site, change: Callable[[list[dict[str, Any]]], object]) -> None:
    document = json.loads(roles_file(place).read_text())
    change(document["roles"])
    roles_file(place).write_text(json.dumps(document))


def test_what_was_proposed_is_read_back(ramp: Site) -> None:
    assert site_at(ramp.path).roles == ramp.roles


def test_a_proposal_that_nobody_edited_follows_the_map(ramp: Site) -> None:
    builders.straight_highway(lanes=2).write(ramp.path)
    assert {entry.road for entry in site_at(ramp.path).roles.entries} == {"1"}
    assert {one["road"] for one in json.loads(roles_file(ramp).read_text())["roles"]} == {"1"}


def test_an_edit_counts_and_is_never_overwritten(ramp: Site) -> None:
    edit(ramp, lambda roles: roles.remove(next(one for one in roles if one["road"] == "3")))
    edited = roles_file(ramp).read_bytes()
    found = site_at(ramp.path).roles
    assert all(entry.road != "3" for entry in found.entries)
    assert roles_file(ramp).read_bytes() == edited


def test_an_edit_may_part_a_lane_along_s(ramp: Site) -> None:
    edit(ramp, lambda roles: roles.append({"road": "1", "lane": -3, "from": 100.0, "to": 200.0, "role": "urban"}))
    place, s = site_at(ramp.path), np.array([50.0, 150.0, 250.0])
    strip = graph(place.network).find(np.full(3, "1", object), np.full(3, -3), s)
    assert [ROLES[code] for code in place.roles.codes(place.lanes, strip, s)] == [Role.OTHER, Role.URBAN, Role.OTHER]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda roles: roles.append({"road": "9", "lane": -1, "role": "main"}), "no road '9'"),
        (lambda roles: roles.append({"road": "1", "lane": -8, "role": "main"}), "no lane -8"),
        (lambda roles: roles[0].update(role="fast"), "'fast' is none of the roles main, on_ramp"),
        (lambda roles: roles[0].pop("lane"), "an entry has road, lane and role"),
        (lambda roles: roles[0].update(to="end"), "from and to are numbers"),
        (lambda roles: roles[0].update({"from": 10.0, "to": 5.0}), "no stretch of road 1"),
        (lambda roles: roles[0].update({"to": 5000.0}), "which is 500 m long"),
        (lambda roles: roles.append(dict(roles[0], role="urban")), "has two roles"),
        (lambda roles: roles.append("main"), "an entry has road"),
    ],
)
def test_an_edit_that_does_not_fit_the_map_is_refused(ramp: Site, change: Callable[[Any], object], message: str) -> None:
    edit(ramp, change)
    with pytest.raises(InvalidFile, match=message) as caught:
        site_at(ramp.path)
    assert str(roles_file(ramp)) in str(caught.value) and "delete it to have roles proposed anew" in str(caught.value)


@pytest.mark.parametrize("content", ["", "{", "[]", '{"roles": 3}', '{"roles": [', "\udc80"])
def test_a_file_that_is_none_is_refused(ramp: Site, content: str) -> None:
    roles_file(ramp).write_text(content, errors="surrogateescape")
    with pytest.raises(InvalidFile):
        site_at(ramp.path)


def test_a_folder_for_reading_only_is_no_obstacle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(content: bytes, path: Path) -> Path:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("recognition.sites.roles.keep", refuse)
    place = site(builders.on_ramp(), tmp_path)
    assert place.roles.entries and not roles_file(place).exists()
