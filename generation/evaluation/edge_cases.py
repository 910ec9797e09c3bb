"""The edge cases that the searches of a study found, as scenarios to run: for comparisons of systems under test."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from generation.cases import Choice, best
from generation.methods import METHODS
from generation.parameters import Space
from generation.problem import Episodes, History, joined
from runner.jobs import Job
from schemas.errors import InvalidFile, UsageError

CONFIGURATION = "configuration.json"
"""The file by which a study's folder is known."""


def edge_cases(folder: Path, method: str, choice: Choice, library: Path) -> list[Job]:
    """The best episodes of all searches of one method, chosen as `xosc-generate` chooses what it writes.

    Args:
        folder: of a study.
        method: name of a search method.
        library: folder of the study's scenario.

    Raises:
        InvalidFile: the folder is not of a study, or a file in it is damaged.
        UsageError: the method's searches are not there, or are of trajectories.
    """
    scenario, pinned = _subject(folder / CONFIGURATION, library)
    files = sorted((folder / "searches" / method).glob("*.npz"), key=lambda file: int(file.stem))
    if not files or METHODS[method].knots:
        raise UsageError(f"there are no manoeuvres that {method} searched", path=folder)
    thetas, outcomes, rewards = zip(*(History.load(file) for file in files), strict=True)
    episodes = Episodes(np.concatenate(thetas), joined(outcomes), np.concatenate(rewards))
    space = Space.of(scenario, pinned)
    chosen = best(space, episodes, np.zeros(len(episodes.rewards)), choice)
    return [
        Job(f"{method}~{number:06d}", scenario, scenario, {**space.pinned, **space.values(row)})
        for number, row in enumerate(episodes.theta[chosen])
    ]


def _subject(path: Path, library: Path) -> tuple[Path, dict[str, str]]:
    """The scenario of a study, and its pinned values."""
    try:
        settings = json.loads(path.read_bytes())
        return library / settings["scenario"], settings["pinned"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InvalidFile(f"this is no study's configuration: {error}", path=path) from None
