"""Densities: against closed forms, and what holds for every one of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import gaussian_kde, multivariate_normal

from generation.space.density.base import Density, Whitening, folds
from generation.space.density.models import JUDGE, judge, model, models
from generation.space.density.models.flow import Couplings, NormalizingFlow
from generation.space.density.models.kernels import KDE, Independent, scott
from generation.space.density.models.mixtures import Gaussian, Mixture, Student
from generation.space.density.prior import fitted, held_out, others
from schemas.common.array_types import FloatArray
from schemas.common.errors import UsageError

MEAN = np.array([30.0, 25.0, 2.0])
COVARIANCE = np.array([[25.0, 12.0, 0.5], [12.0, 16.0, 0.2], [0.5, 0.2, 0.25]])
QUICK = replace(Couplings(), epochs=25)
EVERY: dict[str, Callable[[], Density]] = {name: partial(model, name) for name in models()} | {
    "flow": lambda: NormalizingFlow(QUICK)
}
LEARNT = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name == "flow" else ()) for name in EVERY]
)
"""Every density; seconds of the flow are slow"""


def normal(n: int, seed: int = 0) -> FloatArray:
    return np.random.default_rng(seed).multivariate_normal(MEAN, COVARIANCE, size=n)


def recordings(n: int, groups: int = 8) -> np.ndarray:
    return np.array([f"r{number % groups}" for number in range(n)])


@LEARNT
def test_on_normal_samples_the_mean_log_density_is_that_of_the_truth_or_of_its_marginals(
    name: str,
) -> None:
    fitted, fresh = EVERY[name]().fit(normal(700), recordings(700)), normal(1000, seed=1)
    truth = multivariate_normal(MEAN, COVARIANCE).logpdf(fresh).mean()
    if name == "independent":
        truth = sum(
            multivariate_normal(MEAN[j], COVARIANCE[j, j]).logpdf(fresh[:, j]).mean()
            for j in range(3)
        )
    assert truth - 0.2 < fitted.log_density(fresh).mean() < truth + 0.02


@LEARNT
def test_samples_have_the_moments_of_what_was_fitted_and_depend_on_the_seed_alone(
    name: str,
) -> None:
    fitted = EVERY[name]().fit(normal(300), recordings(300))
    drawn = fitted.sample(5_000, np.random.default_rng(2))
    deviation = np.sqrt(np.diag(COVARIANCE))
    assert (np.abs(drawn.mean(axis=0) - MEAN) < 0.2 * deviation).all()
    assert (np.abs(drawn.std(axis=0) / deviation - 1.0) < 0.25).all()
    assert np.array_equal(drawn, fitted.sample(5_000, np.random.default_rng(2)))
    again = EVERY[name]().fit(normal(300), recordings(300))
    assert np.array_equal(again.log_density(drawn[:50]), fitted.log_density(drawn[:50]))


@LEARNT
def test_units_move_log_densities_by_the_jacobian(name: str) -> None:
    rows, fresh, factor = normal(300), normal(50, seed=3), np.array([3.6, 0.5, 1000.0])
    one = EVERY[name]().fit(rows, recordings(300)).log_density(fresh)
    other = EVERY[name]().fit(rows * factor, recordings(300)).log_density(fresh * factor)
    assert np.allclose(one, other + np.log(factor).sum(), atol=1e-6)


@LEARNT
def test_densities_integrate_to_one(name: str) -> None:
    rows = normal(200)[:, :2]
    axes = [
        np.linspace(mean - 9 * deviation, mean + 9 * deviation, 241)
        for mean, deviation in ((30, 5), (25, 4))
    ]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    cell = np.prod([axis[1] - axis[0] for axis in axes])
    density = np.exp(EVERY[name]().fit(rows).log_density(grid))
    assert density.sum() * cell == pytest.approx(1.0, abs=2e-3)


@given(st.integers(5, 60), st.integers(1, 3), st.floats(0.3, 2.0), st.integers(0, 1000))
@settings(max_examples=30)
def test_kde_is_scipys_with_the_same_bandwidth(n: int, d: int, factor: float, seed: int) -> None:
    rows = normal(n, seed)[:, :d]
    own = KDE(factor).fit(rows)
    assert own.bandwidth == pytest.approx(factor * n ** (-1 / (d + 4)))
    assert np.allclose(
        own.log_density(rows[:9] + 1.0),
        gaussian_kde(rows.T, own.bandwidth).logpdf(rows[:9].T + 1.0),
    )


def test_cross_validation_narrows_kernels_where_samples_are_clustered() -> None:
    generator = np.random.default_rng(0)
    clustered = np.concatenate(
        [generator.normal(centre, 0.1, (150, 2)) for centre in (-5.0, 0.0, 5.0)]
    )
    assert KDE().fit(clustered, np.tile(np.arange(10), 45)).bandwidth < 0.5 * scott(450, 2)
    assert KDE().fit(normal(450), recordings(450)).bandwidth > 0.7 * scott(450, 3)


def test_cross_validation_does_not_trust_repetitions_within_a_recording() -> None:
    rows = np.repeat(normal(60), 5, axis=0) + np.random.default_rng(0).normal(0, 1e-3, (300, 3))
    of_rows = np.repeat(np.arange(60), 5)
    assert KDE().fit(rows).bandwidth < 0.5 * KDE().fit(rows, of_rows).bandwidth


def test_mixture_finds_how_many_clusters_there_are() -> None:
    generator = np.random.default_rng(0)
    clustered = np.concatenate(
        [generator.normal(centre, 0.5, (100, 2)) for centre in ((-5, 0), (5, -5), (5, 5))]
    )
    assert len(Mixture().fit(clustered).gaussians.means) == 3
    assert len(Mixture().fit(normal(300)).gaussians.means) == 1
    assert len(Mixture(2).fit(normal(300)).gaussians.means) == 2


def test_a_mixture_of_values_that_are_few_tries_no_more_components_than_there_are(
    recwarn: pytest.WarningsRecorder,
) -> None:
    few = np.repeat([[10.0, 0.0], [20.0, 1.0], [30.0, 5.0]], 40, axis=0)
    assert len(Mixture().fit(few).gaussians.means) <= 3
    assert not recwarn.list


def test_whitening_is_undone() -> None:
    rows = normal(100)
    whitening = Whitening.of(rows)
    white = whitening.forward(rows)
    assert np.allclose(np.cov(white, rowvar=False), np.eye(3))
    assert np.allclose(whitening.back(white), rows)
    assert whitening.log_jacobian == pytest.approx(
        -0.5 * np.log(np.linalg.det(np.cov(rows, rowvar=False)))
    )


@given(
    st.lists(st.integers(0, 6), min_size=2, max_size=60).filter(lambda groups: len(set(groups)) > 1)
)
def test_folds_test_every_row_once_and_divide_no_group(groups: list[int]) -> None:
    labels = np.array(groups)
    parts = list(folds(labels))
    assert np.array_equal(
        np.sort(np.concatenate([tested for _, tested in parts])), np.arange(len(labels))
    )
    for rows, tested in parts:
        assert len(rows) and len(tested)
        assert not set(labels[rows].tolist()) & set(labels[tested].tolist())


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (np.ones((9, 2)), "parameter 1 is the same"),
        (np.arange(20.0).reshape(10, 2), "follows exactly"),
        (np.full((9, 2), np.nan), "not finite"),
        (np.zeros(9), "must be a table"),
        (np.eye(3), "too few"),
    ],
    ids=["constant", "dependent", "nan", "flat", "few"],
)
@pytest.mark.parametrize("make", [KDE, Gaussian, Mixture, NormalizingFlow])
def test_samples_that_hold_no_density_are_refused(
    make: type[Density], rows: FloatArray, words: str
) -> None:
    with pytest.raises(UsageError, match=words):
        make().fit(rows)


def test_every_model_is_found() -> None:
    assert next(iter(models())) == "kde"
    assert {KDE, Independent, Gaussian, Mixture, NormalizingFlow} <= {
        type(model(name)) for name in models()
    }


def test_other_mistakes_are_refused() -> None:
    with pytest.raises(UsageError, match="as many recordings"):
        KDE().fit(normal(20), recordings(19))
    with pytest.raises(UsageError, match="all that is recorded is of one recording"):
        KDE().fit(normal(20), np.zeros(20))
    with pytest.raises(UsageError, match="there is no density 'spline'; densities: kde"):
        model("spline")


def test_a_model_of_the_same_rows_is_worked_out_once(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []
    learn = KDE._learn
    monkeypatch.setattr(
        KDE,
        "_learn",
        lambda self, theta, groups: made.append(len(theta)) or learn(self, theta, groups),
    )
    theta, of = normal(90, seed=11), recordings(90)
    first, outside = fitted("kde", theta, of), held_out("kde", theta, of)
    assert len(made) == 1 + 5
    assert (
        fitted("kde", theta.copy(), of.astype(object)) is first
        and held_out("kde", theta.copy(), of) is outside
    )
    assert len(made) == 6 and max(made[1:]) < made[0] == 90
    assert np.array_equal(first.log_density(theta), KDE().fit(theta, of).log_density(theta))
    for changed in ((theta + 1e-12, of), (theta, recordings(90, 9)), (theta[:89], of[:89])):
        assert fitted("kde", *changed) is not first and held_out("kde", *changed) is not outside
    assert fitted("gaussian", theta, of) is not first
    with pytest.raises(ValueError, match="read-only"):
        outside[0] = 0.0


@pytest.mark.parametrize("name", ["mixture", "student"])
def test_a_fitted_mixture_is_read_from_the_cache_to_the_bit_and_fitted_where_that_is_damaged(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XOSC_CACHE_DIR", str(tmp_path))
    theta, of, made = normal(90, seed=12), recordings(90), list[int]()
    learn = Mixture._learn
    monkeypatch.setattr(
        Mixture,
        "_learn",
        lambda self, rows, groups: made.append(len(rows)) or learn(self, rows, groups),
    )

    def anew() -> tuple[list[float], list[float], list[float]]:
        for each in (fitted, held_out, others):
            each.cache_clear()
        whole = fitted(name, theta, of)
        drawn = whole.sample(5, np.random.default_rng(0))
        return (
            whole.log_density(theta).tolist(),
            held_out(name, theta, of).tolist(),
            drawn.ravel().tolist(),
        )

    first, fits = anew(), len(made)
    assert fits >= 6 and anew() == first and len(made) == fits
    for file in (tmp_path / "densities").iterdir():
        file.write_bytes(file.read_bytes()[:100])
    assert anew() == first and len(made) == 2 * fits


@pytest.mark.parametrize("name", ["mixture", "student"])
def test_parts_have_as_many_components_as_the_whole_or_as_their_rows_suffice_for(name: str) -> None:
    generator = np.random.default_rng(0)
    rows = np.concatenate(
        [generator.normal(centre, 0.5, (100, 2)) for centre in ((-5, 0), (5, -5), (5, 5))]
    )
    whole = fitted(name, rows, recordings(300))
    for part, tested in others(name, rows, recordings(300)):
        assert part.gaussians is not None and whole.gaussians is not None
        assert len(part.gaussians.means) == len(whole.gaussians.means)
        assert part.log_density(rows[tested]).mean() == pytest.approx(
            whole.log_density(rows[tested]).mean(), abs=0.2
        )
    few = rows[::60]
    again = whole.again(len(few)).fit(few, recordings(len(few)))
    assert again.gaussians is not None and np.isfinite(again.log_density(few)).all()
    assert len(again.gaussians.means) < len(whole.gaussians.means)


def test_rows_not_seen_lie_no_further_out_than_draws_where_tails_are_heavy() -> None:
    generator = np.random.default_rng(4)
    rows = generator.standard_normal((1800, 4)) / np.sqrt(generator.chisquare(5, (1800, 1)) / 5)
    beyond, likelihood = {}, {}
    for name in ("student", "gaussian"):
        found = model(name).fit(rows[:300], recordings(300))
        likelihood[name] = found.log_density(rows[300:]).mean()
        limit = np.quantile(found.log_density(found.sample(20_000, generator)), 0.01)
        beyond[name] = (found.log_density(rows[300:]) < limit).mean()
    assert beyond["student"] <= 0.015 < 0.02 < beyond["gaussian"]
    assert likelihood["student"] > likelihood["gaussian"] + 0.05


def test_a_students_t_of_any_freedom_is_a_density() -> None:
    rows = normal(200)
    found = Student(6.0, exceeded=True).fit(rows)
    assert found.gaussians is not None
    assert np.exp(found.gaussians.log_weights).sum() == pytest.approx(1.0)
    spread = found.sample(40_000, np.random.default_rng(0)).std(axis=0)
    assert (spread > np.sqrt(np.diag(COVARIANCE))).all(), (
        "where rows are few, it is wider than the Gaussian"
    )


def test_pairs_are_judged_by_heavier_tails_where_nothing_else_is_asked_for() -> None:
    assert (judge(JUDGE, False), judge(JUDGE, True), judge("kde", True)) == (
        JUDGE,
        "student",
        "kde",
    )
