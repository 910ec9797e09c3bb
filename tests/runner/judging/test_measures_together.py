"""Measures of all others at once are those of each other alone, whose rows are
compared one by one.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from runner.engine.participants.declaration import BoundingBox
from runner.engine.participants.outlines import boxes_overlap
from runner.judging.measures import relations as module
from runner.judging.measures.criticality import Criticality, criticality
from runner.judging.measures.measure import LONGEST_PET, Extreme
from runner.judging.measures.relations import MotionRows, common
from runner.judging.measures.risk_field import risk_field

STEP = 0.1


def traffic(seed: int) -> list[MotionRows]:
    """Participants of all sizes that come and go, on one road, another one or none, some across,
    some on a bridge, some late.
    """
    draw = np.random.default_rng(seed)
    return [_drawn(draw, f"p{index}") for index in range(int(draw.integers(2, 9)))]


def _drawn(draw: np.random.Generator, name: str) -> MotionRows:
    first, count = int(draw.integers(0, 30)), int(draw.integers(1, 60))
    time = (first + np.arange(count)) * STEP
    if count > 5 and draw.random() < 0.3:
        time = np.delete(time, slice(2, 4))
    h = float(draw.choice([0.0, np.pi / 2, np.pi, 0.3]))
    speed = np.full(len(time), draw.choice([0.0, 5.0, 12.0])) + draw.normal(0.0, 0.5, len(time))
    way = np.cumsum(speed) * STEP
    x, y = (
        draw.uniform(-30.0, 30.0) + way * np.cos(h),
        draw.choice([0.0, 1.5, 3.5, -8.0]) + way * np.sin(h),
    )
    road = np.where(
        np.arange(len(time)) < draw.integers(0, 70),
        draw.choice(np.array([None, "1", "2"], object)),
        "3",
    )
    box = BoundingBox(
        *draw.uniform([0.0, 0.0, 0.5, 0.5, 0.5, 1.0], [1.5, 0.1, 0.8, 8.0, 2.5, 2.0]).tolist()
    )
    columns = {
        "time": time,
        "x": x,
        "y": y,
        "z": np.full(len(time), draw.choice([0.0, 0.0, 6.0])),
        "h": np.full(len(time), h),
    }
    return MotionRows.from_columns(
        name, box, columns | {"speed": speed, "road_id": road, "s": x, "t": y}
    )


def plain_encroachment(ego: MotionRows, other: MotionRows) -> Extreme | None:
    """By all pairs of rows; times on the grid of the step."""
    rows = [
        np.array(each)
        for each in zip(*product(range(len(ego.time)), range(len(other.time))), strict=True)
    ]
    a, b = ego.at(rows[0]), other.at(rows[1])
    hits = np.flatnonzero(boxes_overlap(a, b))
    step = float(np.diff(ego.time).min()) if len(ego.time) > 1 else 0.05
    lag = np.abs(np.round(a.time / step).astype(int) - np.round(b.time / step).astype(int))
    within = hits[lag[hits] <= int(LONGEST_PET / step)]
    return min(
        (Extreme(int(lag[row]) * step, float(a.time[row]), other.name) for row in within),
        default=None,
    )


def plain_field(ego: MotionRows, other: MotionRows) -> list[Extreme]:
    """By the field of all rows."""
    a, b, *_ = common(ego, (other,))
    field = risk_field(a, b) if len(a.time) else ()
    return [
        Extreme(float(values.max()), float(a.time[values.argmax()]), other.name) for values in field
    ]


def same(one: Criticality, alone: list[Criticality]) -> None:
    """Whether measures of all are the least, or any, of those of each."""
    for name in ("ttc", "thw", "drac", "distance"):
        measure = getattr(one, name)
        assert (
            measure.valid <= np.any([getattr(each, name).valid for each in alone], axis=0)
        ).all()
    least = np.min(
        [np.where(each.distance.valid, each.distance.value, np.inf) for each in alone], axis=0
    )
    np.testing.assert_array_equal(np.where(one.distance.valid, one.distance.value, np.inf), least)
    by_name = {
        each.nearest[each.distance.valid][0]: each for each in alone if each.distance.valid.any()
    }
    for row in np.flatnonzero(one.lead != ""):
        lead = by_name[one.lead[row]]
        assert [getattr(one, name).value[row] for name in ("ttc", "thw", "drac")] == [
            getattr(lead, name).value[row] for name in ("ttc", "thw", "drac")
        ]
    for parameters in one.violation:
        np.testing.assert_array_equal(
            one.violation[parameters],
            np.any([each.violation[parameters] for each in alone], axis=0),
        )
        margins = [
            np.where(each.margin[parameters].valid, each.margin[parameters].value, np.inf)
            for each in alone
        ]
        np.testing.assert_array_equal(
            np.where(one.margin[parameters].valid, one.margin[parameters].value, np.inf),
            np.min(margins, axis=0),
        )


@pytest.mark.parametrize("rows", [1, 40, 1 << 16])
@pytest.mark.parametrize("seed", range(40))
def test_all_at_once_is_each_alone(seed: int, rows: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_BLOCK", rows)
    ego, *others = traffic(seed)
    together, alone = criticality(ego, others), [criticality(ego, [other]) for other in others]
    same(together, alone)
    assert together.impact == min(
        (each.impact for each in alone if each.impact), key=lambda one: one.time, default=None
    )
    plain = [found for other in others if (found := plain_encroachment(ego, other)) is not None]
    assert together.pet == min(plain, default=None)
    fields = [found for other in others if (found := plain_field(ego, other))]
    for index, name in enumerate(("max_collision_probability", "max_risk_field")):
        greatest = max((found[index] for found in fields), key=lambda one: one.value, default=None)
        assert together.summary[name] == (greatest._asdict() if greatest else None)


def test_draws_meet_collide_and_cross() -> None:
    """The draws have what the comparison is to be about."""
    found = [criticality(ego, others) for ego, *others in map(traffic, range(40))]
    assert sum(each.impact is not None for each in found) > 5
    assert sum(each.pet is not None and each.pet.value > 0.0 for each in found) > 3
    assert sum(bool((each.lead != "").any()) for each in found) > 10
    assert sum(each.distance.valid.any() for each in found) > 20
