"""Stored encoders in numpy: the features that torch gives, without torch, and
refusals of wrong files.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors import torch as torch_weights
from safetensors.numpy import load_file, save_file

from recognition.catalogue.pipeline import SHIPPED
from recognition.trfe.encoder.config import Architecture, TokenArchitecture
from recognition.trfe.encoder.inference import StoredEncoder
from recognition.trfe.encoder.model import untrained
from recognition.trfe.encoder.storage import load, save
from recognition.trfe.inputs.grids import Grid
from recognition.trfe.inputs.tokens import Tokens
from recognition.trfe.trfe import features_of
from schemas.common.errors import InvalidFile, UsageError

VIEW = Tokens(frames=8, others=3)


def encoder(classes: tuple[int, ...] = ()) -> Any:
    torch.manual_seed(5)
    return untrained(TokenArchitecture(dim=24, depth=2, patch=4, frame=12), VIEW, classes).eval()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    save(encoder((1, 3)), tmp_path)
    return tmp_path


def windows(count: int) -> np.ndarray:
    """Windows in which others and ends of tracks are missing."""
    random = np.random.default_rng(1)
    values = (3.0 * random.normal(size=(count, *VIEW.shape))).astype(np.float32)
    values[random.random((count, VIEW.shape[0])) < 0.3] = np.nan
    values[:, 0] = np.nan_to_num(values[:, 0], nan=0.5)
    values[: count // 2, 0, :3] = np.nan
    return values


def read(folder: Path) -> StoredEncoder:
    found = StoredEncoder.read(folder)
    assert found is not None
    return found


@pytest.mark.parametrize("classes", [(), (1, 3)])
def test_features_are_those_of_torch(classes: tuple[int, ...], tmp_path: Path) -> None:
    made = encoder(classes)
    save(made, tmp_path)
    seen = windows(70)
    with torch.inference_mode():
        expected = made(torch.from_numpy(seen)).numpy()
    found = read(tmp_path)
    assert found.classes == classes
    assert np.allclose(found.features(seen), expected, atol=1e-5)
    assert np.array_equal(found.features(seen)[:64], found.features(seen[:64]))
    assert features_of([found, found], seen).shape == (70, 48)


def test_an_encoder_is_written_as_it_was_read(folder: Path, tmp_path: Path) -> None:
    read(folder).save(tmp_path / "again")
    for name in ("encoder.json", "encoder.safetensors"):
        assert (tmp_path / "again" / name).read_bytes() == (folder / name).read_bytes()


def test_an_encoder_of_grids_is_left_to_torch(tmp_path: Path) -> None:
    save(untrained(Architecture(dim=8, depth=1, heads=2, patch=(4, 32, 20)), Grid()), tmp_path)
    assert StoredEncoder.read(tmp_path) is None


def test_windows_of_another_shape_are_refused(folder: Path) -> None:
    with pytest.raises(UsageError, match="reads windows of shape"):
        read(folder).features(windows(2)[:, 1:])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda weights: weights.pop("time"), "they lack time"),
        (lambda weights: weights.update(more=np.zeros(3)), "they have besides more"),
        (
            lambda weights: weights.update(kind=np.zeros((3, 1, 24))),
            r"kind is of shape \(3, 1, 24\)",
        ),
        (lambda weights: weights["kind"].fill(np.inf), "kind are not finite numbers"),
        (lambda weights: weights.update(kind=np.zeros((2, 1, 24), int)), "kind are not finite"),
    ],
)
def test_weights_that_do_not_fit_are_named(
    folder: Path, change: Callable[[dict[str, Any]], Any], message: str
) -> None:
    weights = load_file(folder / "encoder.safetensors")
    change(weights)
    save_file(weights, folder / "encoder.safetensors")
    with pytest.raises(InvalidFile, match=message):
        read(folder)


@pytest.mark.parametrize("kind", [torch.bfloat16, torch.float8_e4m3fn])
@pytest.mark.parametrize("reader", [read, load])
def test_numbers_that_numpy_does_not_have_are_no_weights(
    folder: Path, kind: torch.dtype, reader: Callable[[Path], object]
) -> None:
    weights = torch_weights.load_file(folder / "encoder.safetensors")
    weights["time"] = weights["time"].to(kind)
    torch_weights.save_file(weights, folder / "encoder.safetensors")
    with pytest.raises(InvalidFile, match=r"these are no weights: .*float"):
        reader(folder)


@pytest.mark.parametrize(
    ("part", "values", "message"),
    [
        ("architecture", {"depth": 10**9}, "too few for its 1000000000 blocks"),
        ("architecture", {"dim": 48}, "is of shape"),
        ("architecture", {"patch": 3}, "tokens of 3 frames do not fit"),
        ("architecture", {"wings": 2}, "unexpected keyword argument 'wings'"),
        ("view", {"frames": 16}, "time is of shape"),
    ],
)
def test_descriptions_of_other_encoders_are_refused(
    folder: Path, part: str, values: dict[str, Any], message: str
) -> None:
    path = folder / "encoder.json"
    described = json.loads(path.read_text())
    described[part] |= values
    path.write_text(json.dumps(described))
    with pytest.raises(InvalidFile, match=message):
        read(folder)


def test_the_shipped_model_recognises_without_torch_and_scikit_learn() -> None:
    program = f"""
import sys
from pathlib import Path
import numpy as np
from recognition.catalogue.model import load
model = load(Path({str(SHIPPED)!r}))._model
print(model.recognise(np.zeros((2, *model.encoders[0].view.shape), np.float32)).labels)
print(sorted({{"torch", "sklearn", "skops", "pandas"}} & set(sys.modules)))
"""
    said = subprocess.run(
        [sys.executable, "-c", program], check=True, capture_output=True, text=True
    ).stdout.splitlines()
    assert said[1] == "[]", said
