"""Online clustering (OC): a known-class head and a novel head learn together which unknown samples
belong together.

q is the softmax over the K known classes, p over Q candidates for new ones; a prime marks the
augmented view of a sample. L = L_ce + L_clu + ω(e) L_con with L_ce: cross entropy of q on labelled
samples of known classes; L_clu = −mean[w_ij log G_ij + (1 − w_ij) log(1 − G_ij)], G_ij = p_i ·
p'_j, over pairs of unknown samples; L_con = MSE(q, q') + MSE(p, p'); ω(e) = λ exp(−5 (1 − min(e /
E_r, 1))²). The targets w_ij come from the similarity S of the samples: 1 from its 85th percentile
on, 0 up to its median, and no part in the mean between. Source: joint losses as in Han et al.,
"Automatically Discovering and Learning New Visual Categories with Ranking Statistics" (ICLR 2020),
with the random-forest similarity in place of ranking statistics."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from sklearn.cluster import KMeans
from torch import Tensor, nn
from torch.nn import functional

from recognition.trfe.discovery.candidates import Clustering
from recognition.trfe.encoder.training import deterministic
from recognition.trfe.inputs.samples import Features
from schemas.common.array_types import FloatArray, IntArray
from schemas.common.errors import UsageError

Augment = Callable[[Tensor], Tensor]
_LEAST = 1e-6
"""G is kept this far from 0 and 1, where its logarithm ends."""


class Clusters(NamedTuple):
    """Result of a round.

    Args:
        assignment: candidate (n,) with the greatest p for each unknown sample.
        confidence: that p (n,).
        losses: L_ce, L_clu, L_con (epochs, 3), means over each epoch.
    """

    assignment: IntArray
    confidence: FloatArray
    losses: FloatArray


class Pairs(NamedTuple):
    """Targets w_ij of pairs of unknown samples, and how much each pair counts, 0
    or 1; both (n, n).
    """

    targets: Tensor
    counts: Tensor


PairsOf = Callable[[Callable[[], Features]], Pairs]
"""Called at the beginning of each epoch with a function that gives the backbone's features (n, d)
of the unknown samples."""
NovelHead = Callable[[Features, int], nn.Linear]
"""Makes the novel head from the backbone's features (n, d) of the unknown samples and a seed; it
draws from torch's generator."""


class _Data(NamedTuple):
    """Unknown samples with their pairs, labelled samples with the columns of their classes."""

    samples: Tensor
    pairs: Pairs
    anchors: Tensor
    truth: Tensor


def consistency_weight(epoch: int, config: Clustering) -> float:
    """ω(e), for epochs that count from 0."""
    return config.consistency * math.exp(-5.0 * (1.0 - min(epoch / config.ramp, 1.0)) ** 2)


def three_way_pairs(similarity: NDArray[np.float32], config: Clustering) -> Pairs:
    """Masks of pairs that are alike and of pairs that differ by S (n, n), with the quantiles of the
    settings."""
    low, high = np.quantile(
        # Without the diagonal, on which S is 1.
        similarity[np.triu_indices(len(similarity), 1)],
        [config.negative, config.positive],
    )
    # Pairs between both quantiles are left out: their similarity says nothing either way.
    alike = similarity >= high
    return Pairs(
        torch.from_numpy(alike).float(), torch.from_numpy(alike | (similarity <= low)).float()
    )


def clustering_loss(p: Tensor, p_augmented: Tensor, pairs: Pairs) -> Tensor:
    """L_clu of p (n, Q) and p' (n, Q)."""
    # Probability that both are of one cluster; clamped, as a logarithm of 0 ends the training.
    alike = (p @ p_augmented.T).clamp(_LEAST, 1.0 - _LEAST)
    terms = pairs.targets * alike.log() + (1.0 - pairs.targets) * (1.0 - alike).log()
    return -(terms * pairs.counts).sum() / pairs.counts.sum().clamp(min=1.0)


