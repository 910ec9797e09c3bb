"""What all trainings share: reproducible arithmetic, the device, and the loop over batches."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from recognition.encoder.config import Schedule
from schemas.errors import UsageError

_THREADS = 2
"""Most threads. Sums over threads depend on how many there are, so it is the same on all machines that have as many cores."""
_WARM_UP = 0.1
_GREATEST_NORM = 1.0
"""Gradients are cut to this norm."""
Progress = Callable[[int, float], None]
"""Called with the epoch, from 1, and its mean loss."""


def device() -> torch.device:
    """CUDA where it is present, the CPU otherwise."""
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


@contextmanager
def deterministic(seed: int) -> Iterator[None]:
    """Same seed, same weights, on one kind of machine: within, torch is seeded and its algorithms and threads are fixed."""
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
    threads, mode = torch.get_num_threads(), torch.get_deterministic_debug_mode()
    memory: Any = torch.utils.deterministic
    filled = memory.fill_uninitialized_memory
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        torch.set_num_threads(min(_THREADS, threads))
        torch.set_deterministic_debug_mode("error")  # use_deterministic_algorithms does the same, and imports a compiler for it
        memory.fill_uninitialized_memory = False  # nothing reads it, and it costs a third of the speed
        try:
            yield
        finally:
            memory.fill_uninitialized_memory = filled
            torch.set_deterministic_debug_mode(mode)
            torch.set_num_threads(threads)


def mixed(where: torch.device) -> torch.autocast:
    """Arithmetic in bfloat16 where the hardware has it, which doubles the speed."""
    fast = where.type == "cuda" or torch.cpu._is_avx512_bf16_supported()
    return torch.autocast(where.type, torch.bfloat16, enabled=fast)


def train(
    model: nn.Module,
    inputs: NDArray[Any],
    schedule: Schedule,
    loss: Callable[[Tensor, Tensor], Tensor],
    progress: Progress | None = None,
) -> None:
    """Train a model in place; call it within `deterministic`.

    Args:
        inputs: of all windows (n, ...).
        loss: of a batch: its inputs, on the model's device, and the numbers of its windows.

    Raises:
        UsageError: there are fewer than two windows.
    """
    if len(inputs) < 2:
        raise UsageError(f"training needs windows, and there are {len(inputs)}")
    where = next(model.parameters()).device
    steps = schedule.epochs * math.ceil(len(inputs) / schedule.batch)
    optimiser = torch.optim.AdamW(_groups(model, schedule.decay), schedule.rate)
    rates = torch.optim.lr_scheduler.LambdaLR(optimiser, lambda step: _share(step / steps))
    model.train()
    for epoch in range(schedule.epochs):
        total = 0.0
        for chosen in torch.randperm(len(inputs)).tensor_split(steps // schedule.epochs):
            batch = torch.from_numpy(inputs[chosen.numpy()]).to(where, non_blocking=True)
            with mixed(where):
                value = loss(batch, chosen)
            optimiser.zero_grad()
            value.backward()
            nn.utils.clip_grad_norm_(model.parameters(), _GREATEST_NORM)
            optimiser.step()
            rates.step()
            total += value.item() * len(chosen)
        if progress:
            progress(epoch + 1, total / len(inputs))
    model.eval()


def _share(done: float) -> float:
    """Share of the greatest learning rate after a share of all steps."""
    if done < _WARM_UP:
        return (done + 1e-3) / (_WARM_UP + 1e-3)
    return 0.5 * (1.0 + math.cos(math.pi * min((done - _WARM_UP) / (1.0 - _WARM_UP), 1.0)))


def _groups(model: nn.Module, decay: float) -> list[dict[str, Any]]:
    """Weight matrices decay; biases, norms and positions do not."""
    named = list(model.named_parameters())
    weights = [value for name, value in named if value.ndim > 1 and name.endswith("weight")]
    others = [value for name, value in named if not (value.ndim > 1 and name.endswith("weight"))]
    return [{"params": weights, "weight_decay": decay}, {"params": others, "weight_decay": 0.0}]
