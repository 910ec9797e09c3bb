"""Episodes: real runs of the file, the same in any number of processes, and
whole whatever happens in them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import runner
from generation.search.outcomes import Evaluator, Outcomes
from generation.space import SpaceChoice
from generation.space.space import Space
from recognition.labels.maneuvers.parameters import Parameter
from runner.judging.settings import RunSettings
from schemas.common.errors import UsageError

CUT_IN = Path(__file__).parents[3] / "xosc" / "library" / "simple_cut_in.xosc"
SPACE = Space.of(CUT_IN, SpaceChoice(pinned={"Ego_Speed_mps": "30"}))
HARD, MILD = (10.0, 6.0, 1.5), (29.0, 60.0, 5.0)
"""Speed, gap and duration of a cut-in that collides, and of one that has no consequence"""


@pytest.fixture(scope="module")
def evaluator() -> Iterator[Evaluator]:
    with Evaluator(CUT_IN, SPACE, run=RunSettings(timestep=0.1)) as made:
        yield made


def same(a: Outcomes, b: Outcomes) -> bool:
    return all(
        np.array_equal(getattr(a, name), getattr(b, name)) for name in a.__dataclass_fields__
    )


def test_an_episode_is_a_run_of_the_file(evaluator: Evaluator) -> None:
    assert SPACE.names == ("CutIn_Speed_mps", "CutIn_Gap_m", "CutIn_LaneChangeTime_s")
    found = evaluator(np.array([HARD, MILD]))
    for row, theta in enumerate((HARD, MILD)):
        parameters = {"Ego_Speed_mps": "30", **SPACE.values(theta)}
        result = runner.run(CUT_IN, parameters=parameters, timestep=0.1, end_after_collision=False)
        assert result.criticality is not None
        assert found.collision[row] == (not result.verdict.passed)
        assert found.r_risk[row] == result.criticality.risk("ad-rss")
        assert (found.end_time[row], found.status[row]) == (result.end_time, result.status)
    assert found.collision.tolist() == [True, False]
    assert ((found.r_risk > 0.0) & (found.r_risk < 1.0)).all()
    assert found.min_ttc[0] == 0.0 < found.min_ttc[1] < math.inf
    assert found.executed.all()


def test_outcomes_do_not_depend_on_the_number_of_processes_nor_on_what_ran_before(
    evaluator: Evaluator,
) -> None:
    theta = SPACE.draw(10, np.random.default_rng(1))
    two = evaluator(theta)
    with Evaluator(CUT_IN, SPACE, run=RunSettings(timestep=0.1), processes=1) as single:
        assert same(single(theta), two)
        assert single.calls == 10
    assert same(
        evaluator(theta[::-1].copy()),
        Outcomes(*(getattr(two, name)[::-1] for name in two.__dataclass_fields__)),
    )


@pytest.mark.slow
def test_on_a_ray_cluster_outcomes_are_the_same(evaluator: Evaluator) -> None:
    pytest.importorskip("ray", reason="Ray is not installed (extra: ray)")
    theta = SPACE.draw(6, np.random.default_rng(2))
    with Evaluator(
        CUT_IN, SPACE, run=RunSettings(timestep=0.1), processes=2, ray="local"
    ) as cluster:
        assert same(cluster(theta), evaluator(theta))


def test_calls_are_counted(evaluator: Evaluator) -> None:
    before = evaluator.calls
    assert len(evaluator(np.empty((0, 3)))) == 0
    evaluator(np.array([MILD]))
    assert evaluator.calls == before + 1


def test_an_episode_that_can_not_run_says_why() -> None:
    wide = Space((Parameter("CutIn_Gap_m", -50.0, 80.0),), {"Ego_Speed_mps": "30"})
    with Evaluator(CUT_IN, wide, run=RunSettings(timestep=0.1)) as evaluator:
        found = evaluator(np.array([[-20.0], [30.0]]))
    assert found.executed.tolist() == [False, True]
    assert found.status[0] == "error"
    # Without the folder: the same search in another one has the same bytes.
    assert found.error[0].startswith(f"{CUT_IN.name}:31: ParameterDeclaration: ")
    assert "CutIn_Gap_m" in found.error[0]
    assert found.error[1] == ""


DEADLY = """
import os

class Deadly:
    def reset(self, ego, timestep, seed):
        pass

    def control(self, observation, dt):
        if observation.others[0].speed < 15.0:
            os._exit(1)
        from runner.systems import Control
        return Control()
"""


def test_an_episode_that_kills_its_process_does_not_end_the_search(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "deadly_system.py").write_text(DEADLY)
    monkeypatch.syspath_prepend(str(tmp_path))
    with Evaluator(
        CUT_IN,
        SPACE,
        run=RunSettings(timestep=0.1, sut="deadly_system:Deadly", sut_in_process=True),
    ) as evaluator:
        found = evaluator(np.array([MILD, HARD, MILD]))
        assert found.executed.tolist() == [True, False, True]
        assert "died" in found.error[1]
        assert evaluator(np.array([MILD])).executed.all()


def test_an_rss_set_that_does_not_exist_is_refused_before_anything_runs() -> None:
    with pytest.raises(UsageError, match="absent"):
        Evaluator(CUT_IN, SPACE, rss="absent")
