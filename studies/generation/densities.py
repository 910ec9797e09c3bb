"""Comparison of density models on recordings that they have not seen: held-out log-likelihoods
(METHOD §3)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from generation.search.gate import Gate, Share
from generation.search.outcomes import Outcomes
from generation.space.density.base import folds
from generation.space.density.models import models
from generation.space.density.prior import RecordedPrior, held_out
from schemas.common.array_types import FloatArray
from studies.recognition.report.tables import Table, spread

_LEAST = 0.01
"""Share of its own draws that a density finds less likely than a recorded unit may be"""


def comparison(
    theta: FloatArray, recordings: NDArray[Any], names: Sequence[str] | None = None
) -> Table:
    """Table of the models' held-out log-likelihoods, best first.

    Args:
        theta: rows (n, d). recordings: of each row (n,).
        names: of the models; all where it is None.
    """
    every = models()
    found = {name: held_out(name, theta, recordings) for name in names or every}
    parts = [tested for _, tested in folds(recordings)]
    rows: list[tuple[str, ...]] = [
        (every[name].title, spread(found[name][tested].mean() for tested in parts))
        for name in sorted(found, key=lambda name: -found[name].mean())
    ]
    groups = len(np.unique(recordings))
    note = (
        f"{len(theta)} samples of {theta.shape[1]} parameters from {groups} recordings; mean ± "
        "standard deviation over the "
        "folds of log p (natural, in the parameters' units) of rows from recordings "
        "that were not fitted."
    )
    return Table(
        "density", "Held-out log-likelihood", note, ("density", "log-likelihood per sample"), rows
    )


def gated(
    priors: Mapping[str, RecordedPrior],
    run: Callable[[FloatArray], Outcomes],
    replayed: Share,
    draws: int,
) -> Table:
    """Table of priors by what they say of recordings that they have not seen, and by how often
    their draws collide.

    Args:
        priors: by the name of the density. run: runs rows of their space.
        replayed: collisions of recorded units with their own values.
        draws: of each prior.
    """
    rows: list[tuple[str, ...]] = []
    for name, prior in priors.items():
        drawn = prior.sample(draws, np.random.default_rng(0))
        outcomes = run(drawn)
        gate = Gate(replayed, Share.of(outcomes))
        likely = prior.foreseeable(drawn)
        least = np.quantile(prior.log_density(drawn), _LEAST) + np.log(prior.possible_share)
        shares = (
            f"{prior.possible_share:.1%}",
            f"{likely.mean():.2%}",
            f"{(prior.held_out < least).mean():.1%}",
        )
        figures = (
            f"{prior.held_out.mean():.3f}",
            *shares,
            str(gate.drawn),
            str(int((outcomes.collision & likely).sum())),
        )
        rows.append(
            (models()[name].title, *figures, "passed" if gate.refusal is None else "refused")
        )
    note = (
        f"Replays of recorded units with their own values: {replayed} collide. Likelihood: "
        "natural, in the parameters' units, "
        "mean over units by the density of other recordings. Possible: draws inside the limits of "
        "the parameters and of physics; "
        "others are drawn again. Foreseeable: of these draws. Beyond: recorded units less likely, "
        "by the density of other "
        "recordings, than 99 % of these draws. Gate: refused where certainly more draws than "
        "replays collide (95 % intervals, "
        "exact)."
    )
    header = (
        "density",
        "held-out log-likelihood",
        "possible",
        "foreseeable",
        "beyond",
        "draws that collide",
        "foreseeable ones",
        "gate",
    )
    return Table("gate", "Priors of what is foreseeable", note, header, rows)
