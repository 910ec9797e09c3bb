"""Normalizing flow: affine couplings."""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from generation.space.density.base import Density, Whitening, folds
from recognition.trfe.training.windows import seeded
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import UsageError

DENSITIES = {"flow": {"class": "NormalizingFlow", "title": "normalizing flow (RealNVP)"}}


@dataclass(frozen=True)
class Couplings:
    """Size and training of a flow: Adam with weight decay on whole batches, stopped where a
    held-out fold is best.

    Attributes:
        layers, hidden: couplings, and units of their networks.
        epochs, patience: most passes, and passes without a better fold before the end.
        batch, rate, decay: of Adam.
    """

    layers: int = 6
    hidden: int = 48
    epochs: int = 300
    patience: int = 30
    batch: int = 256
    rate: float = 2e-3
    decay: float = 1e-4


class NormalizingFlow(Density):
    """Real-valued non-volume-preserving transformation of whitened samples to a standard normal.

    L. Dinh, J. Sohl-Dickstein, S. Bengio, Density estimation using Real NVP, ICLR 2017.

    Args:
        couplings: size and training.
        seed: of weights and batches.
    """

    def __init__(self, couplings: Couplings = Couplings(), seed: int = 0) -> None:
        self.couplings, self.seed = couplings, seed

    def _learn(self, theta: FloatArray, groups: IntArray) -> None:
        if theta.shape[1] < 2:
            raise UsageError("a flow of couplings needs two parameters at least")
        self._whitening = Whitening.of(theta)
        # Whitened first: couplings of tanh-bounded scales start near the standard normal that they
        # map to.
        white = torch.from_numpy(self._whitening.forward(theta))
        # Held out by recording: units of one recording are alike, so rows held out at random would
        # not show overfitting.
        fitted, held = next(folds(groups))
        with seeded(self.seed):
            self._network = _RealNVP(theta.shape[1], self.couplings).double()
            _train(self._network, white[fitted], white[held], self.couplings)

    def log_density(self, theta: FloatArray) -> FloatArray:
        """log p of rows (n, d): (n,)."""
        with torch.no_grad():
            density: FloatArray = self._network.log_density(
                torch.from_numpy(self._whitening.forward(theta))
            ).numpy()
        return density + self._whitening.log_jacobian

    def sample(self, n: int, generator: np.random.Generator) -> FloatArray:
        """Draws (n, d)."""
        noise = torch.from_numpy(generator.standard_normal((n, len(self._whitening.mean))))
        with torch.no_grad():
            return self._whitening.back(self._network.back(noise).numpy())


class _RealNVP(nn.Module):
    """Couplings that change odd and even parameters in turn, each by a scale and a shift that the
    others determine."""

    def __init__(self, d: int, size: Couplings) -> None:
        super().__init__()
        even = torch.arange(d) % 2 == 0
        self.kept = [even if layer % 2 else ~even for layer in range(size.layers)]
        self.networks = nn.ModuleList(
            _network(int(kept.sum()), int((~kept).sum()), size.hidden) for kept in self.kept
        )

    def log_density(self, white: Tensor) -> Tensor:
        """log p of z (n, d): (n,)."""
        total = white.new_zeros(len(white))
        for kept, scale, shift in self._changes(white := white.clone()):
            white[:, ~kept] = white[:, ~kept] * scale.exp() + shift
            # Couplings are triangular: the logarithm of the Jacobian is the sum of the scales.
            total = total + scale.sum(dim=1)
        return total - 0.5 * white.square().sum(dim=1) - 0.5 * white.shape[1] * np.log(2.0 * np.pi)

    def back(self, noise: Tensor) -> Tensor:
        """z (n, d) of points (n, d) of the standard normal."""
        white = noise.clone()
        for kept, scale, shift in self._changes(white, reverse=True):
            white[:, ~kept] = (white[:, ~kept] - shift) * (-scale).exp()
        return white

    def _changes(
        self, white: Tensor, reverse: bool = False
    ) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
        layers = list(zip(self.kept, self.networks, strict=True))
        for kept, network in reversed(layers) if reverse else layers:
            scale, shift = network(white[:, kept]).chunk(2, dim=1)
            # Scales between 1/e and e: one outlier can't blow up the volume while the flow is
            # trained.
            yield kept, torch.tanh(scale), shift


def _network(inputs: int, outputs: int, hidden: int) -> nn.Sequential:
    # Zeros: the untrained flow is the identity.
    last = nn.Linear(hidden, 2 * outputs)
    nn.init.zeros_(last.weight)
    nn.init.zeros_(last.bias)
    return nn.Sequential(
        nn.Linear(inputs, hidden), nn.Tanh(), nn.Linear(hidden, hidden), nn.Tanh(), last
    )


def _train(network: _RealNVP, fitted: Tensor, held: Tensor, size: Couplings) -> None:
    optimiser = torch.optim.Adam(network.parameters(), lr=size.rate, weight_decay=size.decay)
    best, weights, since = -np.inf, deepcopy(network.state_dict()), 0
    for _ in range(size.epochs):
        for batch in torch.randperm(len(fitted)).split(size.batch):
            optimiser.zero_grad()
            (-network.log_density(fitted[batch]).mean()).backward()
            nn.utils.clip_grad_norm_(network.parameters(), 5.0)
            optimiser.step()
        with torch.no_grad():
            reached = float(network.log_density(held).mean())
        since += 1
        if reached > best:
            best, weights, since = reached, deepcopy(network.state_dict()), 0
        if since >= size.patience:
            break
    # The weights of the best epoch, not the last.
    network.load_state_dict(weights)
