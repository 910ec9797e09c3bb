"""SUMO networks: which SUMO lane is which, exact centre lines, traffic lights, the cache."""

from __future__ import annotations

import math
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import libsumo
import pytest
from lxml import etree

import xodr
from schemas.common.errors import InvalidFile, UsageError
from tests.conftest import SHARED
from xodr import builders
from xodr.builders import RoadMap
from xodr.formats import sumo_net
from xodr.formats.sumo_net import LaneTrack, SumoNet, building
from xodr.formats.sumo_net.building import CacheEntry, NetconvertFailed, _build
from xodr.formats.sumo_net.net import use_of

EXACT = 0.006
"""Largest distance of a SUMO lane from the exact centre line, in m: the
polylines' 5 mm, and rounding.
"""


@pytest.fixture(autouse=True)
def cache_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv("XOSC_CACHE_DIR", str(tmp_path / "cache"))
    _build.cache_clear()
    yield tmp_path / "cache"
    _build.cache_clear()


def built(road_map: RoadMap, folder: Path) -> tuple[xodr.RoadNetwork, SumoNet]:
    path = road_map.write(folder / "map.xodr")
    return xodr.load(path), sumo_net.build(path)


def written(text: str, folder: Path) -> Path:
    path = folder / "map.xodr"
    path.write_text(f'<OpenDRIVE><header revMajor="1" revMinor="6"/>{text}</OpenDRIVE>')
    return path


def road(
    identity: str, lanes: str = '<lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" '
                                'd="0"/></lane>',
    length: float = 100, x: float = 0, extra: str = "", junction: str = "-1", link: str = "",
    rule: str = "RHT",
) -> str:  # fmt: skip
    return (
        f'<road id="{identity}" length="{length}" junction="{junction}" '
        f'rule="{rule}"><link>{link}</link><planView>'
        f'<geometry s="0" x="{x}" y="0" hdg="0" '
        f'length="{length}"><line/></geometry></planView><lanes><laneSection s="0">'
        '<center><lane id="0" '
        f'type="none"/></center><right>{lanes}</right></laneSection></lanes>{extra}</road>'
    )


def shapes(net: SumoNet) -> dict[str, list[tuple[float, float]]]:
    lanes = etree.parse(str(net.path)).getroot().iter("lane")
    return {
        lane.get("id", ""): [
            (float(x), float(y))
            for x, y in (p.split(",")[:2] for p in lane.get("shape", "").split())
        ]
        for lane in lanes
    }


def exact(network: xodr.RoadNetwork, track: LaneTrack, share: float) -> xodr.WorldPose:
    """Pose on a track's centre line in the direction of travel, a hair inside
    its ends so that its own section is meant.
    """
    s = track.start + (track.end - track.start) * min(max(share, 1e-9), 1 - 1e-9)
    own = network.road(track.road_id)
    pose = own.pose(s, own.lane_t(s, track.lane_id))
    return pose if track.end > track.start else pose._replace(h=pose.h + math.pi)


def aside(
    network: xodr.RoadNetwork, track: LaneTrack, point: tuple[float, float], share: float
) -> tuple[float, float]:
    """Distance of a point from a track's centre line, and the share of the track where it is;
    `share` is a first guess.
    """
    for _ in range(30):
        pose = exact(network, track, share)
        ahead = (point[0] - pose.x) * math.cos(pose.h) + (point[1] - pose.y) * math.sin(pose.h)
        share = min(max(share + 0.7 * ahead / abs(track.end - track.start), 0.0), 1.0)
    return math.dist(point, exact(network, track, share)[:2]), share


