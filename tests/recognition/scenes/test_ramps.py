"""Ramps: by the shapes of lanes, in three cuttings of one motorway, and against
observed traffic.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recognition.catalogue.exposure import Mileage, rates
from recognition.labels import Label
from recognition.scenes import Site, site_at
from recognition.scenes.lanes import graph
from recognition.scenes.ramps import by_traffic
from recognition.scenes.roles import ROLES, LaneRole
from tests.recognition import ramp_sites
from tests.recognition.driving import labels, of, site, track
from tests.recognition.ramp_sites import WIDTH, Cutting, Extra, Motorway
from xodr import builders
from xodr.lookup import placing

MAIN, ON, OFF = (ROLES.index(role) for role in (LaneRole.MAIN, LaneRole.ON_RAMP, LaneRole.OFF_RAMP))
CUTTINGS: tuple[Cutting, ...] = ("sections", "roads", "lanelets")
ENTRY, EXIT = Extra(300.0, 500.0, True, False), Extra(750.0, 900.0, False, True)
WEAVING = Extra(400.0, 700.0, True, True)


def role_at(place: Site, x: float, y: float, h: float, left: bool) -> LaneRole:
    """Role of the lane at a point of the map for right-hand traffic."""
    side = -1.0 if left else 1.0
    where = [np.array([value]) for value in (x, side * y, 0.0, side * h)]
    found = placing.place(place.network, *where)
    strip = place.lanes.find(found.road_id, found.lane_id.astype(np.int64), found.s)
    return ROLES[int(place.roles.codes(place.lanes, strip, found.s)[0])]


@pytest.mark.parametrize(
    "cutting", ["sections", "roads", pytest.param("lanelets", marks=pytest.mark.slow)]
)
@pytest.mark.parametrize(
    ("extras", "beside"),
    [
        ((ENTRY, EXIT), {450.0: LaneRole.ON_RAMP, 800.0: LaneRole.OFF_RAMP}),
        ((WEAVING,), {550.0: LaneRole.WEAVING}),
        ((Extra(300.0, 800.0, False, False),), {550.0: LaneRole.MAIN}),
        ((Extra(200.0, 1200.0, True, False),), {700.0: LaneRole.MAIN}),
    ],
    ids=["entry and exit", "weaving", "passing lane", "lane added"],
)
def test_roles_do_not_depend_on_how_a_map_is_cut(
    cutting: Cutting, extras: tuple[Extra, ...], beside: dict[float, LaneRole], tmp_path: Path
) -> None:
    """With and against the reference line, on both sides of traffic."""
    for against, left in ((False, False), (True, False), (False, True)):
        folder = tmp_path / f"{against}{left}"
        folder.mkdir()
        place = ramp_sites.site(Motorway(1200.0, 2, extras, against), cutting, folder, left)
        y = -2.5 * WIDTH
        found = {x: role_at(place, x, y, 0.0, left) for x in beside}
        assert found == beside
        through = {role_at(place, x, -1.5 * WIDTH, 0.0, left) for x in (100.0, *beside, 1100.0)}
        assert through == {LaneRole.MAIN}
        for one in extras:
            for x, ramp, role, side in (
                (one.start - 100.0, one.entering, LaneRole.ON_RAMP, 1.0),
                (one.end + 100.0, one.leaving, LaneRole.OFF_RAMP, -1.0),
            ):
                if ramp:
                    turn = side * ramp_sites.ANGLE
                    aside = y - 100.0 * np.sin(ramp_sites.ANGLE)
                    assert role_at(place, x, aside, turn, left) is role


HELD_OUT = {
    "entry": Motorway(1000.0, 4, (Extra(350.0, 530.0, True, False),)),
    "exit": Motorway(1100.0, 3, (Extra(480.0, 640.0, False, True),)),
    "weaving": Motorway(1150.0, 2, (Extra(380.0, 700.0, True, True),)),
    "both": Motorway(1450.0, 3, (Extra(260.0, 480.0, True, False),
        Extra(850.0, 1010.0, False, True))),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", HELD_OUT)
def test_ramps_of_simulated_traffic_are_those_of_its_routes(name: str, tmp_path: Path) -> None:
    plan = HELD_OUT[name]
    driven = ramp_sites.traffic(plan, tmp_path, seed=7)
    for cutting in CUTTINGS:
        for against, left in ((False, False), (True, False), (False, True)):
            folder = tmp_path / f"{cutting}{against}{left}"
            folder.mkdir()
            place = ramp_sites.site(replace(plan, against=against), cutting, folder, left)
            found = ramp_sites.events_of(place, driven, left)
            for label, routes, entering in (
                (Label.RAMP_ENTERING, driven.entering(), True),
                (Label.RAMP_EXITING, driven.leaving(), False),
            ):
                egos = [event.ego for event in found if event.label is label]
                seen = driven.passing(plan, routes, entering)
                where = cutting, against, left, label
                assert sum(ego in routes for ego in egos) >= 0.9 * len(egos), where
                assert len({*egos} & seen) >= 0.8 * len(seen), where


def test_a_lane_that_may_be_a_ramp_blocks_ramps_and_changes_there(tmp_path: Path) -> None:
    """It begins at the map's border and ends beside others: a through lane, or
    an acceleration lane cut by the border.
    """
    place = ramp_sites.site(
        Motorway(900.0, 2, (Extra(0.0, 400.0, False, False),)), "sections", tmp_path
    )
    assert len(place.roles.doubts) == 1 and "at the border of the map" in place.roles.doubts[0]
    x = 25.0 * 0.1 * np.arange(140)
    share = np.clip((np.arange(140) - 50) / 40.0, 0.0, 1.0)
    moved = WIDTH * share**2 * (3.0 - 2.0 * share)
    found = labels(
        place,
        track("unsure", x, -2.5 * WIDTH + moved),
        track("sure", x + 60.0, -1.5 * WIDTH + moved),
    )
    assert Label.LANE_CHANGE_LEFT not in of(found, "unsure")
    assert Label.LANE_CHANGE_LEFT in of(found, "sure")
    assert site_at(place.path).roles.doubts == place.roles.doubts, "read back from the file"


def test_a_site_called_as_the_total_counts_once() -> None:
    rows = [{"site": "all", "class": "cut in"}, {"site": "b", "class": "cut in"}]
    sites = [("all", Mileage(1, 3600.0, 1000.0)), ("b", Mileage(1, 3600.0, 1000.0))]
    found = {(row["site"], row["class"]): row for row in rates(rows, sites)}
    assert found["site all", "cut in"]["events"] == found["b", "cut in"]["events"] == 1
    assert (found["all", "cut in"]["events"], found["all", "all"]["per_hour"]) == (2, 1.0)


def test_a_blocked_class_has_no_rate() -> None:
    title = Label.RAMP_ENTERING.title
    blocked = Mileage(3, 60.0, 1000.0, blocked=frozenset([title]))
    rows = [{"site": "a", "class": title}, {"site": "b", "class": title}]
    found = {
        (row["site"], row["class"]): row
        for row in rates(rows, [("a", blocked), ("b", Mileage(3, 60.0, 1000.0))])
    }
    assert found["a", title]["per_1000_km"] is None
    assert found["all", title]["events"] == 1
    assert found["all", title]["vehicle_km"] == found["b", title]["vehicle_km"] == 1.0


@pytest.mark.parametrize(("ramp", "ends"), [(ON, "first"), (OFF, "last")])
@pytest.mark.parametrize(("through", "is_main"), [(0, False), (1, False), (3, True), (6, True)])
def test_a_ramp_that_carries_through_traffic_is_a_main_lane(
    tmp_path: Path, ramp: int, ends: str, through: int, is_main: bool
) -> None:
    """Six vehicles on it, some of which come from a main lane (on-ramp) or go
    back to one (off-ramp).
    """
    lanes = graph(site(builders.straight_highway(lanes=2, length=300.0), tmp_path).network)
    strips = [number for number, strip in enumerate(lanes.strips) if strip.kind == "driving"][:2]
    track = np.repeat(np.arange(6), 4)
    on_ramp = np.array([False, True, True, True] * 6)
    if ends == "last":
        on_ramp = on_ramp.reshape(6, 4)[:, ::-1].ravel()
    on_ramp[track >= through] = True
    strip, role = np.where(on_ramp, strips[1], strips[0]), np.where(on_ramp, ramp, MAIN)
    found = by_traffic(lanes, track, strip, role)
    assert (found[on_ramp] == MAIN).all() == is_main
    assert is_main or (found == role).all()


def test_few_vehicles_say_nothing(tmp_path: Path) -> None:
    lanes = graph(site(builders.straight_highway(lanes=2, length=300.0), tmp_path).network)
    strip, role = np.array([1, 2] * 2), np.array([MAIN, ON] * 2)
    assert (by_traffic(lanes, np.repeat([0, 1], 2), strip, role) == role).all()
