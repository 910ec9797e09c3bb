"""What a scenario is made of: a finding with some time before and after it, or all that is recorded of a vehicle."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from recognition.catalogue.recognisers.findings import Finding
from recognition.catalogue.usable import Vehicle
from recognition.labels.classes import Label

VEHICLES = "vehicles"
"""Folder of the scenes of whole vehicles"""
UNLABELLED = "unlabelled"

_UNFIT = re.compile(r"[^A-Za-z0-9.+=-]+")
_LABELS = {label.title: label for label in Label}


class Around(NamedTuple):
    """Time (s) before and after a finding that belongs to its scenario."""

    before: float = 6.0
    after: float = 6.0


@dataclass(frozen=True)
class Episode:
    """A scenario to be written.

    Attributes:
        folder, name: where it goes, and its name there.
        title, state: of the class.
        ego: name of the track.
        start, end: of the scene, s.
        finding: what was recognised; for a vehicle's scene the most telling of all findings, None for nothing.
        passage: how a vehicle passes, where the scene is all that was recorded of it.
    """

    folder: str
    name: str
    title: str
    state: str
    ego: str
    start: float
    end: float
    finding: Finding | None
    passage: str | None = None

    @property
    def label(self) -> Label:
        """The class, as far as it is one of the 17."""
        return _LABELS.get(self.title, Label.UNKNOWN)


def of_findings(recording: str, findings: Iterable[Finding], around: Around) -> list[Episode]:
    """A scenario for each finding, in the folder of its class."""
    episodes = []
    for finding in findings:
        moment = finding.moment
        name = f"{plain(recording)}_{plain(moment.ego)}_{moment.time:07.2f}"
        start, end = finding.start - around.before, finding.end + around.after
        episodes.append(Episode(plain(moment.title), name, moment.title, moment.state, moment.ego, start, end, finding))
    return _distinct(episodes)


def of_vehicles(recording: str, vehicles: Iterable[Vehicle], findings: Sequence[Finding]) -> list[Episode]:
    """A scenario for each vehicle, of all that was recorded of it."""
    episodes = []
    for ego, start, end, passage in vehicles:
        own = [finding for finding in findings if finding.moment.ego == ego]
        best = max(
            own, key=lambda finding: (_LABELS.get(finding.moment.title, Label.UNKNOWN), -finding.moment.time), default=None
        )
        title, state = (best.moment.title, best.moment.state) if best is not None else (UNLABELLED, UNLABELLED)
        name = f"{plain(recording)}_{plain(ego)}"
        episodes.append(Episode(VEHICLES, name, title, state, ego, start, end, best, passage))
    return _distinct(episodes)


def plain(text: str) -> str:
    """Text as part of a file's name."""
    return _UNFIT.sub("_", text).strip("._") or "_"


def _distinct(episodes: list[Episode]) -> list[Episode]:
    """The same with names that are unique in their folders, whatever the file system makes of capitals."""
    seen: dict[str, int] = {}
    distinct = []
    for episode in episodes:
        key = f"{episode.folder}/{episode.name}".casefold()
        seen[key] = seen.get(key, 0) + 1
        distinct.append(episode if seen[key] == 1 else replace(episode, name=f"{episode.name}_{seen[key]}"))
    return distinct