def check_geometry(network: xodr.RoadNetwork, net: SumoNet) -> None:
    """Every SUMO lane lies on its exact centre line; on roads it also reaches from end to end."""
    for sumo_lane, points in shapes(net).items():
        track = net.track(sumo_lane)
        if track is None:
            continue
        share = 0.0
        for (x, y), (x2, y2) in list(pairwise(points))[:: 1 + len(points) // 10]:
            for point in ((x, y), ((x + x2) / 2, (y + y2) / 2), (x2, y2)):
                distance, share = aside(network, track, point, share)
                assert distance < EXACT, (sumo_lane, point)
        if not sumo_lane.startswith(":"):
            for place, end in ((points[0], 0.0), (points[-1], 1.0)):
                assert math.dist(place, exact(network, track, end)[:2]) < EXACT, sumo_lane


def check_identity(
    network: xodr.RoadNetwork, net: SumoNet, shares: tuple[float, ...] = (0.1, 0.5, 0.9)
) -> None:
    """A vehicle moved onto a driving lane lands on the SUMO lane that stands for
    it, exactly where it was put.

    Inside junctions the connecting lanes begin and end on top of each other: there the middle is
    asked only.
    """
    libsumo.start(
        [
            "sumo",
            "-n",
            str(net.path),
            "--no-step-log",
            "--no-warnings",
            "--collision.action",
            "none",
        ]
    )
    try:
        libsumo.route.add("dock", [sumo_net.DOCK])
        libsumo.vehicle.add("probe", "dock")
        for sumo_lane, track in net.sumo_lanes.items():
            if (
                use_of(
                    network.road(track.road_id).lane_type(
                        (track.start + track.end) / 2, track.lane_id
                    )
                ).kind
                != "traffic"
            ):
                continue
            for share in (0.5,) if sumo_lane.startswith(":") else shares:
                pose = exact(network, track, share)
                libsumo.vehicle.moveToXY(
                    "probe", "", -1, pose.x, pose.y, 90 - math.degrees(pose.h), 2
                )
                libsumo.simulationStep()
                assert math.dist(libsumo.vehicle.getPosition("probe"), pose[:2]) < 1e-3
                there = libsumo.vehicle.getLaneID("probe")
                assert (
                    there == sumo_lane or net.track(there) == track or sumo_lane.startswith(":")
                ), (sumo_lane, share, there)
    finally:
        libsumo.close()


MAPS = [name for name in builders.__all__ if name != "RoadMap"]


@pytest.mark.parametrize("rule", ["RHT", "LHT"])
@pytest.mark.parametrize("name", MAPS)
def test_lanes_keep_identity_and_geometry(name: str, rule: str, tmp_path: Path) -> None:
    network, net = built(getattr(builders, name)(rule=rule), tmp_path)
    assert net.fallback is None
    assert net.left_hand == (rule == "LHT")
    check_geometry(network, net)
    check_identity(network, net)


def corpus_roads() -> list[str]:
    folder = SHARED / "corpora"
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*.xodr"))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    corpus_roads()
    or [pytest.param("", marks=pytest.mark.skip(reason="no corpora beside this checkout"))],
)
def test_public_roads_become_networks_that_sumo_runs(name: str, corpora: Path) -> None:
    network, net = xodr.load(corpora / name), sumo_net.build(corpora / name)
    assert net.fallback is None
    check_geometry(network, net)
    check_identity(network, net, shares=(0.3,))


@pytest.mark.parametrize("rule", ["RHT", "LHT"])
def test_lanes_are_counted_from_the_kerb(rule: str, tmp_path: Path) -> None:
    _, net = built(builders.straight_highway(lanes=3, opposite_lanes=2, rule=rule), tmp_path)
    kerb, inner = (-1, 1) if rule == "LHT" else (1, -1)
    forward = [net.track(f"1/0+_{index}") for index in range(4)]
    assert [track.lane_id for track in forward if track] == [
        inner * number for number in (4, 3, 2, 1)
    ]
    assert all(track.start == 0 and track.end == 2000 for track in forward if track)
    backward = [net.track(f"1/0-_{index}") for index in range(4)]
    assert [track.lane_id for track in backward if track] == [
        kerb * number for number in (4, 3, 2, 1)
    ]
    assert all(track.start == 2000 and track.end == 0 for track in backward if track)


