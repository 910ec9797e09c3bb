"""Same scenario, parameters and seed: the same bytes, however many processes
work and whatever ran before.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import runner
from runner.batch.batch import run_batch
from runner.batch.jobs import jobs_of
from runner.batch.outputs.tables import write_parquet
from runner.judging.settings import RunSettings
from schemas.common.errors import UsageError
from tests.conformance.support import SCENARIOS
from tests.mutation import REPOSITORY

CUT_IN = REPOSITORY / "xosc" / "library" / "simple_cut_in.xosc"
TRAFFIC = SCENARIOS / "TrafficSwarmAction.xosc"
RANDOM_ROUTE = SCENARIOS / "RandomRouteAction.xosc"
STOCHASTIC = SCENARIOS / "NormalDistribution.xosc"


def tables(folder: Path, seed: int, processes: int) -> dict[str, bytes]:
    """What each run of a batch writes, by name; two files of traffic first and
    last, so that something ran before.
    """
    files = [TRAFFIC, CUT_IN, RANDOM_ROUTE, STOCHASTIC, TRAFFIC]
    outcomes = list(
        run_batch(
            jobs_of(files, {}, True),
            RunSettings(seed=seed, max_time=4.0),
            out=folder,
            processes=processes,
        )
    )
    assert {outcome.state for outcome in outcomes} <= {"passed", "failed", "inconclusive"}
    return {path.parent.name: path.read_bytes() for path in folder.glob("*/trajectories.parquet")}


@pytest.mark.slow
def test_batches_with_sumo_traffic_are_the_same_bytes_in_one_process_and_in_two(
    tmp_path: Path,
) -> None:
    serial, parallel = tables(tmp_path / "serial", 3, 1), tables(tmp_path / "parallel", 3, 2)
    assert len(serial) > 5
    assert parallel == serial
    assert serial["TrafficSwarmAction"] == serial["TrafficSwarmAction~2"]


@pytest.mark.parametrize("path", [CUT_IN, TRAFFIC], ids=lambda path: path.stem)
def test_a_run_is_the_same_bytes_twice_in_one_process(path: Path, tmp_path: Path) -> None:
    for name in ("first", "second"):
        write_parquet(runner.run(path, seed=1, max_time=8.0), tmp_path / name)
    assert (tmp_path / "first").read_bytes() == (tmp_path / "second").read_bytes()


STATEFUL = [
    "AddEntityAction",
    "AssignControllerAction",
    "ConnectTrailerAction",
    "DeleteEntityAction",
    "EnvironmentAction",
    "LightStateAction",
    "OffroadCondition",
    "OverrideControllerValueAction",
    "StoryboardElementStateCondition",
    "TrafficSignalControllerAction",
    "TrafficSwarmAction",
    "VariableModifyAction",
    "VisibilityAction",
]
"""Scenarios whose runs change something else than where participants are."""


@pytest.mark.parametrize("name", STATEFUL)
def test_a_prepared_scenario_runs_again_as_if_for_the_first_time(name: str) -> None:
    path, settings = SCENARIOS / f"{name}.xosc", RunSettings(seed=1, max_time=12.0, timestep=0.02)
    prepared = runner.prepare(path)
    expected = runner.run(path, settings)
    for result in (prepared.run(settings), prepared.run(settings, seed=2), prepared.run(settings)):
        if result.settings["seed"] == settings.seed:
            assert result.trajectories.equals(expected.trajectories)
            assert result.events == expected.events
            assert result.verdict == expected.verdict


def test_a_prepared_scenario_runs_with_other_settings() -> None:
    prepared = runner.prepare(CUT_IN)
    for settings in (
        RunSettings(sut="aeb"),
        RunSettings(sut=None, timestep=0.1, world="kinematic"),
        RunSettings(sut="sumo"),
    ):
        assert prepared.run(settings).trajectories.equals(runner.run(CUT_IN, settings).trajectories)


def test_a_prepared_scenario_refuses_what_a_run_would() -> None:
    prepared = runner.prepare(CUT_IN)
    with pytest.raises(UsageError, match="no entity is called 'Absent'"):
        prepared.run(ego="Absent")


def test_another_seed_gives_other_traffic() -> None:
    first, second = (runner.run(TRAFFIC, seed=seed, max_time=3.0).trajectories for seed in (1, 2))
    assert not first.equals(second)
