"""Training of encoders: reproducible arithmetic, pretraining without labels,
fine-tuning with them.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from copy import deepcopy
from itertools import permutations
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor, nn

from recognition.trfe.encoder.config import Preset, TrainingSchedule
from recognition.trfe.encoder.model import Encoder, GridEncoder, TokenEncoder, augmented, untrained
from recognition.trfe.training.windows import View, Windows
from schemas.common.errors import UsageError

_THREADS = 2
"""Most threads. Sums over threads depend on how many there are, so it is the same on all machines
that have as many cores."""
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
    """Same seed, same weights, on one kind of machine: within, torch is seeded and its algorithms
    and threads are fixed."""
    # cuBLAS is deterministic with a fixed workspace only, and reads this before its first call.
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")
    threads, mode = torch.get_num_threads(), torch.get_deterministic_debug_mode()
    memory: Any = torch.utils.deterministic
    filled = memory.fill_uninitialized_memory
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        torch.set_num_threads(min(_THREADS, threads))
        torch.set_deterministic_debug_mode(
            "error"
        )  # use_deterministic_algorithms does the same, and imports a compiler for it
        memory.fill_uninitialized_memory = (
            False  # nothing reads it, and it costs a third of the speed
        )
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
    schedule: TrainingSchedule,
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
        # Batches of nearly equal size: a last one of a single window has no batch statistics.
        for chosen in torch.randperm(len(inputs)).tensor_split(steps // schedule.epochs):
            batch = torch.from_numpy(inputs[chosen.numpy()]).to(where, non_blocking=True)
            with mixed(where):
                value = loss(batch, chosen)
            # Backward runs outside of autocast, as torch asks for.
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
        # Not from 0, at which the first step would change nothing.
        return (done + 1e-3) / (_WARM_UP + 1e-3)
    return 0.5 * (1.0 + math.cos(math.pi * min((done - _WARM_UP) / (1.0 - _WARM_UP), 1.0)))


def _groups(model: nn.Module, decay: float) -> list[dict[str, Any]]:
    """Weight matrices decay; biases, norms and positions do not."""
    named = list(model.named_parameters())
    weights = [value for name, value in named if value.ndim > 1 and name.endswith("weight")]
    others = [value for name, value in named if not (value.ndim > 1 and name.endswith("weight"))]
    return [{"params": weights, "weight_decay": decay}, {"params": others, "weight_decay": 0.0}]


_HIDDEN = 0.4
"""Share of the ego's and the others' frames that are hidden."""
_SHIFTS = (-2, -1, 0, 1, 2)
"""By how many frames windows are shifted."""


class MaskedMotion(nn.Module):
    """Loss of masked motion: mean absolute error of the ego's features, predicted from the rest of
    the window.

    Source: masked autoencoding as in He et al., "Masked Autoencoders Are Scalable Vision Learners"
    (CVPR 2022), for trajectories Chen et al., "Traj-MAE" (ICCV 2023).
    """

    def __init__(self, encoder: TokenEncoder) -> None:
        super().__init__()
        _, self.frames, self.features = encoder.view.shape
        self.head = nn.Linear(encoder.architecture.dim, self.frames * self.features)

    def forward(self, encoder: TokenEncoder, values: Tensor) -> Tensor:
        """Loss of a batch."""
        seen = encoder.augmented(values)
        patch = encoder.architecture.patch
        hidden = torch.rand(values.shape[0], self.frames // patch, device=values.device) < _HIDDEN
        hidden = hidden.repeat_interleave(patch, dim=1)
        truth = values[:, 0].float()
        found = self.head(encoder(seen.masked_fill(hidden[:, None, :, None], torch.nan))).view_as(
            truth
        )
        # Hidden frames in which the ego was not there have no truth.
        asked = hidden[..., None] & ~truth.isnan()
        # Cut as the encoder cuts its inputs (FURTHEST). With nothing hidden the loss is 0, but has
        # gradients.
        return (
            F.l1_loss(found[asked], truth[asked].clamp(-5.0, 5.0))
            if asked.any()
            else found.sum() * 0.0
        )


class TimeShift(nn.Module):
    """Task: predict the number of frames by which a window was shifted; cross-entropy."""

    def __init__(self, encoder: TokenEncoder) -> None:
        super().__init__()
        self.head = nn.Linear(encoder.architecture.dim, len(_SHIFTS))

    def forward(self, encoder: TokenEncoder, values: Tensor) -> Tensor:
        """Loss of a batch."""
        truth = torch.randint(len(_SHIFTS), (len(values),), device=values.device)
        frame = torch.arange(values.shape[2], device=values.device)
        moved = (frame + torch.tensor(_SHIFTS, device=values.device)[truth][:, None]).clamp(
            0, values.shape[2] - 1
        )
        shifted = values.gather(2, moved[:, None, :, None].expand_as(values))
        return F.cross_entropy(self.head(encoder(encoder.augmented(shifted))), truth)


OBJECTIVES: dict[str, Callable[[TokenEncoder], nn.Module]] = {
    "masked": MaskedMotion,
    "shift": TimeShift,
}


_PROJECTED = 256
_OFF_DIAGONAL = 5e-3
"""Weight of the redundancy term, as in Barlow Twins."""


class FrameOrder(nn.Module):
    """Task: name the permutation of a window's frames, by cross-entropy over all of them (Misra et
    al., ECCV 2016)."""

    def __init__(self, encoder: GridEncoder) -> None:
        super().__init__()
        # Factorial in the frames: 24 classes for the four of a grid.
        self.orders = torch.tensor(list(permutations(range(encoder.view.frames))))
        self.head = nn.Linear(encoder.architecture.dim, len(self.orders))

    def forward(self, encoder: GridEncoder, grids: Tensor) -> Tensor:
        """Loss of a batch."""
        truth = torch.randint(len(self.orders), (len(grids),))
        order = self.orders[truth].to(grids.device)
        shuffled = augmented(grids)[torch.arange(len(grids), device=grids.device)[:, None], order]
        return F.cross_entropy(self.head(encoder(shuffled)), truth.to(grids.device))


class BarlowTwins(nn.Module):
    """Features of two views of a window agree, and are not redundant (Zbontar et al., ICML 2021).

    L = Σ_i (1 − C_ii)² + λ Σ_{i≠j} C_ij², divided by the number of features, with C the
    cross-correlation of both views.
    """

    def __init__(self, encoder: GridEncoder) -> None:
        super().__init__()
        dim = encoder.architecture.dim
        self.projector = nn.Sequential(
            nn.Linear(dim, _PROJECTED),
            nn.BatchNorm1d(_PROJECTED),
            nn.ReLU(),
            nn.Linear(_PROJECTED, _PROJECTED),
        )

    def forward(self, encoder: GridEncoder, grids: Tensor) -> Tensor:
        """Loss of a batch."""
        both = [self.projector(encoder(augmented(grids))).float() for _ in range(2)]
        one, other = ((view - view.mean(0)) / (view.std(0) + 1e-5) for view in both)
        correlation = one.T @ other / len(grids)
        same = torch.diagonal(correlation)
        redundant = (correlation**2).sum() - (same**2).sum()
        return (((1.0 - same) ** 2).sum() + _OFF_DIAGONAL * redundant) / len(same)


GRID_OBJECTIVES: dict[str, Callable[[GridEncoder], nn.Module]] = {
    "order": FrameOrder,
    "barlow": BarlowTwins,
}
"""Of encoders of grids; those of tokens have `recognition.trfe.encoder.training.OBJECTIVES`."""


def pretrain(
    windows: Windows,
    preset: Preset,
    view: View,
    seed: int,
    objectives: Collection[str] | None = None,
    progress: Progress | None = None,
) -> Encoder:
    """A new encoder, trained on windows without looking at their labels.

    Args:
        view: of the windows.
        objectives: some of those for the view, whose losses are added; by default all. None of them
            leaves the encoder as it was initialised.

    Raises:
        UsageError: there are too few windows, their shape is not the view's, or an objective is
            unknown.
    """
    with deterministic(seed):
        encoder = untrained(preset.architecture, view)
        chosen = [objective(encoder) for objective in _chosen(encoder, objectives)]
        if chosen:
            model = nn.ModuleList([encoder, *chosen]).to(device())
            train(
                model,
                windows.inputs,
                preset.pretraining,
                lambda inputs, _: torch.stack(
                    [objective(encoder, inputs) for objective in chosen]
                ).sum(),
                progress,
            )
    return encoder.eval()


def _chosen(encoder: Encoder, names: Collection[str] | None) -> list[Callable[[Any], nn.Module]]:
    """The objectives of these names for an encoder; all for none."""
    known: Mapping[str, Callable[[Any], nn.Module]] = (
        OBJECTIVES if isinstance(encoder, TokenEncoder) else GRID_OBJECTIVES
    )
    unknown = set(names or ()) - set(known)
    if unknown:
        raise UsageError(
            f"there is no objective {sorted(unknown)[0]!r}; objectives: {', '.join(known)}"
        )
    return [objective for name, objective in known.items() if names is None or name in names]


_SMOOTHING = 0.05


def finetune(
    encoder: Encoder,
    windows: Windows,
    schedule: TrainingSchedule,
    seed: int,
    progress: Progress | None = None,
) -> Encoder:
    """A copy of the encoder, trained with a new head to tell the classes of the windows apart.

    Cross-entropy with label smoothing, over augmented windows; those of rare classes weigh more, by
    the root of how rare they are.

    Raises:
        UsageError: a window has no label, or there are too few.
    """
    if not len(windows) or (windows.labels <= 0).any():
        raise UsageError("fine-tuning needs windows that all have labels")
    classes, counts = np.unique(windows.labels, return_counts=True)
    truth = torch.from_numpy(np.searchsorted(classes, windows.labels))
    weights = torch.from_numpy(np.sqrt(counts.mean() / counts).astype(np.float32))
    with deterministic(seed):
        # The pretrained encoder stays: models have the features of both.
        tuned = deepcopy(encoder)
        tuned.set_classes(classes.tolist())
        where = device()
        tuned.to(where)
        truth, weights = truth.to(where), weights.to(where)

        def loss(inputs: torch.Tensor, chosen: torch.Tensor) -> torch.Tensor:
            logits = tuned.logits(tuned.augmented(inputs)).float()
            return F.cross_entropy(
                logits, truth[chosen.to(where)], weights, label_smoothing=_SMOOTHING
            )

        train(tuned, windows.inputs, schedule, loss, progress)
    return tuned