def test_lane_lookup_knows_the_piece_of_the_road(tmp_path: Path) -> None:
    _, net = built(builders.on_ramp(acceleration=250, taper=75), tmp_path)
    assert net.sumo_lane("2", -1, 10.0) == "2/0+_3"
    assert net.sumo_lane("2", -1, 300.0) == "2/1+_3"
    assert net.sumo_lane("2", -1, 500.0) == "2/2+_2"
    assert net.sumo_lane("101", -1, 1.0) is not None
    assert net.sumo_lane("2", 7, 1.0) is None
    assert net.track(f"{sumo_net.DOCK}_0") is None


@pytest.mark.parametrize("identity", ["a b", "ü/1;2", ":7", "dock", "junction", '"quoted"<&>', ""])
def test_road_ids_may_be_anything(identity: str, tmp_path: Path) -> None:
    escaped = identity.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    net = sumo_net.build(written(road(escaped), tmp_path))
    assert net.fallback is None
    assert [track.road_id for track in net.sumo_lanes.values()] == [identity]


def test_a_road_from_a_junction_to_itself_is_cut(tmp_path: Path) -> None:
    """SUMO has no edge from a node to itself."""
    text = road(
        "1", link='<predecessor elementType="road" elementId="1" contactPoint="end"/>'
        '<successor elementType="road" elementId="1" contactPoint="start"/>',
        lanes='<lane id="-1" type="driving"><link><predecessor id="-1"/><successor id="-1"/></link>'
        '<width sOffset="0" a="3" b="0" c="0" d="0"/></lane>',
    )  # fmt: skip
    net = sumo_net.build(written(text, tmp_path))
    assert sorted(net.sumo_lanes) == ["1/0+_0", "1/1+_0"]


def test_a_connecting_road_that_leads_nowhere_is_entered(tmp_path: Path) -> None:
    """Ways through junctions may end inside, as at the border of a map."""
    lanes = (
        '<lane id="-1" type="driving"><link>{}</link><width sOffset="0" a="3" b="0" c="0" '
        'd="0"/></lane>'
    )
    into = '<successor elementType="junction" elementId="9"/>'
    back = '<predecessor elementType="road" elementId="1" contactPoint="end"/>'
    text = road("1", lanes.format(""), link=into)
    text += road("2", lanes.format('<predecessor id="-1"/>'), x=100, junction="9", link=back)
    text += (
        '<junction id="9" name=""><connection id="0" incomingRoad="1" connectingRoad="2" '
        'contactPoint="start">'
        '<laneLink from="-1" to="-1"/></connection></junction>'
    )
    net = sumo_net.build(written(text, tmp_path))
    links = etree.parse(str(net.path)).iterfind("connection")
    assert ("1/0+", "2/0+") in {(link.get("from"), link.get("to")) for link in links}


def test_nobody_may_use_any_lane_and_the_dock_is_left(tmp_path: Path) -> None:
    net = sumo_net.build(
        written(
            road(
                "1",
                lanes='<lane id="-1" type="parking"><width sOffset="0" a="3" b="0" c="0" '
                'd="0"/></lane>',
            ),
            tmp_path,
        )
    )
    assert not net.sumo_lanes
    check_identity(xodr.load(tmp_path / "map.xodr"), net)


def test_there_is_a_plain_without_roads() -> None:
    net = sumo_net.build(None)
    assert net.fallback is None
    assert not net.sumo_lanes
    libsumo.start(["sumo", "-n", str(net.path), "--no-step-log"])
    try:
        libsumo.route.add("dock", [sumo_net.DOCK])
        libsumo.vehicle.add("probe", "dock")
        libsumo.vehicle.moveToXY("probe", "", -1, 12.0, 34.0, 90.0, 2)
        libsumo.simulationStep()
        assert libsumo.vehicle.getPosition("probe") == pytest.approx((12.0, 34.0))
    finally:
        libsumo.close()


def test_refused_roads_leave_the_dock_and_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = building.netconvert

    def refusing(plain, folder):
        if plain.lanes:
            raise NetconvertFailed("SUMO's netconvert cannot build a network: no reason")
        return real(plain, folder)

    monkeypatch.setattr(building, "netconvert", refusing)
    net = sumo_net.build(written(road("1"), tmp_path))
    assert net.fallback == "SUMO's netconvert cannot build a network: no reason"
    assert not net.sumo_lanes


