"""Recorded drivers say how likely an action is, and how far an adversary may go."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from recognition.labels.maneuvers.units import OWN as UNITS
from recognition.labels.maneuvers.units import Samples
from schemas.common.errors import InvalidFile, UsageError
from studies.generation.adversary.actions import DECISIONS, Actions
from studies.generation.adversary.driving import Driving


def test_actions_survive_their_file(actions: Actions, tmp_path: Path) -> None:
    actions.write(tmp_path / "actions.parquet")
    read = Actions.read(tmp_path / "actions.parquet")
    np.testing.assert_array_equal(read.joint, actions.joint)
    assert (read.recordings == actions.recordings).all()
    assert (read.episodes == actions.episodes).all()


def test_what_is_no_table_is_refused(tmp_path: Path) -> None:
    (tmp_path / "no.parquet").write_text("no table")
    with pytest.raises(InvalidFile, match="no table of actions"):
        Actions.read(tmp_path / "no.parquet")


def test_tables_that_lack_something_say_what(actions: Actions, tmp_path: Path) -> None:
    path = tmp_path / "actions.parquet"
    states = actions.states.copy()
    states[10, 2] = np.nan
    Actions(states, actions.actions, actions.recordings, actions.episodes).write(path)
    with pytest.raises(InvalidFile, match="row 11: drift is not a finite number"):
        Actions.read(path)
    Samples.read(UNITS).of_kind("cut_in").where(np.arange(3)).write(path)
    with pytest.raises(InvalidFile, match="no column across"):
        Actions.read(path)


def test_decisions_are_counted_within_their_episode(actions: Actions) -> None:
    rank = actions.rank
    assert rank[0] == 0
    assert rank.max() < DECISIONS
    assert (np.diff(rank)[np.diff(actions.episodes) == 0] == 1).all()
    assert (rank[1:][np.diff(actions.episodes) > 0] == 0).all()


def test_joined_tables_tell_their_episodes_apart(actions: Actions) -> None:
    first = Actions(
        actions.states[:20], actions.actions[:20], actions.recordings[:20], np.repeat([0, 1], 10)
    )
    joined = Actions.joined([first, first])
    assert joined.episodes.tolist() == [0] * 10 + [1] * 10 + [2] * 10 + [3] * 10


def test_what_drivers_do_is_likelier_than_what_they_do_not(
    driving: Driving, actions: Actions
) -> None:
    done = driving.log_density(actions.states, actions.actions).mean()
    shuffled = np.random.default_rng(0).permutation(actions.actions)
    assert done > driving.log_density(actions.states, shuffled).mean() + 1.0
    assert driving.held_out.mean() < done + 0.5
    assert (
        driving.log_density(actions.states, driving.likeliest(actions.states)) >= -2.0
    ).mean() > 0.98


def test_nearly_all_recorded_episodes_are_foreseeable(driving: Driving, actions: Actions) -> None:
    long = [
        number
        for number in np.unique(actions.episodes)
        if (actions.episodes == number).sum() >= DECISIONS
    ]
    sums = np.array(
        [driving.held_out[actions.episodes == number][:DECISIONS].sum() for number in long]
    )
    assert driving.foreseeable(sums, DECISIONS).mean() == pytest.approx(0.99, abs=0.01)


def test_an_action_is_brought_back_until_its_episode_is_foreseeable(
    driving: Driving, actions: Actions
) -> None:
    first = actions.states[actions.rank == 0]
    wanted = np.full((len(first), 2), 50.0)
    kept, density = driving.kept(first, wanted, np.zeros(len(first)), 0)
    assert (kept <= driving.limits.high + 1e-12).all()
    change = np.abs(kept - first[:, -2:])
    assert (change <= driving.limits.change + 1e-12)[
        (np.abs(first[:, -2:]) < driving.limits.high).all(axis=1)
    ].all()
    assert driving.foreseeable(density, 1).mean() > 0.95
    np.testing.assert_allclose(density, driving.log_density(first, kept))


def test_nothing_is_changed_that_recorded_drivers_do(driving: Driving, actions: Actions) -> None:
    first = actions.states[actions.rank == 0]
    likely = driving.likeliest(first)
    kept, _ = driving.kept(first, likely, np.full(len(first), 100.0), 0)
    np.testing.assert_allclose(kept, likely)


def test_too_few_episodes_are_refused(actions: Actions) -> None:
    few = actions.episodes < actions.episodes[0] + 40
    part = Actions(
        actions.states[few], actions.actions[few], actions.recordings[few], actions.episodes[few]
    )
    with pytest.raises(UsageError, match="too few to say how drivers act"):
        Driving(part)
