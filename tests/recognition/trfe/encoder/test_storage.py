"""Files of encoders that don't fit each other, or are something else: each is
refused in one line that says what is wrong.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from safetensors.torch import load_file, save_file

from recognition.trfe.encoder.config import Architecture
from recognition.trfe.encoder.model import untrained
from recognition.trfe.encoder.storage import load, save
from recognition.trfe.inputs.grids import Grid
from schemas.common.errors import InvalidFile

Weights = dict[str, torch.Tensor]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The files of an encoder with 2 blocks and 22 tensors of weights."""
    save(
        untrained(Architecture(dim=8, depth=2, heads=2, patch=(4, 32, 20)), Grid(), [1, 3]),
        tmp_path,
    )
    return tmp_path


def refusal(folder: Path) -> str:
    with pytest.raises(InvalidFile) as caught:
        load(folder)
    text = str(caught.value)
    assert text.startswith(f"{folder}/encoder.") and "\n" not in text and not text.endswith(":")
    return text


def test_an_encoder_is_read_back(folder: Path) -> None:
    assert load(folder).classes == (1, 3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda weights: weights.pop("place"), "they lack place"),
        (
            lambda weights: [weights.pop(name) for name in ("place", "time", "head.bias")],
            "they lack head.bias and 2 more",
        ),
        (lambda weights: weights.update(more=torch.zeros(3)), "they have besides more"),
        (
            lambda weights: weights.update(place=torch.zeros(3, 8)),
            r"place is of shape \(3, 8\), not \(10, 8\)",
        ),
        (
            lambda weights: weights.update(place=weights["place"] * torch.inf),
            "the weights place are not finite numbers",
        ),
        (
            lambda weights: weights.update(place=weights["place"].to(torch.int64)),
            "the weights place are not finite numbers",
        ),
        (
            lambda weights: weights.clear(),
            "the 0 tensors of encoder.safetensors are too few for its 2 blocks",
        ),
    ],
)
def test_weights_that_do_not_fit_are_named(
    folder: Path, change: Callable[[Weights], Any], message: str
) -> None:
    path = folder / "encoder.safetensors"
    weights = {name: value.clone() for name, value in load_file(path).items()}
    change(weights)
    save_file(weights, path)
    with pytest.raises(InvalidFile, match=message):
        load(folder)
    refusal(folder)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.3, 0.99])
@pytest.mark.parametrize(
    ("name", "message"),
    [("encoder.safetensors", "these are no weights: "), ("encoder.json", "JSON")],
)
def test_truncated_files_are_refused(folder: Path, name: str, message: str, share: float) -> None:
    content = (folder / name).read_bytes()
    (folder / name).write_bytes(content[: int(share * len(content))])
    assert message in refusal(folder)


@pytest.mark.parametrize(
    ("part", "values", "message"),
    [
        ("architecture", {"dim": 16}, "is of shape"),
        ("architecture", {"dim": 8 * 10**6}, "is of shape"),
        ("architecture", {"dim": 8 * 10**18}, "overflow"),
        ("architecture", {"depth": 10**9}, "too few for its 1000000000 blocks"),
        ("architecture", {"dim": "8"}, "not supported between"),
        ("architecture", {"patch": [3, 32, 20]}, "patches of 3 frames do not fit windows of 4"),
        ("architecture", {"wings": 2}, "unexpected keyword argument 'wings'"),
        ("view", {"length": 1e12}, "place is of shape"),
        ("view", {"length": 1e308, "cell_length": 1e-10}, "cannot convert float infinity"),
    ],
)
def test_descriptions_of_other_encoders_are_refused_before_they_take_memory(
    folder: Path, part: str, values: dict[str, Any], message: str
) -> None:
    path = folder / "encoder.json"
    described = json.loads(path.read_text())
    described[part] |= values
    path.write_text(json.dumps(described))
    assert message in refusal(folder)


@pytest.mark.parametrize("missing", ["format", "view", "reads", "classes"])
def test_what_a_description_lacks_is_named(folder: Path, missing: str) -> None:
    path = folder / "encoder.json"
    described = json.loads(path.read_text())
    del described[missing]
    path.write_text(json.dumps(described))
    assert refusal(folder).endswith(f"this describes no encoder: there is no '{missing}'")