# traffic lights ---------------------------------------------------------------------------------


def test_lanes_of_many_kilometres_are_no_work_for_netconvert(tmp_path: Path) -> None:
    text = road("1").replace('a="3.5"', 'a="2e9"')
    assert 'a="2e9"' in text
    assert (
        sumo_net.build(written(text, tmp_path)).fallback
        == "a lane is 2e+09 m wide, SUMO's networks have lanes up to 1000 m"
    )


def test_lights_of_a_junction_hold_all_ways_of_their_approach(tmp_path: Path) -> None:
    _, net = built(builders.four_way_intersection(lanes=2, signals=True), tmp_path)
    assert {signal: len(links) for signal, links in net.signals.items()} == dict.fromkeys("1234", 4)
    links = [link for links in net.signals.values() for link in links]
    assert len(set(links)) == 16
    assert {link.traffic_light for link in links} == {"junction/100"}


def signal(
    s: float,
    orientation: str = "+",
    kind: str = "1000001",
    dynamic: str = "yes",
    validity: str = "",
) -> str:
    return (
        f'<signals><signal id="7" s="{s}" t="-4" dynamic="{dynamic}" orientation="{orientation}" '
        f'type="{kind}" subtype="-1" '
        f'country="OpenDRIVE" zOffset="3">{validity}</signal></signals>'
    )


def test_a_light_on_the_open_road_holds_traffic_where_it_stands(tmp_path: Path) -> None:
    net = sumo_net.build(written(road("1", extra=signal(60)), tmp_path))
    assert net.track("1/0+_0") == LaneTrack("1", -1, 0, 60)
    assert net.track("1/1+_0") == LaneTrack("1", -1, 60, 100)
    (link,) = net.signals["7"]
    libsumo.start(["sumo", "-n", str(net.path), "--no-step-log"])
    try:
        libsumo.route.add("route", ["1/0+", "1/1+"])
        libsumo.vehicle.add("car", "route", departSpeed="max")
        libsumo.trafficlight.setRedYellowGreenState(link.traffic_light, "r")
        for _ in range(60):
            libsumo.simulationStep()
        assert 50 < libsumo.vehicle.getPosition("car")[0] < 60
    finally:
        libsumo.close()


@pytest.mark.parametrize(
    "extra",
    [
        signal(60, orientation="-"),
        signal(60, kind="1000002"),
        signal(60, kind="274"),
        signal(60, dynamic="no"),
        signal(60, validity='<validity fromLane="0" toLane="0"/>'),
    ],
    ids=["for the other direction", "for pedestrians", "a sign", "not a light", "for no lane"],
)
def test_other_signals_hold_nobody(extra: str, tmp_path: Path) -> None:
    assert sumo_net.build(written(road("1", extra=extra), tmp_path)).signals == {}


# cache ------------------------------------------------------------------------------------------


def test_the_second_time_nothing_is_converted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = builders.roundabout().write(tmp_path / "map.xodr")
    first = sumo_net.build(path)
    _build.cache_clear()
    monkeypatch.setattr(building, "convert", None)
    second = sumo_net.build(path)
    assert second.path == first.path
    assert second.sumo_lanes == first.sumo_lanes


def test_the_cache_answers_within_milliseconds(tmp_path: Path) -> None:
    path = builders.roundabout(lanes=2, arms=6, radius=40).write(tmp_path / "map.xodr")
    sumo_net.build(path)
    times = []
    for _ in range(5):
        _build.cache_clear()
        start = time.perf_counter()
        sumo_net.build(path)
        times.append(time.perf_counter() - start)
    assert min(times) < 0.005


@pytest.mark.parametrize("suffix", [".net.xml", ".json"])
@pytest.mark.parametrize(
    "damage",
    [b"", b"{}", b'{"digest": 1}', b"\xff\xfe"],
    ids=["empty", "object", "digest", "binary"],
)
def test_damaged_entries_are_built_again(
    suffix: str, damage: bytes, tmp_path: Path, cache_folder: Path
) -> None:
    path = written(road("1"), tmp_path)
    net = sumo_net.build(path)
    (file,) = (cache_folder / "sumo").glob(f"*{suffix}")
    intact = file.read_bytes()
    file.write_bytes(damage)
    _build.cache_clear()
    assert sumo_net.build(path).sumo_lanes == net.sumo_lanes
    assert file.read_bytes() == intact
    assert len(list((cache_folder / "sumo").iterdir())) == 2


