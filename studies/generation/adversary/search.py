"""Search of an adversary: a policy learns by TD3 to make a system under test fail, in arrays.

Its actions are those of recorded drivers (`studies.generation.adversary.driving`). A failure is a
collision that a careful driver prevents on the same trajectory. All failures are kept while the
policy learns, from the first episode on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from generation.space.space import diverse
from recognition.trfe.training.windows import seeded
from schemas.common.array_types import FloatArray
from studies.generation.adversary import OBJECTIVES
from studies.generation.adversary.actions import ACTION, DECISIONS, INTERVAL
from studies.generation.adversary.course import Scene
from studies.generation.adversary.driving import Driving
from studies.generation.adversary.environment import OBSERVED, Environment, Episodes
from studies.generation.adversary.td3 import TD3, TD3Settings

Starts = Callable[[int, np.random.Generator], FloatArray]
"""Draws gaps (m), speeds of the actor and of the ego (m/s) (n, 3) at which traffic begins."""
_REACH = np.array([80.0, 40.0, 40.0, DECISIONS * INTERVAL, 40.0, 4.0])
"""Whole range of each of `described`"""


@dataclass(frozen=True)
class AdversarySettings:
    """Settings of the search.

    Attributes:
        rounds, episodes: how often so many episodes are played. updates: of the networks after each
            round.
        warm_up: rounds in which actions are drawn evenly.
        learns: whether the policy learns; otherwise all actions are drawn evenly.
        apart: least distance of two failures, as a share of the ranges of what describes them, root
            mean square.
        objective: shapes the reward (`studies.generation.adversary.OBJECTIVES`).
        td3: of the networks.
    """

    rounds: int = 20
    episodes: int = 128
    updates: int = 200
    warm_up: int = 4
    learns: bool = True
    apart: float = 0.05
    objective: str = OBJECTIVES[0]
    td3: TD3Settings = field(default_factory=TD3Settings)


class Round(NamedTuple):
    """Results of a round: numbers of foreseeable episodes, collisions, and
    failures worth fixing.
    """

    episodes: int
    foreseeable: int
    collisions: int
    failures: int


@dataclass(frozen=True, eq=False)
class Found:
    """Results of a search in arrays.

    Attributes:
        failures: foreseeable and preventable, none much like another, in the order in which they
            were found.
        rounds: how it went.
    """

    failures: Episodes
    rounds: list[Round]


def search(
    scene: Scene, driving: Driving, starts: Starts, sut: Any, dt: float, seed: int,
    settings: AdversarySettings = AdversarySettings(),
    progress: Callable[[int], None] = lambda episodes: None,
) -> Found:  # fmt: skip
    """Have an adversary learn, and keep what it finds.

    Args:
        scene: place and entities. driving: of recorded drivers. starts: draws how episodes begin.
            sut: the system under test.
        dt: time step, s. seed: of all that is drawn.
        progress: called with the number of episodes after each round.
    """
    generator, found, rounds = np.random.default_rng(seed), [], []
    with seeded(seed):
        environment = Environment(
            scene, driving, sut, dt, settings.td3.discount, settings.objective
        )
        policy = TD3(OBSERVED, len(ACTION), generator, settings.td3)
        for number in range(settings.rounds):
            drawn = number < settings.warm_up or not settings.learns
            act = (
                (lambda seen: generator.uniform(-1.0, 1.0, (len(seen), len(ACTION))))
                if drawn
                else policy
            )
            episodes, transitions = environment.play(starts(settings.episodes, generator), act)
            if settings.learns:
                policy.remember(tuple(transitions))
                policy.learn(settings.updates)
            rounds.append(_counted(episodes))
            found.append(episodes.take(episodes.failing))
            progress(settings.episodes)
    failures = _joined(found)
    return Found(failures.take(diverse(described(failures, dt) / _REACH, settings.apart)), rounds)


def described(episodes: Episodes, dt: float) -> FloatArray:
    """Return the coordinates that distinguish failures (n, 6): gap (m), initial speeds of actor and
    ego (m/s), time of the contact (s), the actor's speed then (m/s), and its lateral displacement
    (m)."""
    rows, at = np.arange(len(episodes.contact)), episodes.contact.clip(1)
    last, before = episodes.ways[rows, at], episodes.ways[rows, at - 1]
    speed = np.hypot(*(last - before).T) / dt
    aside = np.abs(last[:, 1] - episodes.ways[:, 0, 1])
    return np.hstack([episodes.starts, np.stack([at * dt, speed, aside], axis=1)])


def _counted(episodes: Episodes) -> Round:
    collided = episodes.foreseeable & (episodes.contact >= 0)
    counts = (episodes.foreseeable, collided, episodes.failing)
    return Round(len(episodes.contact), *(int(each.sum()) for each in counts))


def _joined(parts: list[Episodes]) -> Episodes:
    return Episodes(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0])}
    )
