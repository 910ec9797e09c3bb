"""What the parts of the search are worth: each emitter of the archive, and the bounds of MCSG's coarse-to-fine stages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from generation.search.quality.search import QualitySettings, search
from generation.study.failures.problem import Posed
from generation.study.failures.screened import screened
from generation.study.failures.study import with_settings
from recognition.study.report.tables import Table, spread
from schemas.discovery import names

EMITTERS = names("generation.search.quality.emitters")
BOUNDS: Mapping[str, Mapping[str, Any]] = {
    "90 % span, 5 then 10 bins (as published)": {},
    "80 % span": {"span": 0.8},
    "whole span of the best tenth": {"span": 1.0},
    "bins as in the first stage": {"bins": (5, 5)},
    "20 bins in the second stage": {"bins": (5, 20)},
    "first edits up to 1.5 standard deviations": {"reach": 1.5},
}
"""Settings of MCSG by what they change: what the second stage keeps of the first one's ranges, its bins, the first ranges."""
_BATCH, _PLENTY = 500, 10_000


def sets() -> list[tuple[str, ...]]:
    """Each emitter alone, all but one, all, and those that are used."""
    alone = [(name,) for name in EMITTERS]
    but_one = [tuple(each for each in EMITTERS if each != name) for name in EMITTERS]
    every = [*alone, *but_one, EMITTERS, tuple(QualitySettings().emitters)]
    return list({frozenset(each): each for each in every}.values())


def by_emitters(posed: Posed, proposals: int, seeds: Sequence[int], tried: Sequence[Sequence[str]]) -> Table:
    """Failures on the twin that archives with each of these sets of emitters find with as many proposals."""
    rows: list[tuple[str, ...]] = []
    for chosen in tried:
        batch = QualitySettings.batch * len(QualitySettings().emitters) // len(chosen)
        settings = QualitySettings(chosen, batch=batch)
        settings = replace(settings, generations=settings.generations_of(proposals))
        found = [len(search(posed.problem, _PLENTY, seed, settings).theta) for seed in seeds]
        rows.append((", ".join(chosen), str(len(seeds)), spread(found, 1)))
        print(" | ".join(rows[-1]), flush=True)
    note = f"Distinct preventable failures on the twin within {proposals} proposals, mean ± standard deviation over seeds."
    return Table("emitters", "What each emitter is worth", note, ("emitters", "seeds", "distinct failures"), rows)


def bounds(posed: Posed, proposals: int, seeds: Sequence[int]) -> Table:
    """Failures on the twin that MCSG finds with other bounds of its stages."""
    rows: list[tuple[str, ...]] = []
    for title, settings in BOUNDS.items():
        method = screened(with_settings("mcsg", {"batch": _BATCH, **settings}), proposals)
        found = [len(method(posed.problem, _PLENTY, seed).theta) for seed in seeds]
        rows.append((title, str(len(seeds)), spread(found, 1)))
        print(" | ".join(rows[-1]), flush=True)
    note = f"MCSG with the extras of quality-diversity search; failures as above, {proposals} proposals in batches of {_BATCH}."
    return Table("bounds", "Bounds of the coarse-to-fine stages", note, ("stages", "seeds", "distinct failures"), rows)
