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
from tests.runner.scene import vehicle

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
    def note(self, *line: str) -> None:
        self.lines.append((self.time, *line))


def contacts_of(*members: Entity) -> tuple[Contacts, Any]:
    entities = Entities({e.name: e for e in members})
    sim = Log(entities=entities, step_index=0, time=0.0, changes=0, lines=[])
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
