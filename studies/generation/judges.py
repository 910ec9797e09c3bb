"""Judges judged: collisions of reference drivers in replays of recorded units, which had none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from generation.search.plays import ArrayPlays
from generation.space.recorded import Recorded
from generation.space.space import Space
from schemas.common.array_types import BoolArray, FloatArray

SYSTEMS = ("cas", "aeb", "idm", "rss", "fsm", "r157-cc", "r157-reg")


@dataclass(frozen=True, eq=False)
class Replays:
    """Replays of n recorded units.

    Attributes:
        collides: whether each collides (n,), by the system's name.
        sites: kind of site of each unit (n,). errors: its error of reconstruction along the lane
            (n,), m; None if unknown.
    """

    collides: Mapping[str, BoolArray]
    sites: Sequence[str]
    errors: FloatArray | None

    @classmethod
    def of(
        cls, scenario: Path, space: Space, recorded: Recorded, systems: Sequence[str]
    ) -> Replays | None:
        """Play all units in arrays with each system; None where something is searched of which
        nothing is recorded."""
        replays = recorded.replays(space)
        if replays is None:
            return None
        (own, units), inside = replays, recorded.within(space)
        plays = ArrayPlays(scenario, own)
        collides = {name: plays(units, name).collision for name in systems}
        sites = [str(name).rpartition("/")[0] for name in inside.recordings]
        return cls(collides, sites, None if inside.errors is None else inside.errors[:, 1])

    def markdown(self, scenario: str) -> str:
        """Table with a row for each system: collisions in replays in a scenario, their sites,
        median errors of colliding and of all units."""
        lines = [
            f"| system | {scenario} | share | sites of these | error along the lane, m (all) |",
            "|---|---|---|---|---|",
        ]
        for name, collides in self.collides.items():
            sites, counts = np.unique(np.array(self.sites)[collides], return_counts=True)
            told = (
                ", ".join(f"{site} {count}" for site, count in zip(sites, counts, strict=True))
                or "–"
            )
            error = "–"
            if self.errors is not None and collides.any():
                error = f"{np.median(self.errors[collides]):.1f} ({np.median(self.errors):.1f})"
            lines.append(
                f"| {name} | {int(collides.sum())} of {len(collides)} | {collides.mean():.2%} | "
                f"{told} | {error} |"
            )
        return "\n".join(lines)
