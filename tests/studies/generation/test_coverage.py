"""Coverage of intervals: recordings are drawn whole, results are kept, and shares are counted."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from generation.search.outcomes import Outcomes
from generation.search.problem import Realism, Reward, SearchProblem
from generation.space.logical.library import SCENARIOS
from generation.space.recorded import of_recordings, of_samples
from generation.space.space import Space
from schemas.common.storage import Records
from studies.generation.coverage import Estimated, coverage, markdown, resampled

CUT_IN = SCENARIOS / "cut_in_highway.xosc"
SPACE = Space.of(CUT_IN)
RECORDED = of_samples(of_recordings(None, "cut_in"), SPACE)


def narrow(theta: np.ndarray) -> Outcomes:
    """Small gaps collide."""
    return Outcomes.of(len(theta), collision=theta[:, SPACE.names.index("CutIn_Gap_m")] < 12.0)


def test_recordings_are_drawn_whole() -> None:
    found = resampled(RECORDED, np.random.default_rng(0))
    whole = {
        len(rows)
        for name in np.unique(RECORDED.recordings)
        for rows in [np.flatnonzero(RECORDED.recordings == name)]
    }
    names, counts = np.unique(found.recordings, return_counts=True)
    assert len(names) == len(np.unique(RECORDED.recordings)) and set(counts.tolist()) <= whole
    assert all(len(each) == len(found.theta) for each in found.values.values())


def test_estimates_are_near_the_truth_and_are_kept(tmp_path: Path) -> None:
    real = RECORDED.within(SPACE)
    reward = Reward(Realism.fitted("gaussian", real.theta, real.recordings))
    problem = SearchProblem(
        SPACE, narrow, reward, real.theta, None, RECORDED.prior(SPACE, "gaussian"), None
    )
    found = list(
        coverage(
            problem, RECORDED, {"narrow": narrow}, "gaussian", 2, 300, Records(tmp_path / "a.jsonl")
        )
    )
    assert [each.repetition for each in found] == [0, 1]
    assert all(
        0.5 * each.true < each.value < 2.0 * each.true and each.low < each.value < each.high
        for each in found
    )
    before = (tmp_path / "a.jsonl").read_bytes()
    assert (
        list(
            coverage(
                problem,
                RECORDED,
                {"narrow": narrow},
                "gaussian",
                2,
                300,
                Records(tmp_path / "a.jsonl"),
            )
        )
        == found
    )
    assert (tmp_path / "a.jsonl").read_bytes() == before


def test_intervals_beside_the_truth_do_not_count() -> None:
    found = [
        Estimated("a", each, 1e-3, 1e-3, 5e-4, high, True)
        for each, high in enumerate((2e-3, 2e-3, 2e-3, 9e-4))
    ]
    assert "| a | 1.00e-03 | 4 | 0.75 (" in markdown(found)
