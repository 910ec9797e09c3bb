"""Plays in arrays are the runs of the interpreter, with all that searches measure of them."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from generation.search import plays as module
from generation.search.outcomes import FULL_BRAKING, NOTHING, Outcomes, episode
from generation.search.plays import ArrayPlays
from generation.space import SpaceChoice
from generation.space.space import Space
from runner.batch.jobs import Job
from runner.judging.settings import RunSettings
from runner.systems.base import SystemUnderTestError
from schemas.common.errors import Unsupported

LIBRARY = Path(__file__).parents[3] / "xosc" / "library"
CUT_IN = LIBRARY / "cut_in_highway.xosc"
MANEUVERS = ("cut_out", "lane_change_left", "car_following", "braking_leader", "free_cruise")
OWN = """
import numpy as np
from runner.systems import Control
from runner.systems.arrays import BatchControl

class Own:
    def reset(self, ego, timestep, seed): ...
    def control(self, observation, dt):
        near = any(abs(other.x - observation.ego.x) < 25.0 for other in observation.others)
        return Control(-6.0) if near else Control()
    def control_batch(self, observations, dt):
        others, ego = observations.others, observations.ego
        near = (others.present & (np.abs(others.x - ego.x) < 25.0)).any(axis=0)
        return BatchControl(np.full(len(near), -6.0), accelerates=near)
"""
ASKED_RUN_BY_RUN = """
from runner.systems import Control

class Own:
    def reset(self, ego, timestep, seed): ...
    def control(self, observation, dt):
        near = any(abs(other.x - observation.ego.x) < 25.0 for other in observation.others)
        return Control(-6.0) if near else Control()
