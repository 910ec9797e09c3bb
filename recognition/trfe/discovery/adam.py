"""Adam, to the same bits as torch's, which imports torch's compiler when it is made: 1.5 s of each discovery."""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor

_MEAN, _SQUARE, _LEAST = 0.9, 0.999, 1e-8
"""β₁, β₂ and ε"""


class Adam:
    """D. Kingma, J. Ba, Adam: A Method for Stochastic Optimization, ICLR 2015, algorithm 1.

    Args:
        parameters: what is learnt; those without a gradient stay.
        rate: α.
    """

    def __init__(self, parameters: Iterable[Tensor], rate: float) -> None:
        self._learnt = [(each, torch.zeros_like(each), torch.zeros_like(each)) for each in parameters]
        self._rate, self._steps = rate, [0] * len(self._learnt)

    def step(self, loss: Tensor) -> None:
        """Go down the gradient of a loss."""
        for parameter, _, _ in self._learnt:
            parameter.grad = None
        loss.backward()
        with torch.no_grad():
            for number, (parameter, mean, square) in enumerate(self._learnt):
                if parameter.grad is not None:
                    self._steps[number] += 1
                    self._move(parameter, parameter.grad, mean, square, self._steps[number])

    def _move(self, parameter: Tensor, gradient: Tensor, mean: Tensor, square: Tensor, step: int) -> None:
        mean.lerp_(gradient, 1.0 - _MEAN)
        square.mul_(_SQUARE).addcmul_(gradient, gradient, value=1.0 - _SQUARE)
        spread = (square.sqrt() / (1.0 - _SQUARE**step) ** 0.5).add_(_LEAST)
        parameter.addcdiv_(mean, spread, value=-self._rate / (1.0 - _MEAN**step))
