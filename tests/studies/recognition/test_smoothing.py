"""Settings of smoothing by rows that are hidden from it, and by exact recordings."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from recognition.recordings.motion.observations import Noise
from recognition.recordings.motion.smoothing import centres
from schemas.common.errors import UsageError
from studies.recognition.smoothing import ways
from studies.recognition.smoothing.cases import Case, States, Tracks, drawn, hidden, noisy
from studies.recognition.smoothing.command import smoothing
from studies.recognition.smoothing.scores import Score, score
from studies.recognition.smoothing.search import Judged, Method, Trial, best
from studies.recognition.smoothing.ways import Way
from tests.recognition.traffic import interaction_rows, write_csv

TIME = 0.1 * np.arange(150)
WAYS: dict[str, Way] = {
    "ours": partial(ways.ours, Noise()),
    "constant acceleration": partial(ways.constant_acceleration, 1.5),
    "Savitzky-Golay": partial(ways.savitzky_golay, 1.4, 3),
    "spline": partial(ways.spline, 0.03),
    "spline by cross-validation": partial(ways.spline, None),
}


def written(folder: Path, noise: float = 0.0) -> Path:
    """A recording of two cars, one of which brakes in a curve, and of one that
    is seen too shortly.
    """
    rng = np.random.default_rng(3)
    way = 12.0 * TIME - 0.35 * TIME**2
    angle = way / 60.0
    curved = 60.0 * np.sin(angle), 60.0 * (1.0 - np.cos(angle)), angle, 12.0 - 0.7 * TIME
    straight = 9.0 * TIME, np.full(len(TIME), 30.0), np.zeros(len(TIME)), np.full(len(TIME), 9.0)
    rows = [
        row
        for track in (1, 2)
        for row in interaction_rows(track, 0.0, 0.0, 0.0, 0.0, 0.0, n=len(TIME))
    ]
    for row, (x, y, h, speed) in zip(
        rows,
        [values for track in (curved, straight) for values in zip(*track, strict=True)],
        strict=True,
    ):
        off = rng.normal(0.0, noise, 2)
        row |= {
            "x": x + off[0],
            "y": y + off[1],
            "vx": speed * np.cos(h),
            "vy": speed * np.sin(h),
            "psi_rad": h,
        }
    return write_csv(
        folder / "vehicle_tracks_000.csv",
        rows + interaction_rows(3, 0.0, 60.0, 5.0, 0.0, 0.0, n=30),
    ).parent


def tracks_of(folder: Path, noise: float = 0.0) -> Tracks:
    (found,) = drawn(written(folder, noise), 10_000, np.random.default_rng(0))
    return found


def test_stretches_are_hidden_within_tracks_that_are_long_enough(tmp_path: Path) -> None:
    tracks = tracks_of(tmp_path)
    assert [one.name for one in tracks.who] == ["1", "2"]
    case = hidden(tracks, np.random.default_rng(1))
    begins = np.diff(np.append(0, case.counted.astype(int)))
    sizes = np.flatnonzero(np.append(begins, 0) < 0) - np.flatnonzero(begins > 0)
    assert len(sizes) > 5 and 1 <= sizes.min() <= sizes.max() <= 10
    for start, end in zip(tracks.rows.starts[:-1], tracks.rows.starts[1:], strict=True):
        assert not case.counted[start : start + 10].any() and not case.counted[end - 10 : end].any()


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_what_is_hidden_has_no_effect(tmp_path: Path, way: Way) -> None:
    tracks = tracks_of(tmp_path, 0.05)
    case = hidden(tracks, np.random.default_rng(1))
    moved = {
        name: values + np.where(case.counted, 0.4, 0.0) for name, values in tracks.columns.items()
    }
    other = hidden(tracks._replace(columns=moved), np.random.default_rng(1))
    assert (other.counted == case.counted).all() and np.abs(
        other.truth.x - case.truth.x
    ).max() > 0.3
    for one, another in zip(way(case), way(other._replace(off=case.off)), strict=True):
        assert one == pytest.approx(another, abs=1e-9)


@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_every_way_finds_hidden_rows_of_quiet_motion_and_takes_noise_away(
    tmp_path: Path, way: Way
) -> None:
    tracks = tracks_of(tmp_path)
    found = score(way, [hidden(tracks, np.random.default_rng(1))])
    assert found.place < 0.15 and found.speed < 0.2 and found.heading < 0.05
    case = noisy(tracks, np.random.default_rng(2))
    assert score(way, [case]).place < score(shown, [case]).place


def shown(case: Case) -> States:
    """Nothing is smoothed."""
    columns = case.tracks.columns
    return States(*centres(*case.tracks), columns["h"], columns["speed"], columns["acceleration"])


def test_scores_are_root_mean_squares_and_a_likelihood_that_is_best_at_the_truth(
    tmp_path: Path,
) -> None:
    case = hidden(tracks_of(tmp_path), np.random.default_rng(1))
    right = score(lambda case: case.truth, [case])
    off = score(
        lambda case: case.truth._replace(x=case.truth.x + 0.3, h=case.truth.h + 2.0 * np.pi + 0.1),
        [case],
    )
    assert right[:4] == pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1e-12)
    assert off[:2] == pytest.approx((0.3, 0.1))
    assert right.beyond == 0.0
    assert (
        off.likelihood
        < right.likelihood
        == pytest.approx(-np.log(2.0 * np.pi * case.off[case.counted] ** 2).mean())
    )


def test_rows_beyond_limits_are_counted(tmp_path: Path) -> None:
    case = hidden(tracks_of(tmp_path), np.random.default_rng(1))
    first = np.arange(len(case.truth.x)) == 5

    def wild(case: Case) -> States:
        return case.truth._replace(
            acceleration=np.where(first, -12.0, 0.0),
            h=np.where(np.roll(first, 60), 2.0, case.truth.h),
        )

    assert score(wild, [case]).beyond == pytest.approx(3 / len(first))


def test_settings_that_find_hidden_rows_best_are_chosen_of_those_that_are_exact() -> None:
    def trial(name: float, likelihood: float, error: float) -> Trial:
        exact = Score(error, 0.0, error, error, 0.0, 0.0)
        return Trial(
            {"jerk": name}, Judged({"site": Score(1.0, 0.0, 0.0, 0.0, likelihood, 0.0)}, exact)
        )

    trials = [trial(1.0, 2.0, 0.1), trial(2.0, 3.0, 0.2), trial(3.0, 4.0, 0.4)]
    assert best(trials, 0.21).settings == {"jerk": 2.0}
    assert best(trials, 0.05).settings == {"jerk": 1.0}


def test_report_names_what_was_chosen_and_how_it_does_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    method = Method(
        "ours",
        lambda **settings: partial(ways.ours, Noise(**settings)),
        {name: (value,) for name, value in Noise()._asdict().items()},
    )
    method.values["jerk"] = (1.5, 8.0)  # type: ignore[index]
    monkeypatch.setattr("studies.recognition.smoothing.search.METHODS", (method,))
    monkeypatch.setattr("studies.recognition.smoothing.cases._SITES", 1)
    monkeypatch.setattr("studies.recognition.smoothing.cases._LENGTH", 6.0)
    here, there = written(tmp_path / "here", 0.1), written(tmp_path / "there", 0.1)
    smoothing([here], [there], tmp_path / "out", own=1, report_own=2, rows=1000)
    chosen, reported, about = (tmp_path / "out" / "smoothing.md").read_text().split("\n\n")
    assert "| way | settings | here: place, heading, speed, likelihood, beyond limits |" in chosen
    assert "| ours | heading 0.1, jerk 1.5, bend 0.02, tails 4 |" in chosen.splitlines()[4]
    assert (
        "| there: place, heading, speed, likelihood, beyond limits |" in reported
        and "+0.000 | +0.0 % | +0.0 % |" in reported
    )
    assert about.splitlines()[3].startswith("| jerk 8 | ")


def test_what_was_chosen_by_is_not_reported_on(tmp_path: Path) -> None:
    here = written(tmp_path / "here")
    with pytest.raises(UsageError, match="what settings are chosen by is not to be reported on"):
        smoothing([here], [here], tmp_path / "out")
    with pytest.raises(UsageError, match="two data sets have the name 'here'"):
        smoothing([here, written(tmp_path / "other" / "here")], [tmp_path], tmp_path / "out")
