"""Laws of the systems in this package: many runs at once decide as each run alone."""

from __future__ import annotations

from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from runner.engine.participants.boxes import gap, outlook, overlap, spans
from runner.engine.participants.outlines import (
    box_distance,
    boxes_overlap,
    extents,
    seen_by,
    vertical_gap,
)
from runner.systems import Observation, load_system
from runner.systems.array_systems import decides_together, open_arrays
from runner.systems.arrays import Answers, stack, stack_participants
from tests.runner.systems.situations import situation

DT = 0.1
LAWS = (
    "cas", "cas:sensor_range=60", "cas:sensor_range=40,rss=r157,brake=5",
    "cas:sensor_range=60,jerk=20",
    "adas", "adas:latency=0", "adas:latency=0.25,emergency=2,clearance=1",
    "adas:far_angle=60,far_range=60,comfortable=1,coolness=0.2",
    "aeb", "aeb:partial_time=4,full_time=2,hold=20", "idm", "idm:clearance=3,brake=3",
    "rss", "rss:parameters=ad-rss,reaction=0.2", "fsm", "fsm:reaction=0.1,margin=6",
    "r157-cc", "r157-cc:critical=6,reaction=0.3", "r157-reg", "r157-reg:lateral=3,brake=3",
)  # fmt: skip


def later(seen: Observation, step: int, rng: Random) -> Observation:
    """A situation some steps later: everyone has driven on; speeds,
    accelerations and lights change.
    """

    def moved(one: Any) -> Any:
        speed = one.speed + rng.choice([0.0, 0.0, one.acceleration * DT])
        share = speed / one.speed if one.speed else 1.0
        return one._replace(
            x=one.x + one.vx * DT, y=one.y + one.vy * DT, speed=speed, vx=one.vx * share,
            vy=one.vy * share
        )  # fmt: skip

    return seen._replace(
        time=step * DT,
        ego=moved(seen.ego),
        others=[moved(each) for each in seen.others],
        stop_line=seen.stop_line if rng.random() < 0.9 else None,
    )


@pytest.mark.parametrize("name", LAWS)
@settings(max_examples=25)
@given(st.integers(0, 1 << 30), st.integers(1, 12), st.data())
def test_many_runs_at_once_decide_as_each_alone(name: str, seed: int, n: int, data: Any) -> None:
    rng = Random(seed)
    now = [situation(rng.randrange(1 << 30), rng.randrange(5)) for _ in range(n)]
    together, alone = open_arrays(name), [load_system(name) for _ in now]
    assert together is not None
    together.reset(stack(now).ego, DT, np.arange(n))
    for system, each in zip(alone, now, strict=True):
        system.reset(each.ego, DT, 0)  # type: ignore[union-attr]
    for step in range(8):
        asked = sorted(rng.sample(range(n), rng.choice([n, n, max(n - 2, 1)])))
        found = together.control(stack(now).take(asked), DT)
        expected = Answers.of([alone[run].control(now[run], DT) for run in asked])  # type: ignore[union-attr]
        assert found.accelerates.tolist() == expected.accelerates.tolist()
        assert found.acceleration == pytest.approx(expected.acceleration, rel=1e-9, abs=1e-9)
        assert not found.steers.any()
        assert not found.unanswered.any()
        now = [later(each, step + 1, rng) for each in now]


@pytest.mark.parametrize("name", LAWS)
def test_situations_make_each_law_act_and_let_go(name: str) -> None:
    now = [situation(seed, seed % 5) for seed in range(400)]
    system, rng = open_arrays(name), Random(0)
    assert system is not None
    system.reset(stack(now).ego, DT, np.arange(len(now)))
    seen = set()
    for step in range(8):
        found = system.control(stack(now), DT)
        share = found.accelerates.mean()
        seen |= set(found.acceleration[found.accelerates].round(3))
        now = [later(each, step + 1, rng) for each in now]
    assert 0.01 < share < 0.99
    assert min(seen) < -2.0


def test_every_law_of_this_package_decides_in_arrays() -> None:
    for name in LAWS:
        assert decides_together(type(load_system(name))), name


@settings(max_examples=60)
@given(st.integers(0, 1 << 30), st.integers(1, 4))
def test_boxes_in_arrays_are_those_of_numbers(seed: int, count: int) -> None:
    seen = situation(seed, count)
    ego = stack_participants([seen.ego])
    others = stack_participants(seen.others, (count, 1))
    sight = seen_by(ego, others)
    distance = np.hypot(box_distance(ego, others, sight), vertical_gap(ego, others))
    for row, other in enumerate(seen.others):
        view = outlook(seen.ego, other)
        assert [values[row, 0] for values in sight] == pytest.approx(view, abs=1e-9)
        extent = [values[row, 0] for values in extents(sight, others.box)]
        assert extent == pytest.approx(spans(view, other.box), abs=1e-9)
        assert distance[row, 0] == pytest.approx(gap(seen.ego, other), abs=1e-8)
        assert boxes_overlap(ego, others)[row, 0] == overlap(seen.ego, other)
