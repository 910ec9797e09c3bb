"""Heads that train the encoder too, on windows whose classes only the inputs of
the encoder tell.
"""

from __future__ import annotations

import numpy as np
import pytest
import torch

from recognition.trfe.encoder.config import TokenArchitecture, TrainingSchedule
from recognition.trfe.encoder.model import TokenEncoder
from recognition.trfe.inputs.samples import Features
from recognition.trfe.inputs.tokens import Tokens
from schemas.common.array_types import IntArray
from studies.recognition.baselines.end_to_end import EndToEnd
from studies.recognition.baselines.open_set.arpl import ARPL
from studies.recognition.baselines.open_set.cac import CAC
from studies.recognition.baselines.open_set.heads import HeadMethod
from studies.recognition.baselines.open_set.mls import MLS

VIEW, NUMBERS = Tokens(others=1), 3


@pytest.fixture(scope="module")
def encoder() -> TokenEncoder:
    torch.manual_seed(0)
    return TokenEncoder(TokenArchitecture(dim=8, depth=1, heads=2, frame=8), VIEW)


def windows(seed: int) -> tuple[Features, IntArray]:
    """Samples of two classes, in which the ego's first value rises or falls;
    others are missing, numbers are of any size.
    """
    labels, random = np.tile([2, 7], 40), np.random.default_rng(seed)
    inputs = random.normal(0.0, 0.1, (len(labels), *VIEW.shape))
    inputs[:, 0, :, 0] += np.where(labels == 2, 1.0, -1.0)[:, None] * np.linspace(
        -1.0, 1.0, VIEW.frames
    )
    inputs[:, 1] = np.nan
    numbers = 1e4 * random.standard_normal((len(labels), NUMBERS))
    return np.concatenate([numbers, inputs.reshape(len(labels), -1)], axis=1).astype(
        np.float32
    ), labels


def fitted(method: HeadMethod, encoder: TokenEncoder, epochs: int = 15) -> EndToEnd:
    return EndToEnd(method, encoder, NUMBERS, TrainingSchedule(epochs, 16, 1e-2)).fit(
        *windows(1), *windows(2)
    )


@pytest.mark.parametrize("kind", [CAC, MLS, ARPL])
def test_the_encoder_learns_what_the_numbers_do_not_tell(
    kind: type[HeadMethod], encoder: TokenEncoder
) -> None:
    before = {name: value.clone() for name, value in encoder.state_dict().items()}
    model, (samples, labels) = fitted(kind(0), encoder), windows(3)
    assert np.mean(model.classify(samples) == labels) > 0.95
    assert np.mean(model.predict(windows(2)[0]) == 0) <= 0.055
    assert not torch.equal(model.network.encoder.embedding.weight, before["embedding.weight"])
    assert all(torch.equal(value, before[name]) for name, value in encoder.state_dict().items())


def test_same_seed_gives_the_same_scores(encoder: TokenEncoder) -> None:
    one, other = (fitted(CAC(4), encoder, epochs=1).score(windows(3)[0]) for _ in range(2))
    assert np.array_equal(one, other)