def test_the_same_roads_give_the_same_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = builders.t_junction(signals=True).write(tmp_path / "map.xodr")
    first = sumo_net.build(path).path.read_bytes()
    monkeypatch.setenv("XOSC_CACHE_DIR", str(tmp_path / "elsewhere"))
    _build.cache_clear()
    other = path.rename(tmp_path / "other name.xodr")
    assert sumo_net.build(other).path.read_bytes() == first


def test_other_content_is_another_entry() -> None:
    assert CacheEntry(b"a").network != CacheEntry(b"b").network


def test_bad_files_and_folders_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InvalidFile, match="no such file"):
        sumo_net.build(tmp_path / "absent.xodr")
    with pytest.raises(InvalidFile):
        sumo_net.build(tmp_path)
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XOSC_CACHE_DIR", str(tmp_path / "file"))
    with pytest.raises(UsageError, match="XOSC_CACHE_DIR"):
        sumo_net.build(written(road("1"), tmp_path))


def test_a_network_is_built_anew_in_another_cache_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A command without a cache of its own builds in a folder that is gone afterwards."""
    roads = builders.roundabout().write(tmp_path / "map.xodr")
    for name in ("first", "second"):
        monkeypatch.setenv("XOSC_CACHE_DIR", str(tmp_path / name))
        for path in (None, roads):
            assert sumo_net.build(path).path.is_relative_to(tmp_path / name)


def test_parallel_processes_may_build_the_same_network(tmp_path: Path) -> None:
    path = builders.roundabout().write(tmp_path / "map.xodr")
    script = (
        "import sys; from xodr.formats import sumo_net; "
        "print(len(sumo_net.build(sys.argv[1]).sumo_lanes))"
    )
    started = [
        subprocess.Popen([sys.executable, "-c", script, path], stdout=subprocess.PIPE, text=True)
        for _ in range(4)
    ]
    assert {process.communicate(timeout=60)[0].strip() for process in started} == {
        str(len(sumo_net.build(path).sumo_lanes))
    }


def test_access_restrictions_hold_in_sumo_from_their_places_on(tmp_path: Path) -> None:
    """A bus lane from 40 m on, whose end is said at 70 m, and no trucks on the
    other lane: as 1.8 and as 1.7 write them.
    """
    width = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
    bus = (
        '<access sOffset="40" rule="allow"><restriction type="bus"/><restriction '
        'type="bicycle"/></access>'
    )
    over = '<access sOffset="70" rule="deny"><restriction type="none"/></access>'
    trucks = (
        '<access sOffset="0" rule="deny" restriction="truck"/><access sOffset="0" '
        'restriction="delivery"/>'
    )
    lanes = (
        f'<lane id="-1" type="driving">{width}{trucks}</lane><lane id="-2" '
        f'type="driving">{width}{bus}{over}</lane>'
    )
    net = sumo_net.build(written(road("1", lanes), tmp_path))
    found = {lane.get("id"): lane for lane in etree.parse(str(net.path)).iter("lane")}

    def may(lane_id: int, s: float, user: str) -> bool:
        lane = found[net.sumo_lane("1", lane_id, s)]
        return (
            user in lane.get("allow", user).split() and user not in lane.get("disallow", "").split()
        )

    for s, open_to_cars in ((20.0, True), (55.0, False), (85.0, True)):
        assert [may(-2, s, user) for user in ("bus", "bicycle", "emergency")] == [True] * 3
        assert [may(-2, s, user) for user in ("passenger", "truck")] == [open_to_cars] * 2
        assert [
            may(-1, s, user) for user in ("passenger", "bus", "truck", "trailer", "delivery")
        ] == [True, True] + [False] * 3
