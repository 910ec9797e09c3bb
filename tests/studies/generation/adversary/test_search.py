"""What an adversary finds in arrays is what a file of it does in a run, to the step."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import schemas
from generation.search.outcomes import measures
from generation.space.logical.library import SCENARIOS
from runner.judging.execution import run
from runner.judging.settings import RunSettings
from schemas.common.errors import Unsupported
from studies.generation.adversary import OBJECTIVES
from studies.generation.adversary.course import Scene, replayed
from studies.generation.adversary.driving import Driving
from studies.generation.adversary.environment import OBSERVED, Environment, Episodes
from studies.generation.adversary.files import Writer
from studies.generation.adversary.search import AdversarySettings, search
from tests.studies.generation.adversary.conftest import CUT_IN
from xosc.writing.tags import Tag

DT = 0.05


def inwards(seen: np.ndarray) -> np.ndarray:
    """Brake, and move to the ego's lane."""
    return np.tile([-1.0, -1.0], (len(seen), 1))


def played(scene: Scene, driving: Driving, starts: np.ndarray, sut: str = "none") -> Episodes:
    return Environment(scene, driving, sut, DT, 0.98).play(starts, inwards)[0]


def test_episodes_keep_to_limits_and_are_foreseeable(
    scene: Scene, driving: Driving, starts: np.ndarray
) -> None:
    episodes = played(scene, driving, starts)
    velocity = np.diff(episodes.ways, axis=1) / DT
    acceleration = np.diff(velocity, axis=1) / DT
    assert (acceleration[:, :, 0] <= driving.limits.high[0] + 1e-6).all()
    assert (acceleration[:, :, 0] >= driving.limits.low[0] - 1e-6).all()
    assert (np.abs(np.diff(acceleration, axis=1) / DT) <= 2.0 * driving.limits.jerk + 1e-6).all()
    assert episodes.foreseeable.mean() >= 0.5


def test_what_is_learnt_from_ends_with_the_contact(
    scene: Scene, driving: Driving, starts: np.ndarray
) -> None:
    episodes, transitions = Environment(scene, driving, "none", DT, 0.98).play(starts, inwards)
    assert (episodes.contact >= 0).any()
    assert transitions.seen.shape == (len(transitions.reward), OBSERVED)
    assert transitions.over.sum() == len(starts)
    assert np.isfinite(transitions.seen).all()


def test_an_ego_that_does_nothing_is_hit_where_a_careful_one_is_not(
    scene: Scene, driving: Driving, starts: np.ndarray
) -> None:
    episodes = played(scene, driving, starts)
    hit = episodes.contact >= 0
    assert (episodes.clearance[hit] == 0.0).all()
    careful = [
        replayed(scene, judge, starts, episodes.ways, DT).contact < 0
        for judge in ("r157-cc", "fsm")
    ]
    np.testing.assert_array_equal(episodes.preventable, hit & np.any(careful, axis=0))


@pytest.mark.parametrize("sut", ["none", "cas", "r157-cc", "aeb"])
def test_a_written_episode_is_the_same_to_the_step(
    sut: str, scene: Scene, driving: Driving, starts: np.ndarray, tmp_path: Path
) -> None:
    episodes = played(scene, driving, starts, sut)
    writer = Writer(CUT_IN, scene, tmp_path, DT)
    for row in range(len(starts)):
        path = writer.write(episodes, row, row, [Tag("SearchMethod", "adversary")])
        assert schemas.check(path) == []
        result = run(path, RunSettings(sut=sut, world="kinematic"))
        seen = measures(result, "ad-rss")
        assert seen["collision"] == (episodes.contact[row] >= 0)
        if seen["collision"]:
            assert seen["conflict"] == pytest.approx(episodes.contact[row] * DT)
        else:
            assert seen["clearance"] == pytest.approx(episodes.clearance[row], abs=1e-3)


def test_a_file_fails_in_sumo_as_well(
    scene: Scene, driving: Driving, starts: np.ndarray, tmp_path: Path
) -> None:
    episodes = played(scene, driving, starts)
    row = int(np.flatnonzero(episodes.contact >= 0)[0])
    path = Writer(CUT_IN, scene, tmp_path, DT).write(episodes, row, 0, [])
    assert measures(run(path, RunSettings(sut="none")), "ad-rss")["conflict"] == pytest.approx(
        episodes.contact[row] * DT
    )


def test_a_seed_decides_what_is_found(scene: Scene, driving: Driving, starts: np.ndarray) -> None:
    settings = AdversarySettings(rounds=2, episodes=8, updates=2, warm_up=1)

    def begun(n: int, generator: np.random.Generator) -> np.ndarray:
        return starts[generator.integers(len(starts), size=n)]

    one, two = (search(scene, driving, begun, "none", DT, 5, settings) for _ in range(2))
    assert one.rounds == two.rounds
    np.testing.assert_array_equal(one.failures.ways, two.failures.ways)
    assert sum(each.failures for each in one.rounds) >= len(one.failures.contact) > 0
    assert one.failures.failing.all()


@pytest.mark.parametrize("name", ["car_following_highway", "cut_in_sharp_curve"])
def test_scenes_without_somebody_beside_are_refused(name: str) -> None:
    with pytest.raises(Unsupported):
        Scene.of(SCENARIOS / f"{name}.xosc")


def test_objectives_shape_what_is_learnt_and_not_what_happens(
    scene: Scene, driving: Driving, starts: np.ndarray
) -> None:
    played = [
        Environment(scene, driving, "none", DT, 0.98, name).play(starts, inwards)
        for name in OBJECTIVES
    ]
    for (one, by_one), (two, by_two) in pairwise(played):
        np.testing.assert_array_equal(one.ways, two.ways)
        assert (by_one.reward != by_two.reward).any()
