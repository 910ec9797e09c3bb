"""Effect of the limit of the foreseeable on recorded pairs, draws, and the whole space."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from generation.search.outcomes import Outcomes
from generation.space.density.models import JUDGE, judge
from generation.space.recorded import Recorded
from generation.space.space import Space
from schemas.common.array_types import BoolArray, FloatArray
from studies.recognition.report.tables import Table

_BOX = 20_000
"""Points of the whole space"""


def limits(
    space: Space,
    recorded: Recorded,
    run: Callable[[FloatArray], Outcomes],
    coordinated: Callable[[FloatArray], Outcomes],
    draws: int,
) -> Table:
    """Table of limits: that of the pair's density, those of what each adversary does alone, and
    all.

    Args:
        run: runs rows of the space. coordinated: the same, where those collisions alone count that
            need both.
        draws: of the density.
    """
    prior, together = (
        recorded.prior(space, JUDGE),
        recorded.recorded_prior(space, judge(JUDGE, pairs=True)),
    )
    alone = recorded.alone(space, JUDGE)
    units = recorded.within(space).theta
    units = units[prior.possible(units)]
    drawn = prior.sample(draws, np.random.default_rng(0))
    anywhere = space.draw(_BOX, np.random.default_rng(1))
    anywhere = anywhere[prior.possible(anywhere)]
    colliding = drawn[run(drawn).collision]
    needing = colliding[coordinated(colliding).collision]

    def pair(theta: FloatArray) -> BoolArray:
        return together.foreseeable(theta[:, [space.names.index(name) for name in together.names]])

    def each(theta: FloatArray) -> BoolArray:
        passed = [
            one.foreseeable(theta[:, [space.names.index(name) for name in one.names]])
            for one in alone
        ]
        found: BoolArray = np.all(passed, axis=0)
        return found

    kinds = {
        "of the pair": pair,
        "of each alone": each,
        "both": lambda theta: pair(theta) & each(theta),
    }
    rows: list[tuple[str, ...]] = [
        (
            name,
            *(f"{kept(theta).mean():.1%}" for theta in (units, drawn)),
            *(f"{kept(theta).sum()} of {len(theta)}" for theta in (colliding, needing)),
            f"{kept(anywhere).sum() / _BOX:.2%}",
        )
        for name, kept in kinds.items()
    ]
    note = (
        f"{len(units)} recorded pairs, {draws} draws, of which {len(colliding)} collide, "
        f"{len(needing)} of these with neither "
        f"adversary alone, and {_BOX} points drawn evenly from all values, of which "
        f"{len(anywhere)} are possible. The limits are "
        "those that all but 1 % of recorded rows reach, each by the density of other recordings; "
        "what passes is by that of all."
    )
    header = (
        "limit",
        "recorded pairs",
        "draws",
        "draws that collide",
        "those that need both",
        "of all values",
    )
    return Table("limits", "What is foreseeable by which limit", note, header, rows)
