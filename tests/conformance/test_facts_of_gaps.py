"""Small inputs with one answer by the standard: distances that actions keep, lanes of no width,
rings of several roads, left-hand traffic.

Each case names the class of the OpenSCENARIO XML reference that it tests.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from tests.conformance.scenes import (
    CHANGE,
    lane_position,
    placed_beside,
    play,
    start,
    triggered,
)
from tests.conformance.support import at, events, track
from tests.runner.files import ROADS, place, story


def keep(attributes: str, inside: str = "") -> str:
    return (
        "<PrivateAction><LongitudinalAction><LongitudinalDistanceAction"
        ' entityRef="Lead" '
        f"{attributes}>{inside}</LongitudinalDistanceAction></LongitudinalAction></PrivateAction>"
    )


LIMITS = '<DynamicConstraints maxAcceleration="4" maxDeceleration="4" maxSpeed="50"/>'
KEPT = {
    # Lead drives at 10 m/s; boxes are 5 m long, the reference point is 1 m before the rear
    "distance": ('distance="30" freespace="false" continuous="true"', 30.0),
    "freespace": ('distance="30" freespace="true" continuous="true"', 35.0),
    "time": ('timeGap="2" freespace="false" continuous="true"', 20.0),
    "time, freespace": ('timeGap="2" freespace="true" continuous="true"', 25.0),
    "behind": (
        'distance="30" freespace="false" continuous="true" displacement="trailingReferencedEntity"',
        30.0,
    ),
    "ahead": (
        'distance="30" freespace="false" continuous="true" displacement="leadingReferencedEntity"',
        -30.0,
    ),
    "any": ('distance="30" freespace="false" continuous="true" displacement="any"', 30.0),
    "lane": ('distance="30" freespace="false" continuous="true" coordinateSystem="lane"', 30.0),
    "road": ('distance="30" freespace="true" continuous="true" coordinateSystem="road"', 35.0),
}


@pytest.mark.parametrize("limited", [False, True], ids=["rigid", "limited"])
@pytest.mark.parametrize("case", KEPT)
def test_a_distance_that_is_kept(case: str, limited: bool, tmp_path: Path) -> None:
    """LongitudinalDistanceAction: distance or timeGap, freespace, displacement,
    coordinateSystem.
    """
    attributes, apart = KEPT[case]
    init = place("Ego", 100, 10) + place("Lead", 150, 10, -2)
    action = keep(attributes, LIMITS if limited else "")
    result = play(tmp_path, init, story("Ego", [(1.0, action)]))
    ego, lead = track(result, "Ego"), track(result, "Lead")
    tolerance = 2.0 if apart < 0 else 0.2  # it has to overtake first
    assert at(lead, 9.9, "x") - at(ego, 9.9, "x") == pytest.approx(
        apart, abs=tolerance if limited else 1e-3
    )


ASIDE = {
    "left": (
        'distance="2" freespace="false" continuous="true" displacement="leftToReferencedEntity"',
        -3.25,
    ),
    "right": (
        'distance="2" freespace="false" continuous="true" displacement="rightToReferencedEntity"',
        -7.25,
    ),
    "any": ('distance="2" freespace="false" continuous="true" displacement="any"', -3.25),
    "freespace": (
        'distance="1" freespace="true" continuous="true" displacement="leftToReferencedEntity"',
        -2.25,
    ),
    "lane": (
        (
            'distance="2" freespace="false" continuous="true" '
            'displacement="leftToReferencedEntity" coordinateSystem="lane"'
        ),
        -3.25,
    ),
}


@pytest.mark.parametrize("case", ASIDE)
def test_a_lateral_distance_that_is_kept(case: str, tmp_path: Path) -> None:
    """LateralDistanceAction: sides are those of the reference, freespace is between boxes."""
    attributes, y = ASIDE[case]
    action = (
        f'<PrivateAction><LateralAction><LateralDistanceAction entityRef="Lead" {attributes}/>'
        "</LateralAction></PrivateAction>"
    )
    init = place("Ego", 100, 10) + place("Lead", 150, 10, -2)
    ego = track(play(tmp_path, init, story("Ego", [(1.0, action)])), "Ego")
    assert at(ego, 9.0, "y") == pytest.approx(y, abs=0.02)


TIMES = {
    # Ego closes at 10 m/s: 100 m between reference points, 95 m between boxes
    "to an entity": ("false", '<EntityRef entityRef="Lead"/>', 8.0, 2.0),
    "freespace": ("true", '<EntityRef entityRef="Lead"/>', 8.0, 1.5),
    "to a place": ("false", f"<Position>{lane_position(-1, 300)}</Position>", 8.0, 2.0),
}


@pytest.mark.parametrize("case", TIMES)
def test_times_to_collision(case: str, tmp_path: Path) -> None:
    """TimeToCollisionCondition: distance over closing speed; of a place, over
    the entity's speed.
    """
    freespace, target, value, time = TIMES[case]
    speeds = (20.0, 0.0) if "place" in case else (20.0, 10.0)
    text = (
        f'<TimeToCollisionCondition freespace="{freespace}" rule="lessOrEqual" value="{value}"'
        ' coordinateSystem="lane" '
        'relativeDistanceType="longitudinal"><TimeToCollisionConditionTarget>'
        f"{target}</TimeToCollisionConditionTarget></TimeToCollisionCondition>"
    )
    init = place("Ego", 100, speeds[0]) + place("Lead", 200, speeds[1])
    assert triggered(tmp_path, text, init) == pytest.approx(time, abs=0.051)


# lanes of no width ----------------------------------------------------------------------------


def flat_lane(folder: Path) -> None:
    """The straight road, with a lane -1 of no width: lane -2 is beside the middle."""
    text = (ROADS / "straight.xodr").read_text(encoding="utf-8")
    at_lane = text.index('<lane id="-1"')
    end = text.index("</lane>", at_lane)
    lane = text[at_lane:end].replace('a="3.5"', 'a="0"')
    (folder / "straight.xodr").write_text(text[:at_lane] + lane + text[end:], encoding="utf-8")


FLAT = {
    "from the inside": ('<RelativeLanePosition entityRef="Lead" dLane="-1" ds="10"/>', 1, 0.0),
    "over it": ('<RelativeLanePosition entityRef="Lead" dLane="-2" ds="10"/>', 1, -1.75),
    "from the outside": ('<RelativeLanePosition entityRef="Lead" dLane="2" ds="10"/>', -2, 1.75),
}


@pytest.mark.parametrize("case", FLAT)
def test_lanes_of_no_width_count(case: str, tmp_path: Path) -> None:
    """RelativeLanePosition: dLane counts the lanes of the section, the centre
    lane not, whatever their width.
    """
    text, lane, y = FLAT[case]
    flat_lane(tmp_path)
    lead = lane_position(lane, 500 if lane > 0 else 100)
    ego, _ = placed_beside(tmp_path, text, lead=lead)
    assert at(ego, 8.0, "y") == pytest.approx(y, abs=1e-6)


def test_a_car_on_a_lane_of_no_width_is_beside_it(tmp_path: Path) -> None:
    """LanePosition: a lane of no width has a middle; what stands there is over its neighbours."""
    flat_lane(tmp_path)
    init = start("Ego", lane_position(-1, 100), 10) + start("Lead", lane_position(-2, 300), 0)
    ego = track(play(tmp_path, init), "Ego")
    assert at(ego, 2.0, "x") == pytest.approx(120.0, abs=0.01)
    assert at(ego, 2.0, "y") == pytest.approx(0.0, abs=0.01)


# a ring of several roads -----------------------------------------------------------------------

ROUND = 400.0


def ring_of(folder: Path, roads: int, reversed_ones: tuple[int, ...] = ()) -> None:
    """A closed way of 400 m in roads 1, 2, … of equal length; s of some runs against it."""
    text = (ROADS / "straight.xodr").read_text(encoding="utf-8")
    head, rest = text.split("<road ", 1)
    body, tail = rest.rsplit("</road>", 1)
    length, radius = ROUND / roads, ROUND / (2 * math.pi)
    made = []
    for number in range(roads):
        back = number + 1 in reversed_ones
        angle = 2 * math.pi * (number + (1 if back else 0)) / roads
        x, y = radius * math.sin(angle), radius * (1 - math.cos(angle))
        h = angle + (math.pi if back else 0.0)
        road = "<road " + body + "</road>"
        road = road.replace('id="1" junction', f'id="{number + 1}" junction').replace(
            'length="1000"', f'length="{length}"'
        )
        road = re.sub(r'x="0" y="0" hdg="0"', f'x="{x}" y="{y}" hdg="{h}"', road)
        road = road.replace("<line/>", f'<arc curvature="{(-1 if back else 1) / radius}"/>')
        links, lanes = {}, {}
        for way, step in (("next", 1), ("previous", -1)):
            index = (number + step) % roads
            other_back = index + 1 in reversed_ones
            contact = (
                ("end" if other_back else "start")
                if way == "next"
                else ("start" if other_back else "end")
            )
            side = "successor" if (way == "next") != back else "predecessor"
            links[side] = (
                f'<{side} elementType="road" elementId="{index + 1}" contactPoint="{contact}"/>'
            )
            lanes[side] = -1 if other_back != back else 1
        link = f"<link>{links['predecessor']}{links['successor']}</link><type"
        road = road.replace("<type", link, 1)
        for lane in (1, 2, -1, -2):
            inner = "".join(
                f'<{side} id="{lane * lanes[side]}"/>' for side in ("predecessor", "successor")
            )
            road = re.sub(
                rf'(<lane id="{lane}" type="driving" level="false">\s*)<link/>',
                rf"\1<link>{inner}</link>",
                road,
            )
        made.append(road)
    (folder / "straight.xodr").write_text(head + "".join(made) + tail, encoding="utf-8")


def on_ring(way: float, lane: int, roads: int, reversed_ones: tuple[int, ...] = ()) -> str:
    """A place so far along the ring (m), in a lane counted as along it."""
    length = ROUND / roads
    number, s = divmod(way % ROUND, length)
    back = int(number) + 1 in reversed_ones
    return lane_position(
        -lane if back else lane, length - s if back else s, road=str(int(number) + 1)
    )


RINGS = {
    "2 roads": (2, ()),
    "4 roads": (4, ()),
    "one against": (4, (2,)),
    "two against": (4, (2, 3)),
}


@pytest.mark.parametrize("kind", RINGS)
def test_a_ring_of_roads_is_driven_round(kind: str, tmp_path: Path) -> None:
    roads, against = RINGS[kind]
    ring_of(tmp_path, roads, against)
    init = start("Ego", on_ring(350, -1, roads, against), 20) + start(
        "Lead", on_ring(200, -2, roads, against), 0
    )
    ego = track(play(tmp_path, init), "Ego")
    outside = (ROUND / (2 * math.pi) + 1.75) / (ROUND / (2 * math.pi))
    angle = 2 * math.pi * (350 + 20 * 8.0 / outside) / ROUND
    radius = ROUND / (2 * math.pi)
    assert at(ego, 8.0, "x") == pytest.approx((radius + 1.75) * math.sin(angle), abs=0.05)
    assert at(ego, 8.0, "y") == pytest.approx(radius - (radius + 1.75) * math.cos(angle), abs=0.05)


@pytest.mark.parametrize(
    ("own", "goal"), [(350.0, 40.0), (350.0, 250.0), (20.0, 300.0), (120.0, 60.0)]
)
@pytest.mark.parametrize("kind", RINGS)
def test_a_synchronisation_on_a_ring_of_roads_looks_ahead(
    kind: str, own: float, goal: float, tmp_path: Path
) -> None:
    """SynchronizeAction: the target lies ahead on the way, also more than half of the ring away."""
    roads, against = RINGS[kind]
    ring_of(tmp_path, roads, against)
    way = (goal - own) % ROUND
    action = (
        '<PrivateAction><SynchronizeAction masterEntityRef="Lead"><TargetPositionMaster>'
        f"{on_ring(100, -2, roads, against)}</TargetPositionMaster><TargetPosition>"
        f"{on_ring(goal, -1, roads, against)}</TargetPosition></SynchronizeAction></PrivateAction>"
    )
    init = start("Ego", on_ring(own, -1, roads, against), way / 8) + start(
        "Lead", on_ring(20, -2, roads, against), 80 * (1 + 5.25 * 2 * math.pi / ROUND) / 8
    )
    result = play(tmp_path, init, story("Ego", [(0.0, action)]))
    (end,) = events(result, "endTransition", "action0")
    assert end.time == pytest.approx(8.0, abs=0.2)
    angle = 2 * math.pi * goal / ROUND
    ego, radius = track(result, "Ego"), ROUND / (2 * math.pi)
    away = math.dist(
        (at(ego, end.time, "x"), at(ego, end.time, "y")),
        ((radius + 1.75) * math.sin(angle), radius - (radius + 1.75) * math.cos(angle)),
    )
    assert away < 1.0


@pytest.mark.parametrize(
    ("own", "lead", "apart"), [(390, 10, 20), (10, 390, -20), (350, 60, 110), (60, 350, -110)]
)
@pytest.mark.parametrize("kind", RINGS)
def test_distances_on_a_ring_of_roads_are_the_shorter_way(
    kind: str, own: float, lead: float, apart: float, tmp_path: Path
) -> None:
    """RelativeDistanceCondition, longitudinal on roads: the shorter way round."""
    roads, against = RINGS[kind]
    ring_of(tmp_path, roads, against)
    init = start("Ego", on_ring(own, -1, roads, against), 0) + start(
        "Lead", on_ring(lead, -1, roads, against), 0
    )
    text = (
        '<RelativeDistanceCondition entityRef="Lead" freespace="false" '
        'relativeDistanceType="longitudinal"'
        ' coordinateSystem="road" value="{}" rule="{}"/>'
    )
    assert triggered(tmp_path, text.format(abs(apart) - 0.5, "greaterThan"), init) == 0.0
    assert triggered(tmp_path, text.format(abs(apart) + 0.5, "lessThan"), init) == 0.0


# left-hand traffic -----------------------------------------------------------------------------


@pytest.mark.parametrize(("target", "y"), [("+1", 5.25), ("-1", -1.75)])
def test_lanes_count_to_the_left_of_a_car_in_left_hand_traffic(
    target: str, y: float, tmp_path: Path
) -> None:
    """LaneChangeAction, RelativeTargetLane: positive to the left of the
    reference; lane 1 is driven along s.
    """
    change = CHANGE.format(
        "", f'<RelativeTargetLane entityRef="Ego" value="{target.removeprefix("+")}"/>'
    )
    init = place("Ego", 100, 10, 1) + place("Lead", 900, 0, 1)
    ego = track(play(tmp_path, init, story("Ego", [(1.0, change)]), road="straight_lht"), "Ego")
    assert (at(ego, 8.0, "x") > 150, at(ego, 8.0, "y")) == (True, pytest.approx(y, abs=0.01))


def test_a_left_hand_clearance_counts_lanes_to_the_left(tmp_path: Path) -> None:
    """RelativeClearanceCondition: from and to count lanes to the left of the entity."""
    clear = (
        '<RelativeClearanceCondition freeSpace="false" oppositeLanes="false" distanceForward="60"'
        ' distanceBackward="10"><RelativeLaneRange from="{0}" '
        'to="{0}"/></RelativeClearanceCondition>'
    )
    init = place("Ego", 100, 10, 1) + place("Lead", 140, 10, 2)
    assert triggered(tmp_path, clear.format(1), init, road="straight_lht") is None
    assert triggered(tmp_path, clear.format(0), init, road="straight_lht") == 0.0


FINAL = {
    "speed": ('<AbsoluteSpeed value="12"/>', 12.0),
    "delta": ('<RelativeSpeedToMaster value="3" speedTargetValueType="delta"/>', 18.0),
    "factor": ('<RelativeSpeedToMaster value="0.8" speedTargetValueType="factor"/>', 12.0),
    "steady": (
        '<AbsoluteSpeed value="12"><TargetDistanceSteadyState distance="30"/></AbsoluteSpeed>',
        12.0,
    ),
}


@pytest.mark.parametrize("case", FINAL)
def test_a_synchronisation_ends_with_its_final_speed(case: str, tmp_path: Path) -> None:
    """FinalSpeed: absolute, or relative to the master; steady over a distance before the target."""
    final, speed = FINAL[case]
    action = (
        '<PrivateAction><SynchronizeAction masterEntityRef="Lead"><TargetPositionMaster>'
        f"{lane_position(-2, 250)}</TargetPositionMaster><TargetPosition>{lane_position(-1, 250)}"
        f"</TargetPosition><FinalSpeed>{final}</FinalSpeed></SynchronizeAction></PrivateAction>"
    )
    init = place("Ego", 120, 10) + place("Lead", 145, 15, -2)
    result = play(tmp_path, init, story("Ego", [(0.0, action)]))
    (end,), ego = events(result, "endTransition", "action0"), track(result, "Ego")
    assert end.time == pytest.approx(7.0, abs=0.11)
    assert at(ego, 7.05, "speed") == pytest.approx(speed, abs=0.1)
    assert at(ego, 7.0, "x") == pytest.approx(250.0, abs=1.0)
    if case == "steady":
        assert at(ego, 5.0, "speed") == pytest.approx(speed, abs=0.1)
