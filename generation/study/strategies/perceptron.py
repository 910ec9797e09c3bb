"""The small networks of the agents that MCSG is compared with."""

from __future__ import annotations

from torch import nn

HIDDEN = 64


def perceptron(inputs: int, outputs: int) -> nn.Sequential:
    """Two hidden layers: (n, inputs) to (n, outputs)."""
    return nn.Sequential(nn.Linear(inputs, HIDDEN), nn.Tanh(), nn.Linear(HIDDEN, HIDDEN), nn.Tanh(), nn.Linear(HIDDEN, outputs))
