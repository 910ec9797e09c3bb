"""Small networks on frozen features, trained the same way for every method that needs one."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from recognition.trfe.inputs.samples import Features
from recognition.trfe.training.windows import seeded
from schemas.common.array_types import FloatArray, IntArray
from studies.recognition.baselines.open_set.method import OpenSetMethod


class Training(NamedTuple):
    """Training of a head: Adam with weight decay, batches in an order of its own seed."""

    epochs: int = 60
    batch: int = 128
    rate: float = 3e-3
    decay: float = 1e-4
    hidden: int = 128


class Head(nn.Module):
    """Two-layer perceptron: features (n, `inputs`) → (n, `outputs`)."""

    def __init__(self, inputs: int, outputs: int, hidden: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(inputs, hidden), nn.ReLU(), nn.Linear(hidden, outputs)
        )

    def forward(self, features: Tensor) -> Tensor:
        """Apply it."""
        out: Tensor = self.layers(features)
        return out

    def before_last(self, features: Tensor) -> Tensor:
        """Inputs (n, `hidden`) of the last layer."""
        out: Tensor = self.layers[:-1](features)
        return out


class HeadMethod(OpenSetMethod):
    """An open-set method that is a trained head; subclasses say which network, which loss, and what
    its outputs mean.

    Features are standardised by the mean and deviation of the training samples.
    """

    training: ClassVar[Training] = Training()

    @abstractmethod
    def _network(self, inputs: int, classes: int) -> nn.Module:
        """The untrained network."""

    @abstractmethod
    def _loss(self, network: nn.Module, features: Tensor, indices: Tensor) -> Tensor:
        """Loss of a batch: features (b, d), class indices (b,)."""

    @abstractmethod
    def _measure(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Closeness to each class (n, K), whose greatest names the class, and outlyingness (n,)."""

    def _learn(self, features: Features, indices: IntArray) -> None:
        self._mean = features.mean(axis=0)
        self._deviation = features.std(axis=0) + 1e-6
        inputs, targets = self._standardise(features), torch.from_numpy(indices)
        with seeded(self.seed):
            self.network = self._network(features.shape[1], len(self.classes))
            self._optimise(inputs, targets)
        self.network.eval()
        with torch.no_grad():
            self._finish(inputs, targets)

    def _optimise(self, inputs: Tensor, targets: Tensor) -> None:
        recipe = self.training
        optimiser = torch.optim.Adam(
            self.network.parameters(), lr=recipe.rate, weight_decay=recipe.decay
        )
        for _ in range(recipe.epochs):
            for batch in torch.randperm(len(inputs)).split(recipe.batch):
                optimiser.zero_grad()
                self._loss(self.network, inputs[batch], targets[batch]).backward()
                optimiser.step()

    def _finish(self, features: Tensor, indices: Tensor) -> None:
        """Fit the remaining parts to the training samples once the network is trained."""

    def _standardise(self, features: Features) -> Tensor:
        return torch.from_numpy(((features - self._mean) / self._deviation).astype(np.float32))

    def _evaluate(self, features: Features) -> tuple[Features, FloatArray]:
        with torch.no_grad():
            closeness, outlyingness = self._measure(self._standardise(features))
        return closeness.numpy(), outlyingness.double().numpy()

    def _classify(self, features: Features) -> IntArray:
        return self._evaluate(features)[0].argmax(axis=1)

    def score(self, features: Features) -> FloatArray:
        """Outlyingness of each sample (n,); higher is less like the known classes."""
        return self._evaluate(features)[1]
