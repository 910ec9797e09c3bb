"""Quality-diversity search: see `generation.search.quality.search`."""

from __future__ import annotations

from generation.search.problem import History, Problem
from generation.search.quality.search import QualitySettings
from generation.search.quality.search import search as quality

METHOD = {
    "title": "**quality-diversity**",
    "meaning": "an archive of distinct foreseeable and preventable failures, found on the twin",
    "realistic": True,
}


def search(problem: Problem, budget: int, seed: int, settings: QualitySettings = QualitySettings()) -> History:  # noqa: B008
    """Quality-diversity with the emitters that earn their place."""
    return quality(problem, budget, seed, settings)
