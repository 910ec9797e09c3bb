"""Two adversaries at once: recorded pairs, their scenarios, and what they do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import runner
import schemas
from generation.search.outcomes import Evaluator
from generation.search.plays import ArrayPlays
from generation.space import SpaceChoice
from generation.space.logical.library import SCENARIOS, pair_scenarios
from generation.space.logical.pairs import LEAD_IN, PairUnits
from generation.space.recorded import kind_of, of_recordings, of_samples
from generation.space.space import Space
from recognition.labels.maneuvers.units import MOST_LAG, OWN, Samples, followed, pairs
from runner.judging.settings import RunSettings
from schemas.common.errors import UsageError
from studies.generation.pairs import Coordinated, acting_alone

NAMES = [name for name, _ in pair_scenarios()]
TAIL_GATED = "merge_beside_tail_gater_highway"


def path_of(name: str) -> Path:
    return SCENARIOS / f"{name}.xosc"


def unit_table(rows: list[tuple[str, str, str, float, float]]) -> Samples:
    """Units of kinds, actors, others, at times and with gaps; all are 4 s long,
    at 20 m/s around an ego at 25 m/s.
    """
    n = len(rows)
    kinds, actors, others, times, gaps = (np.array(column) for column in zip(*rows, strict=True))
    theta = np.tile([0.0, 20.0, 1.0, 20.0, 4.0, 20.0, 2.0], (n, 1))
    theta[:, 0] = gaps
    texts = np.array(["a"] * n), kinds, actors, others
    return Samples(theta, *texts, times, np.full(n, 25.0), np.zeros((n, 2)), np.full(n, np.nan))


def test_units_at_a_time_around_one_ego_are_pairs() -> None:
    table = unit_table([
        ("cut_in", "c", "e", 10.0, 10.0),
        ("braking", "l", "e", 11.0, 40.0),  # a pair
        ("braking", "m", "c", 12.0, 30.0),  # a pair: the one who cuts in is between by then
        ("braking", "n", "e", 15.0, 40.0),  # later
        ("braking", "o", "f", 11.0, 40.0),  # around another one
        ("braking", "p", "e", 11.0, 8.0),  # where the one who cuts in is
        ("braking", "c", "e", 11.0, 40.0),  # the same actor
    ])  # fmt: skip
    found = pairs(table, "cut_in", "braking")
    assert found.first.actors.tolist() == ["c", "c"]
    assert found.second.actors.tolist() == ["l", "m"]
    np.testing.assert_allclose(found.lag, [1.0, 2.0])
    np.testing.assert_allclose(found.ahead, [40.0 + 5.0 * 1.0 - 10.0 - 4.5, 30.0])


def test_no_two_actors_have_the_same_unit() -> None:
    found = pairs(Samples.read(OWN), "cut_in", "cut_in")
    assert len(found) > 50
    assert (found.first.actors != found.second.actors).all()
    assert (found.first.recordings == found.second.recordings).all()
    assert (np.abs(found.lag) < MOST_LAG).all()


@pytest.mark.parametrize("name", NAMES)
def test_recorded_pairs_fill_a_space_and_its_prior_lets_nobody_drive_through_another(
    name: str,
) -> None:
    units = of_recordings(None, kind_of(path_of(name)))
    assert isinstance(units, PairUnits)
    space = Space.of(path_of(name))
    recorded = of_samples(units, space)
    prior = recorded.prior(space, "gaussian")
    drawn = prior.sample(50, np.random.default_rng(0))
    assert units.apart(space.by_name(drawn)).all()
    assert prior.foreseeable(drawn).mean() > 0.9
    for begin in (
        drawn[:, column] for column, each in enumerate(space.names) if each.endswith("Begin_s")
    ):
        assert (np.abs(begin - LEAD_IN) <= MOST_LAG).all()


def test_what_is_foreseeable_together_is_also_foreseeable_alone() -> None:
    path = path_of(TAIL_GATED)
    space = Space.of(path, SpaceChoice(pinned={"Merging_Duration_s": "4"}))
    recorded = of_samples(of_recordings(None, kind_of(path)), space)
    prior, together = recorded.prior(space, "gaussian"), recorded.recorded_prior(space, "gaussian")
    (merging,) = recorded.alone(space, "gaussian")
    assert set(merging.names) == set(space.names) - {"TailGater_Gap_m"}
    drawn = space.draw(2000, np.random.default_rng(0))
    single = merging.foreseeable(drawn[:, [space.names.index(name) for name in merging.names]])
    pair = together.foreseeable(drawn)
    assert (pair & ~single).any()
    np.testing.assert_array_equal(prior.foreseeable(drawn), pair & single)


@pytest.mark.parametrize("name", [name for name in NAMES if name != TAIL_GATED])
def test_arrays_play_both_as_the_interpreter_does(name: str) -> None:
    space = Space.of(path_of(name))
    recorded = of_samples(of_recordings(None, kind_of(path_of(name))), space).within(space)
    theta = recorded.theta[:8]
    with Evaluator(
        path_of(name), space, run=RunSettings(world="kinematic"), processes=1
    ) as evaluate:
        real = evaluate(theta)
    played = ArrayPlays(path_of(name), space)(theta)
    np.testing.assert_array_equal(played.collision, real.collision)
    np.testing.assert_allclose(played.end_time, real.end_time, atol=1e-6)
    np.testing.assert_allclose(played.max_drac, real.max_drac, rtol=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_gaps_are_those_of_the_parameters_when_the_first_one_begins(name: str) -> None:
    result = runner.run(path_of(name), sut=None, world="kinematic")
    tracks = [track.columns for track in result.recording.tracks.values()]
    row = round(LEAD_IN / 0.05)
    places = sorted(track["s"][row] for track in tracks)
    np.testing.assert_allclose(np.diff(places), [15.0 + 4.5, 15.0 + 4.5], atol=1e-6)


def test_one_who_acts_alone_leaves_the_other_one_where_it_is(tmp_path: Path) -> None:
    alone = acting_alone(path_of(NAMES[0]), tmp_path)
    assert list(alone) == ["CutIn", "Lead"]
    for name, path in alone.items():
        assert schemas.check(path) == []
        recording = runner.run(path, sut=None, world="kinematic").recording
        other = next(each for each in alone if each != name)
        assert np.ptp(recording.tracks[other].columns["t"]) == 0.0
        assert np.ptp(recording.tracks[other].columns["speed"]) == 0.0
        assert np.ptp(recording.tracks[name].columns["speed"]) > 0.0


@pytest.mark.slow
def test_only_what_needs_both_counts(tmp_path: Path) -> None:
    space = Space.of(path_of(NAMES[0]))
    alone = {
        name: ArrayPlays(path, space)
        for name, path in acting_alone(path_of(NAMES[0]), tmp_path).items()
    }
    plays = ArrayPlays(path_of(NAMES[0]), space)
    theta = space.draw(300, np.random.default_rng(3))
    every = plays(theta).collision
    counted = Coordinated(plays, alone)(theta).collision
    single = np.any([plays(theta).collision for plays in alone.values()], axis=0)
    assert every.any()
    np.testing.assert_array_equal(counted, every & ~single)


def test_units_of_followed_egos_tell_how_far_behind_someone_is() -> None:
    table = unit_table([
        ("cut_in", "c", "e", 10.0, 10.0),
        ("acceleration", "e", "f", 7.0, 30.0),
        ("braking", "e", "f", 11.0, 20.0),  # nearer in time
        ("cut_in", "d", "g", 10.0, 10.0),
        ("braking", "g", "f", 15.0, 20.0),  # later
        ("cut_in", "h", "i", 10.0, 10.0),
        ("braking", "i", "h", 10.0, 20.0),  # before the one who cuts in
    ])  # fmt: skip
    found = followed(table, "cut_in")
    assert found.units.actors.tolist() == ["c"]
    np.testing.assert_allclose(found.behind, [20.0 + (25.0 - 20.0) * 1.0])


def test_a_tail_gater_keeps_its_gap_and_hits_who_brakes_harder_than_it_reacts(
    tmp_path: Path,
) -> None:
    path, gap = path_of(TAIL_GATED), "TailGater_Gap_m"
    calm = runner.run(path, sut=None, world="kinematic", parameters={"Merging_Gap_m": "140"})
    ego, _, behind = (track.columns["s"] for track in calm.recording.tracks.values())
    np.testing.assert_allclose(ego - behind, 15.0 + 4.5, atol=1e-6)
    near = {"Merging_Gap_m": "4", "Merging_EndSpeed_mps": "12", "Merging_FinalSpeed_mps": "12"}
    hit = runner.run(path, sut="cas", world="kinematic", parameters={**near, gap: "6"})
    assert hit.verdict.reasons[0].startswith("collision with TailGater")
    alone = acting_alone(path, tmp_path)
    for each in alone.values():
        assert schemas.check(each) == []
    without = runner.run(
        alone["Merging"], sut="cas", world="kinematic", parameters={**near, gap: "6"}
    )
    assert "TailGater" not in without.recording.tracks
    assert "TailGater" not in str(without.verdict.reasons)
    assert runner.run(
        alone["TailGater"], sut="cas", world="kinematic", parameters={**near, gap: "6"}
    ).verdict.passed


def test_other_scenarios_have_no_two_adversaries(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no scenario of two adversaries"):
        acting_alone(SCENARIOS / "cut_in_highway.xosc", tmp_path)