class Heads(nn.Module):
    """A backbone (inputs -> features (n, d)) with the known-class head q and the novel head p."""

    def __init__(self, backbone: nn.Module, known: nn.Linear, novel: nn.Linear) -> None:
        super().__init__()
        self.backbone, self.known, self.novel = backbone, known, novel

    def forward(self, inputs: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (n, K) of q and (n, Q) of p."""
        features = self.backbone(inputs)
        return self.known(features), self.novel(features)


class Projection(nn.Module):
    """Trainable correction of frozen features (n, d), at first the identity: clustering learns it
    where the encoder is frozen."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.inner, self.outer = nn.Linear(width, width), nn.Linear(width, width)
        # Begins as the identity, so that the first pairs are those of the encoder.
        nn.init.zeros_(self.outer.weight)
        nn.init.zeros_(self.outer.bias)

    def forward(self, features: Tensor) -> Tensor:
        """Features (n, d) plus the learnt residual."""
        return features + self.outer(functional.gelu(self.inner(features)))


def jitter(features: Tensor, strength: float = 0.3) -> Tensor:
    """Augmented view of standardised features: normal noise of this standard deviation."""
    return features + strength * torch.randn_like(features)


def cluster(
    backbone: nn.Module,
    unknown: NDArray[Any],
    known: NDArray[Any],
    labels: IntArray,
    pairs: PairsOf,
    novel: NovelHead,
    config: Clustering = Clustering(),  # noqa: B008 - immutable
    seed: int = 0,
    augment: Augment = jitter,
) -> Clusters:
    """Cluster unknown samples (n, …) with the help of labelled known ones (m, …), in the supervised
    checkpoint `backbone`.

    Args:
        backbone: maps samples to features; it is trained on, from the state it is given in.
        unknown, known: samples as the backbone takes them.
        labels: of the known samples (m,).
        pairs: which pairs of unknown samples are alike, in each epoch.
        novel: makes the novel head.
        config: how to train.
        seed: of all that is drawn.
        augment: makes the other view of a sample.

    Raises:
        UsageError: fewer than two unknown samples, or no known ones.
    """
    if len(unknown) < 2 or not len(known):
        raise UsageError(
            f"{len(unknown)} unknown and {len(known)} known samples are too few to cluster"
        )
    samples, anchors = (
        torch.from_numpy(np.ascontiguousarray(unknown)),
        torch.from_numpy(np.ascontiguousarray(known)),
    )
    truth = torch.from_numpy(np.unique(labels, return_inverse=True)[1])
    losses = np.zeros((config.epochs, 3))
    with deterministic(seed):
        # `deterministic` restores the caller's number.
        torch.set_num_threads(config.threads)
        heads = _heads(backbone, samples, anchors, truth, novel, config, seed)
        optimiser = torch.optim.Adam(heads.parameters(), lr=config.rate)
        for epoch in range(config.epochs):
            # Anew in each epoch: features move, and pairs that were alike may part.
            alike = pairs(lambda: _batched(backbone, samples, config.batch).numpy())
            losses[epoch] = _epoch(
                heads, optimiser, _Data(samples, alike, anchors, truth), epoch, config, augment
            )
        confidence, assignment = (
            _batched(lambda some: heads(some)[1], samples, config.batch).softmax(dim=1).max(dim=1)
        )
    return Clusters(assignment.numpy(), confidence.double().numpy(), losses)


def random_head(features: Features, candidates: int) -> nn.Linear:
    """Untrained novel head for a number of candidates; superfluous ones die out."""
    return nn.Linear(features.shape[1], candidates)


def k_means_head(features: Features, candidates: int, seed: int) -> nn.Linear:
    """Novel head that starts as the nearest-centre classifier of k-means clusters, one a candidate.

    Of fewer samples than candidates it is a `random_head`.
    """
    head = random_head(features, candidates)
    if candidates > len(features):
        return head
    found = KMeans(candidates, n_init=5, random_state=seed).fit(features)
    return _nearest(
        torch.from_numpy(found.cluster_centers_),
        torch.from_numpy(features),
        torch.from_numpy(found.labels_).long(),
    )


def _heads(
    backbone: nn.Module,
    samples: Tensor,
    anchors: Tensor,
    truth: Tensor,
    novel: NovelHead,
    config: Clustering,
    seed: int,
) -> Heads:
    """The known-class head starts as the nearest-centre classifier of the backbone's features."""
    features, unknown = (
        _batched(backbone, anchors, config.batch),
        _batched(backbone, samples, config.batch),
    )
    centres = torch.stack(
        [features[truth == label].mean(dim=0) for label in range(int(truth.max()) + 1)]
    )
    return Heads(backbone, _nearest(centres, features, truth), novel(unknown.numpy(), seed))


def _nearest(centres: Tensor, features: Tensor, assigned: Tensor) -> nn.Linear:
    """The classifier of features by the nearest of centres (K, d), with the deviation of features
    (n, d) assigned to them."""
    # log N(x; c, σ²) is linear in x but for a term that all classes share:
    # weight c/σ², bias −c²/2σ².
    within = (features - centres[assigned]).square().mean().clamp(min=_LEAST)
    layer = nn.Linear(features.shape[1], len(centres))
    with torch.no_grad():
        layer.weight.copy_(centres / within)
        layer.bias.copy_(-0.5 * centres.square().sum(dim=1) / within)
    return layer


def _epoch(
    heads: Heads,
    optimiser: torch.optim.Optimizer,
    data: _Data,
    epoch: int,
    config: Clustering,
    augment: Augment,
) -> FloatArray:
    """Make one pass over the unknown samples and an equal number of labelled ones; return mean
    losses L_ce, L_clu, L_con."""
    total = torch.zeros(3)
    for batch in torch.randperm(len(data.samples)).split(config.batch):
        count = len(batch)
        # Drawn with replacement: there may be fewer labelled samples than unknown ones.
        beside = torch.randint(len(data.anchors), (count,))
        inputs = torch.cat([data.samples[batch], data.anchors[beside]])
        known, novel = heads(inputs)
        q, p = known.softmax(dim=1), novel.softmax(dim=1)
        q_other, p_other = (logits.softmax(dim=1) for logits in heads(augment(inputs)))
        chosen = torch.meshgrid(batch, batch, indexing="ij")
        losses = (
            functional.cross_entropy(known[count:], data.truth[beside]),
            clustering_loss(
                p[:count],
                p_other[:count],
                Pairs(data.pairs.targets[chosen], data.pairs.counts[chosen]),
            ),
            functional.mse_loss(q, q_other) + functional.mse_loss(p, p_other),
        )
        optimiser.zero_grad()
        (losses[0] + losses[1] + consistency_weight(epoch, config) * losses[2]).backward()
        optimiser.step()
        total += torch.stack(losses).detach() * count
    return (total / len(data.samples)).double().numpy()


def _batched(module: Callable[[Tensor], Tensor], inputs: Tensor, batch: int) -> Tensor:
    with torch.no_grad():
        return torch.cat([module(some) for some in inputs.split(batch)])


_STABLE = 0.65
"""Prediction strength from which on clusters are taken to be real. The source has 0.8 to 0.9, which
one class of two kinds in a hundred samples seldom reaches."""
_DIVISIONS = 16
"""Number of times samples are divided in halves."""


def likely_count(features: Features, most: int, seed: int) -> int:
    """The number of clusters, up to `most`, at which the inertia of k-means bends most, among those
    that are stable.

    Stable are numbers whose prediction strength is at least 0.65: features (n, d) are divided in
    halves, k-means clusters each, and the strength is the share of pairs of samples of one cluster
    of a half that the centres of the other half put together too, in the cluster where it is
    smallest; the mean over several divisions. Parts of a class can be as stable as classes are, but
    further clusters gain little by then: the bend is the second difference of the inertia's
    logarithm, and counts by the strength. One cluster is taken where no greater number is stable.

    Source: Tibshirani & Walther, "Cluster Validation by Prediction Strength" (Journal of
    Computational and Graphical Statistics 14, 2005); the bend after Thorndike, "Who Belongs in the
    Family?" (Psychometrika 18, 1953).
    """
    random = np.random.default_rng(seed)
    halves = [np.array_split(random.permutation(len(features)), 2) for _ in range(_DIVISIONS)]
    # Clusters of fewer than four different samples can't be judged in halves.
    bends = _bends(features, max(min(most, len(np.unique(features, axis=0)) // 4) - 1, 0), seed)
    found, best = 1, -np.inf
    for index in np.argsort(-bends, kind="stable").tolist():
        count, bend = index + 2, bends[index]
        if max(bend, _STABLE * bend) > best:  # strengths are from 0.65 to 1: no other can win
            strength = _stable_strength(features, halves, count, seed)
            if strength is not None and strength * bend > best:
                found, best = count, strength * bend
    return found


def _stable_strength(
    features: Features, halves: Sequence[Sequence[IntArray]], count: int, seed: int
) -> float | None:
    """The mean strength of a number of clusters over divisions; None as soon as it can't become
    that of a stable one."""
    strengths: list[float] = []
    for one, other in halves:
        strengths.append(_strength(features[one], features[other], count, seed))
        # No strength is above 1: the mean can't reach the limit any more.
        if sum(strengths) + len(halves) - len(strengths) < _STABLE * len(halves):
            return None
    mean = float(np.mean(strengths))
    return mean if mean >= _STABLE else None


def _bends(features: Features, counts: int, seed: int) -> FloatArray:
    """Return the bend of the inertia of k-means at each number of clusters from two on."""
    if not counts:
        return np.zeros(0)
    # The second difference at a count needs one cluster fewer and one more.
    inertia = [
        KMeans(count, n_init=5, random_state=seed).fit(features).inertia_
        for count in range(1, counts + 3)
    ]
    return np.diff(np.log(inertia), 2)


def _strength(learnt: Features, judged: Features, count: int, seed: int) -> float:
    """Prediction strength of clusters of one half for another."""
    foretold = KMeans(count, n_init=3, random_state=seed).fit(learnt).predict(judged)
    clusters = KMeans(count, n_init=3, random_state=seed).fit_predict(judged)
    return min(_together(foretold[clusters == one]) for one in range(count))


def _together(foretold: IntArray) -> float:
    """Share of pairs with the same value."""
    pairs = len(foretold) * (len(foretold) - 1)
    return (
        float((np.bincount(foretold) * (np.bincount(foretold) - 1)).sum() / pairs) if pairs else 0.0
    )
