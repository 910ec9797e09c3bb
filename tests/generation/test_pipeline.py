"""A search from scenario to files, interrupted and gone on with."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from generation import clock as clocks
from generation.pipeline import LEAST, Generated, generate
from generation.search.settings import SearchSettings
from generation.space.logical.library import SCENARIOS
from generation.space.recorded import Recorded, of_recordings, of_samples
from generation.space.space import Space
from runner.judging.settings import RunSettings
from schemas.common.errors import UsageError

CUT_IN = SCENARIOS / "cut_in_highway.xosc"
RUN = RunSettings(timestep=0.1, world="kinematic")
"""Without SUMO, which the searches of test_xosc_generate and of the loop have"""
QUICK = SearchSettings(method="draws", budget=60, density="gaussian", processes=1, run=RUN)

TRAFFIC = partial(of_samples, of_recordings(None, "cut_in"))


def drawn(n: int) -> Recorded:
    """Parameters of recordings that never were."""
    rng = np.random.default_rng(2)
    return Recorded(Space.of(CUT_IN).draw(n, rng), np.array([f"r{each % 5}" for each in range(n)]))


@pytest.mark.slow
def test_an_interrupted_search_goes_on_and_ends_as_if_it_had_not_been(tmp_path: Path) -> None:
    settings, batches = replace(QUICK, budget=90), list[int]()

    def interrupt(runs: int) -> None:
        batches.append(runs)
        if len(batches) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        generate(CUT_IN, lambda space: drawn(200), tmp_path / "a", settings, interrupt)
    assert batches == [30, 50], "draws, then the first runs of the method"
    (kept,) = (tmp_path / "a").glob("*_runs_*.jsonl")
    before = kept.read_text()
    assert before.count("\n") == 50
    resumed = generate(CUT_IN, lambda space: drawn(200), tmp_path / "a", settings)
    assert kept.read_text().startswith(before)
    whole = generate(CUT_IN, lambda space: drawn(200), tmp_path / "b", settings)
    np.testing.assert_array_equal(resumed.history.theta, whole.history.theta)
    for one, other in zip(resumed.files, whole.files, strict=True):
        assert one.read_bytes() == other.read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(("plays", "most"), [(0, 0), (None, 40 * QUICK.budget)])
def test_a_system_that_is_asked_run_by_run_drives_no_more_plays_than_asked(
    tmp_path: Path, plays: int | None, most: int
) -> None:
    (tmp_path / "own.py").write_text(
        "from runner.systems import Control\n"
        "class Own:\n"
        "    def reset(self, ego, timestep, seed):\n"
        "        with open(__file__ + '.runs', 'a') as file:\n"
        "            file.write('.')\n"
        "    def control(self, observation, dt):\n"
        "        return Control()\n",
        "utf-8",
    )
    run = replace(RUN, sut=f"{tmp_path / 'own.py'}:Own")
    settings = replace(QUICK, method="cover", plays=plays, run=run)
    generate(CUT_IN, lambda space: drawn(200), tmp_path / "out", settings)
    driven = (tmp_path / "own.py.runs").stat().st_size
    assert QUICK.budget <= driven <= QUICK.budget + 1.2 * most + 300


def test_too_few_recorded_manoeuvres_are_no_prior(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=f"at least {LEAST}"):
        generate(CUT_IN, lambda space: drawn(LEAST - 1), tmp_path, QUICK)


@pytest.mark.slow
def test_a_search_is_extended_in_its_folder(tmp_path: Path) -> None:
    def search(seed: int) -> Generated:
        return generate(
            CUT_IN, lambda space: drawn(40), tmp_path, replace(QUICK, budget=6, seed=seed)
        )

    assert search(0).reused == 0
    assert search(1).reused == 0
    (runs,) = tmp_path.glob("*_runs_*.jsonl")
    assert runs.read_text().count("\n") == 6
    assert search(0).reused == 3, "half of six runs are draws"
    assert runs.read_text().count("\n") == 6


@pytest.mark.slow
def test_what_was_found_so_far_is_written_after_each_so_many_runs(tmp_path: Path) -> None:
    told = list[Generated]()
    settings = replace(QUICK, budget=230, every=100)
    whole = generate(
        CUT_IN, lambda space: drawn(200), tmp_path / "a", replace(settings, every=None)
    )
    again = generate(
        CUT_IN, lambda space: drawn(200), tmp_path / "b", settings, interim=told.append
    )
    assert [len(each.history.theta) for each in told] == [50, 150], (
        "57 draws before, runs in batches of 50"
    )
    assert told[0].statement.draws == 57 and told[0].estimate is None
    np.testing.assert_array_equal(told[1].history.theta, whole.history.theta[:150])
    np.testing.assert_array_equal(again.history.theta, whole.history.theta)
    for one, other in zip(whole.files, again.files, strict=True):
        assert one.read_bytes() == other.read_bytes(), "reports in between change nothing"


@pytest.mark.slow
def test_a_search_ends_with_its_time_and_goes_on_in_the_next_call(tmp_path: Path) -> None:
    cut = generate(CUT_IN, lambda space: drawn(200), tmp_path, replace(QUICK, minutes=0.0))
    assert cut.cut and len(cut.history.theta) == 0 and cut.statement.draws == 30
    assert cut.history.theta.shape == (0, len(cut.space.names))
    whole = generate(CUT_IN, lambda space: drawn(200), tmp_path, QUICK)
    assert (
        not whole.cut
        and len(whole.history.theta) == 30
        and whole.statement == cut.statement._replace(outside=whole.statement.outside)
    )


@pytest.mark.slow
def test_failures_outside_the_operational_domain_are_no_edge_cases(tmp_path: Path) -> None:
    settings = replace(QUICK, budget=120, run=replace(RUN, sut="cas:brake=2"))
    free = generate(CUT_IN, TRAFFIC, tmp_path / "a", settings)
    limited = generate(
        CUT_IN, TRAFFIC, tmp_path / "b", replace(settings, domain=("Ego_Speed_mps=0..30",))
    )
    speed = free.space.names.index("Ego_Speed_mps")
    assert (free.cases.theta[:, speed] > 30.0).any()
    assert len(limited.cases) and (limited.cases.theta[:, speed] <= 30.0).all()
    assert limited.statement == free.statement, (
        "the bound is under the density, whatever the domain"
    )
    assert json.loads((tmp_path / "b" / "cut_in_highway_search.json").read_text())["domain"] == {
        "Ego_Speed_mps": [0.0, 30.0]
    }


@pytest.mark.slow
def test_the_density_of_a_system_without_plays_is_measured_by_plays_in_arrays(
    tmp_path: Path,
) -> None:
    settings = replace(QUICK, run=replace(RUN, sut="adas"))
    found = generate(CUT_IN, TRAFFIC, tmp_path, settings)
    assert found.plays == 0, "so few runs are made sooner than plays that choose them"
    assert found.gate.played and found.gate.testable


class Broken:
    """A system of which no run succeeds."""

    def reset(self, ego: object, timestep: float, seed: int) -> None:
        """Nothing to do."""

    def control(self, observation: object, dt: float) -> object:
        """Fail."""
        raise RuntimeError("no licence server")


def test_a_search_ends_where_all_its_draws_end_with_errors(tmp_path: Path) -> None:
    run = RunSettings(sut=Broken(), timestep=0.1, world="kinematic")
    settings = replace(QUICK, run=run, budget=400, plays=0)
    made = generate(CUT_IN, TRAFFIC, tmp_path, settings)
    assert made.lost and not len(made.history.theta) and not made.files
    assert len(made.episodes.outcomes) == 50 < 100  # of a quarter of the budget
    assert "no licence server" in made.episodes.outcomes.error[0]
    # Few draws are no reason to end: they may fail by chance.
    few = generate(CUT_IN, TRAFFIC, tmp_path / "few", replace(settings, budget=20))
    assert not few.lost and len(few.history.theta) == 10


def test_draws_in_arrays_that_measure_the_density_bound_what_was_not_found(tmp_path: Path) -> None:
    run = RunSettings(sut="cas", timestep=0.1, world="kinematic")
    settings = replace(QUICK, run=run, plays=8000)
    told = list[tuple[float, float]]()
    made = generate(
        CUT_IN, TRAFFIC, tmp_path / "whole", settings, forecast=lambda *span: told.append(span)
    )
    ((least, most),) = told
    assert 0.0 < least < most
    assert made.played is not None
    assert made.played.draws > 10 * made.statement.draws
    assert made.played.unknown < made.statement.unknown
    assert "draws in arrays, which have the verdicts of all these" in made.stated
    slow = replace(settings, domain=("Ego_Speed_mps=0..25",))
    inside = generate(CUT_IN, TRAFFIC, tmp_path / "slow", slow)
    assert inside.played is not None
    assert 0 < inside.played.draws < made.played.draws
    pinned = replace(settings, pinned={"Ego_Speed_mps": "30"})
    assert generate(CUT_IN, TRAFFIC, tmp_path / "pinned", pinned).played is None


@pytest.mark.slow
@pytest.mark.parametrize("plays", [0, 1000])
def test_an_estimate_has_a_share_of_the_time_and_ends_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, plays: int
) -> None:
    settings, ticks = replace(QUICK, plays=plays, estimate=True), count()

    def kept() -> int:
        return sum(path.read_text().count("\n") for path in tmp_path.glob("*_estimate_*.jsonl"))

    def passing() -> float:
        """The time of the estimate is over after its first runs."""
        return next(ticks) * 1e-6 + (50.0 if kept() else 0.0)

    monkeypatch.setattr(clocks.time, "monotonic", passing)
    cut = generate(CUT_IN, TRAFFIC, tmp_path, replace(settings, minutes=1.0))
    monkeypatch.undo()
    assert len(cut.history.theta) == 30 and not cut.cut, "the search had its budget"
    assert cut.estimate is not None and not cut.unestimated
    assert cut.estimate.drawn == cut.statement.draws == 30
    assert cut.estimate.runs + cut.estimate.failed == 30 + kept()
    assert kept() == 20, "of 60: one part"
    told = "\n".join(cut.estimate.lines())
    assert "50 runs: the 30 unguided draws, and draws of the prior" in told
    before = kept()
    whole = generate(CUT_IN, TRAFFIC, tmp_path, settings)
    assert whole.estimate is not None and whole.estimate.drawn == 0
    assert whole.estimate.runs + whole.estimate.failed == settings.budget
    assert kept() >= before


def test_a_search_without_any_time_estimates_by_its_draws(tmp_path: Path) -> None:
    settings = replace(QUICK, estimate=True, minutes=0.0)
    made = generate(CUT_IN, TRAFFIC, tmp_path, settings)
    assert made.cut and made.estimate is not None
    assert made.estimate.runs == made.estimate.drawn == 20
    assert "the 20 unguided draws, no time for more" in "\n".join(made.estimate.lines())
    assert not [*tmp_path.glob("*_estimate_*.jsonl")]
