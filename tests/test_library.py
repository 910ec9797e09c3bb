"""The shipped scenarios and roads: valid, and they run, with and without a system under test."""

from __future__ import annotations

from pathlib import Path

import pytest

import schemas
import xodr
import xosc
from runner.batch.batch import execute
from runner.batch.jobs import Job, jobs_of
from runner.judging.settings import RunSettings

ROOT = Path(__file__).parents[1]
SCENARIOS = sorted((ROOT / "xosc" / "library").rglob("*.xosc"))
ROADS = sorted((ROOT / "xodr" / "library").rglob("*.xodr"))
RUNNABLE = [path for path in SCENARIOS if xosc.load(path).kind != "catalog"]


def name(path: Path) -> str:
    return path.stem


@pytest.mark.parametrize("path", [*SCENARIOS, *ROADS], ids=name)
def test_a_shipped_file_is_valid(path: Path) -> None:
    assert schemas.check(path) == []


@pytest.mark.parametrize("path", ROADS, ids=name)
def test_a_shipped_road_loads(path: Path) -> None:
    assert xodr.load(path).roads


@pytest.mark.parametrize("sut", ["cas", "none"])
@pytest.mark.parametrize("path", RUNNABLE, ids=name)
def test_a_shipped_scenario_runs_to_its_own_end(path: Path, sut: str) -> None:
    for job in jobs_of([path], {}, True):
        assert isinstance(job, Job), job
        outcome = execute(job, RunSettings(sut=sut))
        ends = {"passed": {"completed"}, "failed": {"completed", "collision"}}
        assert outcome.status in ends[outcome.state], outcome.message


def test_something_is_shipped() -> None:
    assert RUNNABLE
    assert ROADS
