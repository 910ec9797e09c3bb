"""Boxes and contacts: overlap and gap against shapely, and the beginnings and ends of contacts."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon

from runner.engine.participants.boxes import Spot, box_corners, gap, overlap
from runner.engine.participants.declaration import BoundingBox
from runner.engine.participants.entity import Displacement, Entities, Entity
from runner.engine.storyboard.collision import Contacts
from tests.runner.movement import Move, move, moves
from tests.runner.scene import put, scene, vehicle

CAR = BoundingBox(1.4, 0.0, 0.75, 4.5, 1.8, 1.5)


def entity(
    name: str = "a",
    x: float = 0.0,
    y: float = 0.0,
    h: float = 0.0,
    box: BoundingBox = CAR,
    z: float = 0.0,
) -> Entity:
    return vehicle(name, box, x=x, y=y, z=z, h=h, placed=True)


coordinate = st.floats(-12.0, 12.0)
far = st.sampled_from([-30.0, 0.0, 30.0]) | st.floats(-60.0, 60.0)
angle = st.floats(-math.pi, math.pi)
size = st.floats(0.1, 9.0)
boxes = st.builds(
    BoundingBox, st.floats(-2.0, 3.0), st.floats(-0.5, 0.5), st.just(0.75), size, size, st.just(1.5)
)
entities = st.builds(entity, st.just("e"), coordinate, coordinate, angle, boxes)


@given(entities, entities)
def test_gap_is_the_distance_of_the_outlines(a: Entity, b: Entity) -> None:
    expected = Polygon(box_corners(a.x, a.y, a.h, a.box)).distance(
        Polygon(box_corners(b.x, b.y, b.h, b.box))
    )
    assert gap(a, b) == pytest.approx(expected, abs=1e-9)
    assert gap(a, b) == pytest.approx(gap(b, a), abs=1e-9)


@given(entities, entities)
def test_boxes_overlap_where_their_gap_is_zero(a: Entity, b: Entity) -> None:
    assert overlap(a, b) == (gap(a, b) == 0.0) == overlap(b, a)


@given(entities, coordinate, coordinate)
def test_a_position_is_a_box_without_extent(a: Entity, x: float, y: float) -> None:
    assert gap(a, Spot(x, y, 0.75, 0.0)) == pytest.approx(
        Polygon(box_corners(a.x, a.y, a.h, a.box)).distance(Point(x, y)), abs=1e-9
    )


def test_touching_boxes_overlap() -> None:
    assert overlap(entity(), entity(x=4.5))
    assert not overlap(entity(), entity(x=4.5001))


def test_crossed_boxes_without_a_corner_inside_each_other_overlap() -> None:
    assert overlap(entity(), entity(x=1.4, y=-1.4, h=math.pi / 2))


def test_a_bridge_keeps_boxes_apart() -> None:
    assert not overlap(entity(), entity(z=5.0))
    assert gap(entity(), entity(z=5.0)) == pytest.approx(3.5)


class Log(SimpleNamespace):
    def note(self, kind: str, subject: str, text: str, time: float | None = None) -> None:
        self.lines.append((self.time if time is None else time, kind, subject, text))


def contacts_of(*members: Entity) -> tuple[Contacts, Any]:
    entities = Entities({e.name: e for e in members})
    sim = Log(entities=entities, step_index=0, time=0.0, dt=1.0, changes=0, lines=[])
    sim.displacement = Displacement(sim)  # type: ignore[arg-type]
    return Contacts(sim), sim  # type: ignore[arg-type]


def test_contacts_begin_and_end_once() -> None:
    a, b, far = entity("a"), entity("b", x=10.0), entity("far", x=500.0)
    contacts, sim = contacts_of(a, b, far)
    for time, x in enumerate((10.0, 4.0, 3.0, 9.0)):
        sim.time, b.x = float(time), x
        sim.step_index += 1
        contacts.update()
    assert contacts.history == [(1.0, "a", "b")]
    assert [line[1] for line in sim.lines] == ["collision", "collisionEnd"]
    assert contacts.pairs == set()


def test_everyone_touched_is_named() -> None:
    a, b, c = entity("a"), entity("b", x=4.0), entity("c", x=-4.0)
    contacts, _ = contacts_of(a, b, c)
    contacts.update()
    assert [other.name for other in contacts.of(a)] == ["b", "c"]
    assert [other.name for other in contacts.of(b)] == ["a"]


def test_a_tractor_does_not_collide_with_its_trailer() -> None:
    tractor, trailer = entity("tractor"), entity("trailer", x=-3.0)
    tractor.controls.trailer, trailer.controls.tractor = trailer, tractor
    contacts, _ = contacts_of(tractor, trailer)
    contacts.update()
    assert contacts.pairs == set()


def test_who_takes_the_place_of_another_is_noticed() -> None:
    a, left, came = entity("a"), entity("left", x=50.0), entity("came", x=4.0)
    contacts, sim = contacts_of(a, left)
    contacts.update()
    del sim.entities["left"]
    sim.entities["came"] = came
    sim.step_index, sim.changes = 1, 1
    contacts.update()
    assert contacts.pairs == {("a", "came")}


def test_absent_entities_touch_nobody() -> None:
    a, b = entity("a"), entity("b")
    b.active = False
    contacts, _ = contacts_of(a, b)
    contacts.update()
    assert contacts.pairs == set()


def driven(
    sim: Any, contacts: Contacts, ways: dict[Entity, tuple[float, float, float, float, float]]
) -> None:
    """One step of 1 s: entities at (x, y, h) that have moved at (vx, vy)."""
    for member, (x, y, h, vx, vy) in ways.items():
        member.turn = h - member.h
        member.x, member.y, member.h, member.vx, member.vy = x, y, h, vx, vy
        member.speed = math.copysign(math.hypot(vx, vy), vx * math.cos(h) + vy * math.sin(h))
    sim.step_index += 1
    sim.time += sim.dt
    contacts.update()


@pytest.mark.parametrize("others", [0, 5])
@pytest.mark.parametrize("speed", [20.0, -20.0])
def test_a_contact_within_a_step_has_its_time(others: int, speed: float) -> None:
    a, b = entity("a", x=-math.copysign(10.0, speed)), entity("b")
    more = [entity(f"c{i}", x=1000.0 + 20.0 * i) for i in range(others)]
    contacts, sim = contacts_of(a, b, *more)
    contacts.update()
    driven(sim, contacts, {a: (math.copysign(10.0, speed), 0.0, 0.0, speed, 0.0)})
    assert contacts.history == [(pytest.approx(5.5 / 20.0), "a", "b")]  # 10 m less a length
    assert [other.name for other in contacts.of(a)] == ["b"]
    driven(sim, contacts, {a: (a.x + speed, 0.0, 0.0, speed, 0.0)})
    assert len(contacts.history) == 1
    assert contacts.pairs == set()
    assert [line[:2] for line in sim.lines] == [
        (pytest.approx(0.275), "collision"),
        (2.0, "collisionEnd"),
    ]


def test_passing_in_the_next_lane_or_turning_away_is_no_contact() -> None:
    a, b = entity("a", x=-10.0, y=1.9), entity("b")
    contacts, sim = contacts_of(a, b)
    contacts.update()
    driven(sim, contacts, {a: (10.0, 1.9, 0.0, 20.0, 0.0)})
    assert contacts.history == []
    # A quarter of a circle of 10 m about b: the chord cuts through it, the arc does not
    a, b = entity("a", x=5.0, y=0.0, h=math.pi / 2), entity("b", x=-1.4)
    contacts, sim = contacts_of(a, b)
    contacts.update()
    driven(sim, contacts, {a: (0.0, 5.0, math.pi, -5.0, 5.0)})
    assert contacts.history == []


def test_who_slides_into_the_next_lane_does_not_swing_round() -> None:
    """A lane change at 1 m/s with the heading of the lane, 20 cm beside another one."""
    a, b = entity("a", x=-1.0, y=3.0), entity("b", y=0.0)
    contacts, sim = contacts_of(a, b)
    contacts.update()
    driven(sim, contacts, {a: (1.0, 2.2, 0.0, 2.0, -0.8)})
    assert contacts.history == []


def test_who_is_put_elsewhere_has_not_passed_what_is_between() -> None:
    a, b = entity("a", x=-30.0), entity("b")
    contacts, sim = contacts_of(a, b)
    contacts.update()
    driven(sim, contacts, {a: (30.0, 0.0, 0.0, 60.0, 0.0)})
    assert contacts.history  # at 60 m/s
    a.x, a.speed = -30.0, 0.0
    contacts, sim = contacts_of(a, b)
    contacts.update()
    a.x, a.vx = 30.0, 60.0  # at a speed of 0
    sim.step_index += 1
    contacts.update()
    assert contacts.history == []


def test_a_bridge_keeps_ways_apart() -> None:
    a, b = entity("a", x=-10.0, z=5.0), entity("b")
    contacts, sim = contacts_of(a, b)
    contacts.update()
    driven(sim, contacts, {a: (10.0, 0.0, 0.0, 20.0, 0.0)})
    assert contacts.history == []


@pytest.mark.slow
@given(
    st.lists(
        st.tuples(coordinate, coordinate, angle, st.floats(-12.0, 12.0)), min_size=2, max_size=7
    )
)
def test_ways_of_a_step_touch_where_samples_of_them_do(
    ways: list[tuple[float, float, float, float]],
) -> None:
    members = [entity(f"e{i}", *way[:3]) for i, way in enumerate(ways)]
    contacts, sim = contacts_of(*members)
    contacts.update()
    before = set(contacts.pairs)
    step = {
        member: (
            member.x + speed * math.cos(member.h),
            member.y + speed * math.sin(member.h),
            member.h,
            speed * math.cos(member.h),
            speed * math.sin(member.h),
        )
        for member, (*_, speed) in zip(members, ways, strict=True)
    }
    starts = [(member.x, member.y) for member in members]
    sampled = set()
    for share in range(101):
        for member, (x, y), (*_, speed) in zip(members, starts, ways, strict=True):
            member.x = x + speed * math.cos(member.h) * share / 100
            member.y = y + speed * math.sin(member.h) * share / 100
        sampled |= {
            (a.name, b.name)
            for i, a in enumerate(members)
            for b in members[i + 1 :]
            if overlap(a, b)
        }
    driven(sim, contacts, step)
    found = {(first, second) for _, first, second in contacts.history} | before
    assert sampled <= found
    for time, first, second in contacts.history:
        a, b = sim.entities[first], sim.entities[second]
        for member in (a, b):
            x, y = starts[members.index(member)]
            member.x, member.y = x + member.vx * time, y + member.vy * time
        assert (first, second) in sampled or gap(a, b) < 1e-6


@pytest.mark.slow
@given(st.lists(st.tuples(far, coordinate, angle), min_size=2, max_size=9), moves(9))
def test_the_sweep_finds_what_comparing_all_pairs_finds(
    places: list[tuple[float, float, float]], steps: list[tuple[Move, ...]]
) -> None:
    members = [entity(f"e{i}", *place) for i, place in enumerate(places)]
    contacts, sim = contacts_of(*members)
    for step in ((), *steps):
        for member, by in zip(members, step, strict=False):
            move(member, by)
        sim.step_index += 1
        contacts.update()
        present = [member for member in members if member.active]
        assert contacts.pairs == {
            (a.name, b.name)
            for i, a in enumerate(present)
            for b in present[i + 1 :]
            if overlap(a, b)
        }


def test_turns_are_the_changes_of_headings() -> None:
    sim = scene("Ego", road="curve")
    ego = put(sim, "Ego", -1, 5.0, speed=15.0)
    ego.controls.target_speed = 15.0
    before, turned = ego.h, 0.0
    for _ in range(30):
        sim.tick()
        turned += ego.turn
    assert abs(turned) > 0.05
    assert math.remainder(ego.h - before - turned, math.tau) == pytest.approx(0.0, abs=1e-9)
