"""One clock over all phases of a search."""

from __future__ import annotations

import numpy as np
import pytest

from generation import clock as clocks
from generation.clock import SearchClock, TimedPlays, TimeOver
from generation.search.outcomes import Outcomes, joined
from schemas.common.array_types import FloatArray

THETA = np.arange(400.0)[:, None]


class Time:
    """Passes a second for each point that is run."""

    def __init__(self) -> None:
        self.now = 0.0

    def run(self, theta: FloatArray, sut: str | None = None) -> Outcomes:
        self.now += len(theta)
        return Outcomes.of(len(theta), end_time=theta[:, 0])


@pytest.fixture
def passing(monkeypatch: pytest.MonkeyPatch) -> Time:
    found = Time()
    monkeypatch.setattr(clocks.time, "monotonic", lambda: found.now)
    return found


def test_draws_end_with_their_share_of_the_time_and_are_one_part_at_least(passing: Time) -> None:
    def drawn(minutes: float | None, theta: FloatArray = THETA) -> list[float]:
        parts = SearchClock(minutes).parts(theta, 0.3)
        return joined([passing.run(part) for part in parts]).end_time.tolist()

    assert drawn(None) == list(range(400))
    assert drawn(10.0) == list(range(150)), "three tenths of the 420 s of a search, in parts of 50"
    assert drawn(0.0) == list(range(50))
    assert drawn(0.0, THETA[:0]) == []


def test_plays_and_judges_look_at_the_clock_too(passing: Time) -> None:
    many = np.tile(THETA, (20, 1))
    limited = SearchClock(60.0).limited(passing.run)
    assert len(limited(many[:2000])) == 2000 and len(limited(many[:0], "fsm")) == 0
    with pytest.raises(TimeOver):
        limited(many)
    assert passing.now < 3600, "edge cases are chosen in what is left"


def test_edge_cases_are_as_many_as_there_is_time_for(passing: Time) -> None:
    clock = SearchClock(10.0)
    passing.now = 440.0
    assert clock.most(100, 440, cut=False) == 100
    assert clock.most(100, 440, cut=True) == 17, "160 s for nine runs each, at one a second"
    assert clock.most(100, 440, cut=True, repeated=7) == 10
    passing.now = 700.0
    assert clock.most(100, 440, cut=True) == 1
    assert SearchClock(None).most(100, 440, cut=True) == 100


def test_searches_of_a_catalogue_share_one_time_and_loading_counts(passing: Time) -> None:
    clock = SearchClock(10.0, spent=60.0)
    assert clock.left == pytest.approx(360.0), "seven tenths of 600 s, less what was spent"
    passing.now = 40.0
    first = clock.shared(2, print)
    passing.now = 200.0
    assert not first.over and clock.shared(1, print).left == pytest.approx(0.7 * 340.0)
    passing.now = 600.0
    assert first.over and clock.shared(1, print).over
    assert not SearchClock(None).shared(3, print).over


def test_phases_after_the_search_have_a_share_of_their_own(passing: Time) -> None:
    told = list[str]()
    clock = SearchClock(10.0, tell=told.append)
    clock.begin(2)
    clock.phase("search")
    passing.now = 209.0
    assert not clock.over and clock.left == pytest.approx(1.0)
    passing.now = 210.0
    assert clock.over
    clock.phase("estimate", own=True)
    assert clock.left == pytest.approx(120.0) and not clock.over
    passing.now = 500.0
    assert clock.over
    clock.phase("draws", own=True)
    assert clock.left == pytest.approx(90.0), "what was before took all: a least share in any case"
    assert told == ["search", "estimate", "draws"]
    unlimited = SearchClock(None)
    unlimited.begin(0)
    unlimited.grant()
    assert not unlimited.over and not unlimited.finite


def test_plays_tell_how_many_there_is_time_for(passing: Time) -> None:
    def play(theta: FloatArray, sut: str | None = None) -> Outcomes:
        passing.now += 10.0 + 0.1 * len(theta)
        return Outcomes.of(len(theta))

    plays = TimedPlays(play, SearchClock(10.0), 1024)
    assert plays.within(0.5) == 0.0, "nothing is known of what a play takes"
    plays(THETA[:50])
    alone = plays.within(0.5)
    plays(THETA)
    left = 420.0 - 15.0 - 50.0
    assert plays.within(0.5) == pytest.approx((0.5 * left - 15.0) / 0.1 + 50)
    assert alone < plays.within(0.5), "of one play no more is promised than it shows"
    assert plays.played == 450
    assert TimedPlays(play, SearchClock(None), 1024).within(0.1) == np.inf


def test_plays_tell_how_many_are_left_of_a_number(passing: Time) -> None:
    plays = TimedPlays(passing.run, SearchClock(None), 1024, 600)
    assert plays.within(0.5) == 300.0
    plays(THETA)
    plays(THETA, "fsm")
    assert plays.within(0.5) == 100.0, "what reference drivers drive costs the system nothing"
    plays(THETA)
    assert plays.within(1.0) == 0.0
