"""The study: resumable, comparable, measured, tabulated and drawn."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import xosc
from generation.pipeline import generate
from generation.search.outcomes import Outcomes
from generation.search.plays import ArrayPlays
from generation.search.problem import History, SearchProblem
from generation.search.settings import Choice, SearchSettings
from generation.space.recorded import Recorded
from generation.space.space import Space
from schemas.common.array_types import FloatArray
from schemas.common.errors import InvalidFile, UsageError
from studies.generation.comparison import study as module
from studies.generation.comparison import trajectories
from studies.generation.comparison.edge_cases import edge_cases, opened
from studies.generation.comparison.figures import write_figures
from studies.generation.comparison.measures import avoided, curves, last_third, measure, taken
from studies.generation.comparison.report import write_report
from studies.generation.comparison.study import Key, Study, StudySettings
from studies.generation.knots.motion import Setting, maneuvers_of
from tests.generation.kinematic import Kinematic, driven

SCENARIO = Path(xosc.__file__).with_name("library") / "cut_in_highway.xosc"
PINNED = {"Ego_Speed_mps": "30.0"}
METHODS = ["mcsg", "kde", "random", "no-elite"]


def recorded(space: Space) -> Recorded:
    errors = np.column_stack([np.full(200, 0.2), np.arange(200) / 199.0])
    return Recorded(driven(200), np.array([f"r{number % 10}" for number in range(200)]), errors)


def study(
    out: Path, evaluate: Callable[[FloatArray], Outcomes] | None = None, budget: int = 90
) -> Study:
    def evaluators(sut: str, scenario: Path, space: Space) -> Callable[[FloatArray], Outcomes]:
        own = evaluate or Kinematic()
        return (
            own
            if scenario == SCENARIO
            else lambda knots: own(maneuvers_of(knots, Setting(30.0, 3.75)).theta)
        )

    return Study(
        SCENARIO, recorded, out, StudySettings(budget=budget, pinned=PINNED), evaluators=evaluators
    )


@pytest.mark.parametrize("name", ["cover", "draws", "level-sets", "subset"])
def test_methods_that_draw_from_a_prior_are_compared_too(name: str, tmp_path: Path) -> None:
    found = study(tmp_path)
    assert list(found.run(found.pending(1, [name]))) == [Key(name, 0)]
    assert len(found.history(Key(name, 0)).theta) == 90


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Study:
    found = study(tmp_path_factory.mktemp("study"))
    assert len(list(found.run(found.pending(2, METHODS)))) == 8
    return found


def test_an_interrupted_study_goes_on_and_ends_as_if_it_had_not_been(
    done: Study, tmp_path: Path
) -> None:
    class Interrupted(Kinematic):
        def __call__(self, theta: FloatArray) -> Outcomes:
            if self.calls > 100:
                raise KeyboardInterrupt
            return super().__call__(theta)

    first = study(tmp_path, Interrupted())
    with pytest.raises(KeyboardInterrupt):
        list(first.run(first.pending(1, METHODS)))
    assert first.searches() == []
    assert (tmp_path / "searches" / "kde" / "0.jsonl").exists()
    second = study(tmp_path)
    assert len(list(second.run(second.pending(1, METHODS)))) == 4
    for key in second.searches():
        assert np.array_equal(second.history(key).theta, done.history(key).theta)
        assert np.array_equal(second.history(key).rewards, done.history(key).rewards)
    assert not list(tmp_path.rglob("*.jsonl"))


@pytest.mark.parametrize("arrays", [True, False])
def test_plays_in_arrays_answer_unless_each_run_is_to_be_sumos(
    arrays: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Sumo(Kinematic):
        def __init__(self, *_: object, **__: object) -> None:
            super().__init__()

        def __enter__(self) -> Sumo:
            return self

        def __exit__(self, *_: object) -> None:
            asked.append(self.calls)

    asked: list[int] = []
    monkeypatch.setattr(module, "Evaluator", Sumo)
    settings = StudySettings(budget=30, pinned=PINNED, arrays=arrays)
    with Study(SCENARIO, recorded, tmp_path, settings) as found:
        list(found.run([Key("random", 0)]))
        history = found.history(Key("random", 0))
        played = ArrayPlays(SCENARIO, found.space)(history.theta)
    assert bool(asked) is not arrays
    assert np.array_equal(played.r_risk, history.outcomes.r_risk) is arrays


def test_seeds_are_searched_whole_and_few_of_them_together() -> None:
    keys = [Key(name, seed) for seed in range(5) for name in METHODS[:3]]
    groups = module._groups(keys)
    assert [key for group in groups for key in group] == keys
    assert [len({key.seed for key in group}) for group in groups] == [5]
    many = [Key(str(name), seed) for seed in range(2) for name in range(30)]
    assert [len(group) for group in module._groups(many)] == [30, 30]


def test_a_folder_holds_results_of_one_setting(done: Study) -> None:
    with pytest.raises(UsageError, match=r"other settings \(budget\)"):
        study(done.out, budget=60)
    assert done.pending(2, METHODS) == []
    assert len(done.pending(3, METHODS)) == 4


def test_all_methods_have_the_same_calls_and_the_report_shows_each(done: Study) -> None:
    assert {len(done.history(key).theta) for key in done.searches()} == {90}
    tables = {table.name: table for table in write_report(done)}
    assert [row[0] for row in tables["generated"].rows] == [
        "**MCSG** †",
        "KDE sampling †",
        "random",
        "No-Elite †",
    ]
    assert len(tables["generated"].header) == len(tables["generated"].rows[0])
    assert tables["reconstruction"].rows == [("200", "0.200", "0.200", "0.500", "0.950")]
    assert "trajectories" not in tables
    text = (done.out / "report.md").read_text()
    assert "Ego_Speed_mps 30" in text
    assert "MCSG is number 1 of the 2 methods that keep to the plausible (†)" in text
    assert "of all 3 (" in text  # an ablation is no rival
    with (done.out / "results.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 16
    for key in done.searches():
        own = measure(done.history(key), done.problem)
        row = next(
            row
            for row in rows
            if (row["episodes"], row["method"], row["seed"]) == ("all", key.method, str(key.seed))
        )
        assert float(row["r_risk"]) == own.r_risk
        assert float(row["distinct"]) == own.distinct


def test_searches_of_trajectories_are_told_by_both_kinds_of_parameters(tmp_path: Path) -> None:
    found = study(tmp_path)
    keys = list(found.run(found.pending(1, ["mcsg", "no-maneuver"])))
    assert keys == [Key("mcsg", 0), Key("no-maneuver", 0)]
    own, told = found.knots(keys[1]), found.history(keys[1])
    assert own.theta.shape == (90, 11)
    np.testing.assert_array_equal(
        told.theta, maneuvers_of(own.theta, found.trajectories.setting).theta
    )
    np.testing.assert_array_equal(told.outcomes.collision, own.outcomes.collision)
    np.testing.assert_allclose(told.rewards, found.problem.reward(told.theta, told.outcomes))
    rows = {row[0]: row[1:] for row in trajectories.table(found).rows}
    assert list(rows) == ["recorded, by their knots", "**MCSG**", "No-Maneuver"]
    assert rows["**MCSG**"][-1] == "1.000"
    assert float(rows["recorded, by their knots"][-1]) >= 0.97
    assert float(rows["recorded, by their knots"][1]) > 0.9
    assert float(rows["No-Maneuver"][5]) == pytest.approx(
        measure(last_third(told), found.problem).edge_cases, abs=6e-4
    )
    with pytest.raises(UsageError, match="no search method 'no-maneuver'"):
        generate(SCENARIO, recorded, tmp_path / "files", SearchSettings(method="no-maneuver"))


def test_there_are_trajectories_beside_all_seven_parameters_only(tmp_path: Path) -> None:
    part = Study(
        SCENARIO, lambda space: Recorded(driven(60)[:, :6], np.arange(60).astype(str)), tmp_path,
        StudySettings(pinned={"CutIn_RestTime_s": "2", **PINNED}), evaluators=lambda sut, scenario,
        space: Kinematic(),
    )  # fmt: skip
    with pytest.raises(UsageError, match="all seven parameters of cut_in_highway only"):
        list(part.run([Key("no-maneuver", 0)]))


def close(theta: FloatArray) -> Outcomes:
    """Collides where the gap is small."""
    return Outcomes.of(
        len(theta),
        collision=theta[:, 0] < np.median(driven(200)[:, 0]),
        status=["completed"] * len(theta),
    )


def test_edge_cases_of_a_study_are_the_likeliest_collisions_of_all_its_seeds(
    tmp_path: Path,
) -> None:
    done = study(tmp_path, close)
    assert len(list(done.run(done.pending(2, ["kde"])))) == 2
    found = edge_cases(done, "kde", Choice(4))
    searches = [done.history(Key("kde", seed)) for seed in (0, 1)]
    theta = np.concatenate([one.theta[one.outcomes.collision] for one in searches])
    likelihood = done.problem.reward.realism.density.log_density(theta)
    likelihood_of = dict(
        zip(
            (tuple(done.space.values(row).values()) for row in theta),
            likelihood.tolist(),
            strict=True,
        )
    )
    chosen = [
        likelihood_of[tuple(job.parameters[name] for name in done.space.names)] for job in found
    ]
    assert 2 <= len(found) <= 4
    assert chosen == sorted(chosen, reverse=True)
    assert chosen[0] == pytest.approx(likelihood.max())
    assert {(job.scenario, job.parameters["Ego_Speed_mps"]) for job in found} == {
        (SCENARIO, "30.0")
    }


def test_folders_without_what_is_to_be_compared_are_refused(done: Study, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no manoeuvres that gacs searched"):
        edge_cases(done, "gacs", Choice())
    with pytest.raises(UsageError, match=r"other settings \(inputs\)"):
        opened(done.out, SCENARIO.parent)
    (tmp_path / "configuration.json").write_text("[1]")
    with pytest.raises(InvalidFile, match="no study's configuration"):
        opened(tmp_path, SCENARIO.parent)


def test_figures_are_drawn_for_what_is_there(done: Study, tmp_path: Path) -> None:
    drawn = write_figures(done, tmp_path)
    assert {path.stem for path in drawn} == {
        "learning",
        "methods",
        "ablations",
        "projections",
        "trajectories",
    }
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in drawn)


def test_measures_are_means_over_what_took_place(problem: SearchProblem) -> None:
    theta = np.repeat(problem.real[:2], 2, axis=0)
    outcomes = Outcomes.of(
        4,
        collision=[True, True, False, False],
        r_risk=[0.5, 0.5, 1.0, 0.0],
        status=["completed", "completed", "completed", "error"],
        error=["", "", "", "it broke"],
    )
    found = measure(History(theta, outcomes, problem.reward(theta, outcomes)), problem)
    assert found.collisions == pytest.approx(2 / 3)
    assert found.r_risk == pytest.approx(0.5)
    assert found.failed == 0.25
    assert found.distinct == 1  # two times the same
    assert 0.0 < found.diversity < 1.0
    half = taken(
        History(theta, outcomes, problem.reward(theta, outcomes)),
        np.array([False, False, True, True]),
    )
    assert measure(half, problem).edge_cases == 0.0


def test_avoidable_is_what_the_careful_driver_survives(problem: SearchProblem) -> None:
    theta = np.repeat(problem.real[:1], 9, axis=0)
    hit = Kinematic()(theta)
    every = Outcomes(**{**vars(hit), "collision": np.ones(9, bool)})
    history = History(theta, every, np.zeros(9))
    assert (
        avoided(
            history,
            lambda rows: Outcomes(
                **{name: values[: len(rows)] for name, values in vars(every).items()}
            ),
        )
        == 0.0
    )
    assert avoided(history, Kinematic()) == 1.0 - hit.collision.mean()
    failed = Outcomes(
        **{
            **vars(hit),
            "collision": np.arange(9) == 0,
            "status": np.where(np.arange(9) < 3, "completed", "error"),
        }
    )
    assert avoided(history, lambda rows: failed) == pytest.approx(2 / 3)
    assert (
        avoided(history, lambda rows: Outcomes(**{**vars(hit), "status": np.full(9, "error")}))
        is None
    )
    none = Outcomes(**{**vars(hit), "collision": np.zeros(9, bool)})
    assert avoided(History(theta, none, np.zeros(9)), Kinematic()) is None


def test_curves_are_means_over_a_window(problem: SearchProblem) -> None:
    theta = np.repeat(problem.real[:1], 4, axis=0)
    outcomes = Outcomes(**{**vars(Kinematic()(theta)), "r_risk": np.array([0.0, 1.0, 1.0, 0.0])})
    found = curves(History(theta, outcomes, np.arange(4.0)), window=2)
    assert found["r_risk"].tolist() == [0.0, 0.5, 1.0, 0.5]
    assert found["reward"].tolist() == [0.0, 0.5, 1.5, 2.5]
