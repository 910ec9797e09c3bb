"""Participants that move at random: mostly as far in each step as before,
sometimes to anywhere, or out of the world and in.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from hypothesis import strategies as st

from runner.engine.participants.entity import Entity


class Move(NamedTuple):
    """What becomes of a participant in a step: a displacement (m) and a turn
    (rad), or a new place; whether it is there.
    """

    x: float
    y: float
    h: float
    jumps: bool
    active: bool


_way = st.sampled_from([-1.0, 0.0, 1.0]) | st.floats(-1.0, 1.0)
_there = st.sampled_from([True] * 19 + [False])
_steps = st.builds(Move, _way, _way, st.just(0.0) | st.floats(-0.2, 0.2), st.just(False), _there)
_jumps = st.builds(
    Move,
    st.floats(-40.0, 40.0),
    st.floats(-40.0, 40.0),
    st.floats(-math.pi, math.pi),
    st.just(True),
    _there,
)


def moves(count: int) -> st.SearchStrategy[list[tuple[Move, ...]]]:
    """The moves of so many participants in some steps."""
    at_once = st.tuples(*[_steps] * count).flatmap(
        lambda each: st.integers(1, 40).map(lambda number: [each] * number)
    )
    jump = st.tuples(*[_steps | _jumps] * count).map(lambda each: [each])
    return st.lists(at_once | at_once | jump, min_size=1, max_size=6).map(
        lambda parts: [step for part in parts for step in part]
    )


def move(entity: Entity, by: Move) -> None:
    """Do a move."""
    entity.active = by.active
    entity.x, entity.y, entity.h = (
        (by.x, by.y, by.h)
        if by.jumps
        else (entity.x + by.x, entity.y + by.y, math.remainder(entity.h + by.h, math.tau))
    )
