"""The edge cases that the searches of a study found, as scenarios to run: for comparisons of
systems under test."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from generation.search.outcomes import Episodes, joined
from generation.search.settings import Choice
from generation.space.recorded import kind_of, of_recordings, of_samples
from generation.space.space import distinctive, diverse
from runner.batch.jobs import Job
from schemas.common.errors import InvalidFile, UsageError
from studies.generation.comparison.study import Study, StudySettings
from studies.generation.methods import TRAJECTORIES

CONFIGURATION = "configuration.json"
"""The file by which a study's folder is known."""


def opened(folder: Path, library: Path, recorded: Path | None = None) -> Study:
    """The study in a folder, with the settings that it was made with.

    Args:
        library: folder of its scenario.
        recorded: its recordings, or the table of their units; None for those of our own recordings.

    Raises:
        InvalidFile: the folder is not of a study.
        UsageError: the scenario or the recordings are not those that it was made with.
    """
    path = folder / CONFIGURATION
    try:
        values = json.loads(path.read_bytes())
        scenario = library / values.pop("scenario")
        del values["inputs"]
        settings = StudySettings(**values)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InvalidFile(f"this is no study's configuration: {error}", path=path) from None
    samples = of_recordings(recorded, kind_of(scenario))
    return Study(scenario, lambda space: of_samples(samples, space), folder, settings)


def edge_cases(study: Study, method: str, choice: Choice) -> list[Job]:
    """The foreseeable collisions of all searches of one method that are apart from each other, the
    likelier first.

    Raises:
        UsageError: the method's searches are not there, or are of trajectories.
    """
    searches = [study.history(key) for key in study.searches() if key.method == method]
    if not searches or method in TRAJECTORIES:
        raise UsageError(f"there are no manoeuvres that {method} searched", path=study.out)
    thetas, outcomes, rewards = zip(*searches, strict=True)
    episodes = Episodes(np.concatenate(thetas), joined(outcomes), np.concatenate(rewards))
    likelihood, foreseeable = study.problem.reward.realism.judged(episodes.theta)
    order = np.argsort(-likelihood, kind="stable")
    order = order[(episodes.outcomes.collision & foreseeable)[order]]
    told = distinctive(study.space)
    chosen = order[
        diverse(study.space.unit(episodes.theta[order])[:, told], choice.apart, choice.most)
    ]
    return [
        Job(
            f"{method}~{number:06d}",
            study.scenario,
            study.scenario,
            {**study.space.pinned, **study.space.values(row)},
        )
        for number, row in enumerate(episodes.theta[chosen])
    ]
