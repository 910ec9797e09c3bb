"""Open-set methods whose heads train the encoder too, beside those whose heads read frozen
features."""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import torch
from torch import Tensor, nn

from recognition.trfe.encoder.config import TrainingSchedule
from recognition.trfe.encoder.model import Encoder
from recognition.trfe.encoder.training import deterministic, train
from recognition.trfe.inputs.samples import Features
from studies.recognition.baselines.open_set.heads import HeadMethod


class Whole(nn.Module):
    """A head, and an encoder that makes what the head reads.

    Args:
        encoder: a copy of it is trained.
        head: reads (n, numbers + dim).
        numbers: how many columns of samples, the first ones, the head reads as they are; those that
            follow are inputs of the encoder, flattened.
    """

    def __init__(self, encoder: Encoder, head: nn.Module, numbers: int) -> None:
        super().__init__()
        self.encoder, self.head, self.numbers = deepcopy(encoder), head, numbers

    def forward(self, samples: Tensor) -> Tensor:
        """Return the head's inputs for samples; in training, for augmented windows."""
        inputs = samples[:, self.numbers :].unflatten(1, self.encoder.view.shape)
        encoded = self.encoder(self.encoder.augmented(inputs) if self.training else inputs)
        return torch.cat([samples[:, : self.numbers], encoded], dim=1).float()


class EndToEnd(HeadMethod):
    """A method that is a trained head, whose loss trains the encoder as well, after the head alone.

    Source of the order: Kumar et al., Fine-Tuning can Distort Pretrained Features, ICLR 2022.

    Samples are numbers and flattened inputs of windows, see
    `studies.recognition.protocol.trials.Trial.beside_inputs`; only the numbers are standardised.

    Args:
        method: has the head, its loss and its rejection.
        encoder: where the encoder begins.
        numbers: how many columns of samples are numbers.
        schedule: of the training.
    """

    network: Whole

    def __init__(
        self, method: HeadMethod, encoder: Encoder, numbers: int, schedule: TrainingSchedule
    ) -> None:
        super().__init__(method.seed)
        self.method, self.encoder, self.numbers, self.schedule = method, encoder, numbers, schedule

    def _network(self, inputs: int, classes: int) -> nn.Module:
        head = self.method._network(self.numbers + self.encoder.architecture.dim, classes)
        return Whole(self.encoder, head, self.numbers)

    def _loss(self, network: nn.Module, features: Tensor, indices: Tensor) -> Tensor:
        assert isinstance(network, Whole)
        read = network(features)
        with torch.autocast(
            read.device.type, enabled=False
        ):  # distances in a head need more digits than an encoder
            return self.method._loss(network.head, read, indices)

    def _optimise(self, inputs: Tensor, targets: Tensor) -> None:
        self.network.eval()
        with torch.no_grad():
            read = self.network(inputs)
        self.method.network = self.network.head
        self.method._optimise(read, targets)
        with deterministic(self.seed):
            train(
                self.network,
                inputs.numpy(),
                self.schedule,
                lambda batch, rows: self._loss(self.network, batch, targets[rows]),
            )

    def _finish(self, features: Tensor, indices: Tensor) -> None:
        self.method._finish(self.network(features), indices)

    def _measure(self, features: Tensor) -> tuple[Tensor, Tensor]:
        return self.method._measure(self.network(features))

    def _standardise(self, features: Features) -> Tensor:
        numbers, inputs = np.split(features, [self.numbers], axis=1)
        scaled = (numbers - self._mean[: self.numbers]) / self._deviation[: self.numbers]
        return torch.from_numpy(np.concatenate([scaled, inputs], axis=1).astype(np.float32))
