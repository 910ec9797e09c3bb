"""Models on disk: what is written is read, and whatever else is there is refused in one line."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from recognition.trfe.config import Config, Steps
from recognition.trfe.discovery.candidates import Clustering
from recognition.trfe.encoder.config import Architecture
from recognition.trfe.encoder.model import GridEncoder
from recognition.trfe.forest import forest
from recognition.trfe.inputs.grids import Grid
from recognition.trfe.storage import load, save
from recognition.trfe.trfe import TRFE
from schemas.common.errors import InvalidFile, UsageError
from studies.recognition.strategies import average_linkage
from tests.recognition.clouds import clouds

FOREST = "forest.safetensors"
CONFIG = Config(trees=40, delta=0.03, clustering=Clustering(epochs=5, ramp=5))


@pytest.fixture(scope="module")
def model() -> TRFE:
    fitted = TRFE(CONFIG).fit(*clouds([1, 2, 3], 40, seed=0), *clouds([1, 2, 3], 30, seed=1))
    samples, _ = clouds([1, 2, 3, 9], 40, seed=2)
    fitted.observe(samples, np.arange(len(samples)))
    return fitted


@pytest.fixture
def folder(model: TRFE, tmp_path: Path) -> Path:
    save(model, tmp_path)
    return tmp_path


def test_a_model_is_read_as_it_was_written(tmp_path: Path) -> None:
    fitted = TRFE(CONFIG).fit(*clouds([1, 2, 3], 40, seed=0), *clouds([1, 2, 3], 30, seed=1))
    samples, _ = clouds([1, 2, 3, 9, 10, 11], 40, seed=2)
    fitted.observe(samples, np.arange(len(samples)))
    fitted.least = {1: 0.3, 3: 0.95}
    save(fitted, tmp_path)
    restored = load(tmp_path)
    assert restored.config == fitted.config
    assert restored.least == fitted.least
    assert restored.buffer.keys.tolist() == fitted.buffer.keys.tolist()
    for one, other in zip(fitted.recognise(samples), restored.recognise(samples), strict=True):
        assert np.array_equal(one, other)
    assert np.array_equal(fitted.discover().clusters, restored.discover().clusters)


@pytest.mark.parametrize("seeing", [True, False])
def test_features_of_changes_are_kept_though_samples_are_recognised_by_others(
    tmp_path: Path, seeing: bool
) -> None:
    fitted = TRFE(replace(CONFIG, changes=4, recognise_by_changes=seeing)).fit(
        *clouds([1, 2, 3], 40, seed=0), *clouds([1, 2, 3], 30, seed=1)
    )
    samples, _ = clouds([1, 2, 3, 9, 10, 11], 40, seed=2)
    fitted.observe(samples, np.arange(len(samples)))
    save(fitted, tmp_path)
    restored = load(tmp_path)
    assert restored.config == fitted.config and restored.buffer.inputs is not None
    assert np.array_equal(restored.buffer.inputs, fitted.buffer.inputs)
    assert np.array_equal(fitted.discover().clusters, restored.discover().clusters)


def test_the_same_model_is_the_same_bytes(model: TRFE, tmp_path: Path) -> None:
    for name in ("one", "two"):
        save(model, tmp_path / name)
    first, second = (
        (tmp_path / name / "model.safetensors").read_bytes() for name in ("one", "two")
    )
    assert first == second


def test_a_forest_that_has_not_changed_is_written_as_it_was_read(
    model: TRFE, folder: Path, tmp_path: Path
) -> None:
    read = load(folder)
    save(read, tmp_path / "again")
    assert (tmp_path / "again" / FOREST).read_bytes() == (folder / FOREST).read_bytes()
    samples, _ = clouds([1, 2, 3, 9], 40, seed=2)
    read.observe(samples, np.arange(len(samples)))
    read.expand(read.discover())
    save(read, tmp_path / "grown")
    assert (
        load(tmp_path / "grown").known.classes.tolist() == read.known.classes.tolist() != [1, 2, 3]
    )


def test_a_model_can_be_read_by_whom_the_umask_lets(model: TRFE, tmp_path: Path) -> None:
    before = os.umask(0o027)
    save(model, tmp_path)
    os.umask(before)
    assert {
        path.name: oct(path.stat().st_mode & 0o777) for path in tmp_path.iterdir()
    } == dict.fromkeys(("model.safetensors", FOREST), "0o640")


def test_samples_can_be_thinned(model: TRFE, tmp_path: Path) -> None:
    save(model, tmp_path, samples=5)
    thinned = load(tmp_path)
    assert [np.count_nonzero(thinned.known.fitted.labels == label) for label in (1, 2, 3)] == [
        5,
        5,
        5,
    ]
    samples, _ = clouds([1, 2, 3, 9], 40, seed=2)
    assert np.array_equal(thinned.recognise(samples).labels, model.recognise(samples).labels)
    kept, before = (
        one.known.fitted.features[one.known.fitted.labels == 1][:5] for one in (thinned, model)
    )
    assert (
        kept.dtype == np.float32
        and np.allclose(kept, before, rtol=1e-3)
        and not np.array_equal(kept, before)
    )


def test_a_model_with_encoders_for_other_features_is_refused(model: TRFE, tmp_path: Path) -> None:
    encoder = GridEncoder(Architecture(dim=8, depth=1, heads=2, patch=(4, 32, 20)), Grid())
    save(TRFE(CONFIG, (encoder,), model.known), tmp_path)
    with pytest.raises(InvalidFile, match=r"its encoders give 8 features, not \d+"):
        load(tmp_path)


def test_a_model_with_steps_of_a_study_is_not_written(model: TRFE, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="the method's own steps"):
        save(TRFE(CONFIG, known=model.known, steps=Steps(cluster=average_linkage)), tmp_path)
    assert not list(tmp_path.iterdir())


def test_an_unfitted_model_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="has not been fitted yet"):
        save(TRFE(), tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_can_t_be_written_is_named(model: TRFE, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="can't be written"):
        save(model, tmp_path / "file")


class Attack:
    """What pickle would run."""

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str]]:
        import os

        return os.system, ("touch attacked",)


def truncated(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def pickled(path: Path) -> None:
    import pickle

    path.write_bytes(pickle.dumps(Attack()))


def in_trees(change: Callable[[dict[str, Any]], Any]) -> Callable[[Path], None]:
    """A change of the arrays of a forest."""

    def spoil(path: Path) -> None:
        arrays = load_file(path)
        change(arrays)
        save_file(arrays, path)

    return spoil


def at(name: str, place: int, value: float) -> Callable[[Path], None]:
    """Another value in an array of a forest."""

    def change(arrays: dict[str, Any]) -> None:
        wide = np.int64 if name != "threshold" else np.float64
        arrays[name] = arrays[name].astype(wide)
        arrays[name][place] = value

    return in_trees(change)


def other_classes(path: Path) -> None:
    save_file(forest(*clouds([1, 2, 7], 20, seed=0), 10).arrays(), path)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (Path.unlink, "No such file"),
        (truncated, "this is no forest"),
        (lambda path: path.write_bytes(b""), "this is no forest"),
        (pickled, "this is no forest"),
        (in_trees(lambda arrays: arrays.pop("left")), "there is no 'left'|left"),
        (in_trees(lambda arrays: arrays.update(more=np.zeros(3))), "more"),
        (in_trees(lambda arrays: arrays.update(left=np.zeros(3))), "left of its trees is no list"),
        (
            in_trees(lambda arrays: arrays.update(feature=arrays["feature"][:-1])),
            "its trees are broken",
        ),
        (at("starts", 1, 0), "its trees are broken"),
        (at("classes", 0, 5), "its trees are broken"),
        (at("left", 0, 10**6), "one of its trees is broken"),
        (at("left", 0, 0), "one of its trees is broken"),
        (at("right", 0, -1), "one of its trees is broken"),
        (at("feature", 0, 10**6), "one of its trees is broken"),
        (at("choice", -1, 9), "one of its trees is broken"),
        (at("threshold", 0, np.nan), "one of its trees is broken"),
        (in_trees(lambda arrays: arrays.update(width=np.array(10**12))), "do not fit together"),
    ],
)
def test_foreign_forests_are_refused(
    folder: Path, spoil: Callable[[Path], Any], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    spoil(folder / FOREST)
    with pytest.raises(InvalidFile, match=message) as caught:
        load(folder)
    assert "\n" not in str(caught.value)
    assert not (folder / "attacked").exists()


def test_a_forest_of_other_classes_is_refused(folder: Path) -> None:
    other_classes(folder / FOREST)
    with pytest.raises(InvalidFile, match="do not fit together: they are of different classes"):
        load(folder)


def rewritten(
    path: Path, change: Callable[[dict[str, Any], dict[str, Any], dict[str, Any]], None]
) -> None:
    """Write the model's file anew after a change of its arrays, its settings and
    what it says of itself.
    """
    with safe_open(path, "numpy") as file:
        metadata = file.metadata()
        arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    about = json.loads(metadata["about"])
    change(arrays, about["config"], about)
    save_file(arrays, path, {"about": json.dumps(about)})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda arrays, settings, about: about.update(format="another 1"),
            "its format is 'another 1'",
        ),
        (
            lambda arrays, settings, about: settings.update(trees="many"),
            "its setting trees can't be 'many'",
        ),
        (
            lambda arrays, settings, about: settings.update(trees=True),
            "its setting trees can't be True",
        ),
        (
            lambda arrays, settings, about: settings.update(delta="guess"),
            "its setting delta can't be 'guess'",
        ),
        (
            lambda arrays, settings, about: settings.pop("components"),
            "its settings are not those of Config",
        ),
        (
            lambda arrays, settings, about: settings["clustering"].update(extra=1),
            "its settings are not those of Clustering",
        ),
        (
            lambda arrays, settings, about: settings.update(promotion=3),
            "its settings are not those of Promotion",
        ),
        (lambda arrays, settings, about: arrays.pop("prototypes.radii"), "do not fit together"),
        (
            lambda arrays, settings, about: arrays.pop("screening.limits"),
            "do not fit together: there is no 'limits'",
        ),
        (
            lambda arrays, settings, about: arrays.update(
                {"least.classes": np.array([1]), "least.shares": np.array([1.2])}
            ),
            "do not fit together: least shares of votes are from 0 to 1",
        ),
        (
            lambda arrays, settings, about: arrays["fitted.features"].fill(np.nan),
            "fitted.features is not made of finite",
        ),
        (
            lambda arrays, settings, about: arrays.update(
                {"fitted.features": arrays["fitted.features"][:, 1:]}
            ),
            "they are of different dimensions",
        ),
        (
            lambda arrays, settings, about: arrays.update(
                {"screening.limits": arrays["screening.limits"][:0]}
            ),
            "do not fit together",
        ),
    ],
)
def test_models_that_do_not_fit_are_refused(
    folder: Path, change: Callable[..., Any], message: str
) -> None:
    rewritten(folder / "model.safetensors", change)
    with pytest.raises(InvalidFile, match=message) as caught:
        load(folder)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "spoil", [Path.unlink, truncated, lambda path: path.write_bytes(b""), pickled]
)
def test_truncated_and_missing_models_are_refused(
    folder: Path, spoil: Callable[[Path], Any]
) -> None:
    spoil(folder / "model.safetensors")
    with pytest.raises(InvalidFile, match="this is no model") as caught:
        load(folder)
    assert "\n" not in str(caught.value)