"""


def settings(sut: str) -> RunSettings:
    return RunSettings(world="kinematic", sut=sut)


def singly(scenario: Path, space: Space, theta: np.ndarray, chosen: RunSettings) -> Outcomes:
    jobs = (Job("", scenario, scenario, {**space.pinned, **space.values(row)}) for row in theta)
    rows = [episode(job, chosen, "ad-rss") for job in jobs]
    return Outcomes.of(len(rows), **{name: [row[name] for row in rows] for name in NOTHING})


def same(found: Outcomes, truth: Outcomes) -> None:
    """Compare outcomes, numbers up to rounding."""
    for each in fields(Outcomes):
        own, other = getattr(found, each.name), getattr(truth, each.name)
        if each.name == "error":  # arrays do not say why a run is inconclusive
            own, other = own != "", other != ""
        if own.dtype.kind == "f":
            np.testing.assert_allclose(own, other, rtol=1e-6, atol=1e-9, err_msg=each.name)
        else:
            np.testing.assert_array_equal(own, other, err_msg=each.name)


@pytest.mark.parametrize(
    ("name", "sut"),
    [
        ("cut_in", "cas"),
        ("cut_in", "adas"),
        ("cut_in", "cas:sensor_range=40,brake=6"),
        ("cut_in", FULL_BRAKING),
        ("cut_out", FULL_BRAKING),
        *((name, "cas") for name in MANEUVERS),
    ],
)
def test_plays_have_the_outcomes_of_runs(name: str, sut: str) -> None:
    scenario = LIBRARY / f"{name}_highway.xosc"
    space = Space.of(
        scenario, SpaceChoice(free=["Lead_Jerk_mps3"] if name.startswith("braking") else [])
    )
    theta = space.draw(12 if name == "cut_in" else 5, np.random.default_rng(5))
    found = ArrayPlays(scenario, space, settings(sut), "ad-rss", few=0)(theta)
    truth = singly(scenario, space, theta, settings(sut))
    assert name != "cut_in" or sut != "cas" or 0 < found.collision.sum() < len(theta)
    same(found, truth)


@pytest.mark.parametrize(
    "limits",
    [
        ("min_ttc<1.5",),
        ("max_drac>3", "min_distance<=2"),
        ("min_thw<0.4", "end_time>100"),
        ("rss",),
        ("pet<0.5", "off-road"),
        ("timeout",),
    ],
)
def test_plays_fail_by_limits_as_runs_do(limits: tuple[str, ...]) -> None:
    space = Space.of(CUT_IN)
    theta = space.draw(24, np.random.default_rng(8))
    chosen = replace(settings("cas"), fail_if=limits, timestep=0.1)
    found = ArrayPlays(CUT_IN, space, chosen, "ad-rss", few=0)(theta)
    same(found, singly(CUT_IN, space, theta, chosen))
    beyond = found.executed & (found.margin <= 0.0)
    assert (found.collision[found.executed] == (beyond | found.touching)[found.executed]).all()
    if limits != ("timeout",):
        assert 0 < beyond.sum() < len(theta)


def test_limits_without_a_value_leave_plays_inconclusive_as_runs() -> None:
    space = Space.of(CUT_IN)
    theta = space.draw(12, np.random.default_rng(8))
    chosen = replace(settings("cas"), fail_if=("min_ttc<1",), least=("limits=0.9",))
    found = ArrayPlays(CUT_IN, space, chosen, fast=False, few=0)(theta)
    assert found.inconclusive.any()
    same(found, singly(CUT_IN, space, theta, chosen))


def test_outcomes_do_not_depend_on_what_is_played_beside() -> None:
    space = Space.of(CUT_IN)
    plays, theta = (
        ArrayPlays(CUT_IN, space, settings("cas")),
        space.draw(60, np.random.default_rng(2)),
    )
    whole, part = plays(theta), plays(theta[20:30])
    for each in fields(Outcomes):
        np.testing.assert_array_equal(getattr(whole, each.name)[20:30], getattr(part, each.name))
    assert len(plays(theta[:0])) == 0


def test_outcomes_are_those_of_any_number_of_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "BLOCK", 15)
    space = Space.of(CUT_IN)
    theta = space.draw(40, np.random.default_rng(2))
    one, two = (ArrayPlays(CUT_IN, space, settings("cas"), processes=n)(theta) for n in (1, 2))
    for each in fields(Outcomes):
        np.testing.assert_array_equal(getattr(one, each.name), getattr(two, each.name))
    assert len(two) == 40


@pytest.mark.parametrize(("source", "sizes"), [(OWN, [5]), (ASKED_RUN_BY_RUN, [2, 2, 1])])
def test_a_system_that_is_asked_run_by_run_has_work_for_several_processes(
    source: str, sizes: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own.py").write_text(source, "utf-8")
    space = Space.of(CUT_IN)
    theta = space.draw(5, np.random.default_rng(2))
    plays = ArrayPlays(CUT_IN, space, settings(f"{tmp_path / 'own.py'}:Own"), few=0)
    whole = plays(theta)
    blocks: list[int] = []
    played = module._played

    def seen(*given: Any) -> Outcomes:
        blocks.append(len(given[-1]))
        return played(*given)

    monkeypatch.setattr(module, "RUN_BY_RUN_BLOCK", 2)
    monkeypatch.setattr(module, "_played", seen)
    same(whole, plays(theta))
    assert blocks == sizes


def test_few_points_are_played_by_the_interpreter(monkeypatch: pytest.MonkeyPatch) -> None:
    space = Space.of(CUT_IN)
    plays = ArrayPlays(CUT_IN, space, settings("cas"))
    arrays, theta = (
        ArrayPlays(CUT_IN, space, settings("cas"), few=0),
        space.draw(8, np.random.default_rng(2)),
    )
    for sut in (None, "fsm"):
        same(arrays(theta, sut), plays(theta, sut))

    def refuse(*_: object) -> None:
        raise AssertionError("arrays are asked")

    monkeypatch.setattr(module, "_played", refuse)
    plays(theta)
    with pytest.raises(AssertionError, match="arrays"):
        arrays(theta)


def test_a_class_of_the_users_is_asked_for_all_points_at_once(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN, "utf-8")
    space = Space.of(CUT_IN)
    plays = ArrayPlays(CUT_IN, space, settings(f"{tmp_path / 'own.py'}:Own"), "ad-rss", few=0)
    found = plays(space.draw(8, np.random.default_rng(0)))
    assert found.executed.all()


@pytest.mark.parametrize(("name", "sut"), [("cut_in_highway", "sumo"), ("r157_cut_in", "cas")])
def test_what_is_no_faster_than_runs_is_refused(name: str, sut: str) -> None:
    scenario = LIBRARY / f"{name}.xosc"
    with pytest.raises(Unsupported):
        ArrayPlays(scenario, Space.of(scenario), settings(sut), "ad-rss")


@pytest.mark.parametrize(
    "wrong",
    [
        "np.full(len(near), 0.0), accelerates=near",
        "np.full(len(near), -6.0)",  # always, and so in no collision
        "np.full(len(near), -5.5), accelerates=near",
    ],
)
def test_a_class_that_decides_otherwise_at_once_is_refused(wrong: str, tmp_path: Path) -> None:
    path = tmp_path / "own.py"
    right = "np.full(len(near), -6.0), accelerates=near"
    assert right in OWN
    path.write_text(OWN.replace(right, wrong), "utf-8")
    space = Space.of(CUT_IN, SpaceChoice())
    with pytest.raises(SystemUnderTestError, match="otherwise in control_batch than in control"):
        ArrayPlays(CUT_IN, space, settings(f"{path}:Own"))
