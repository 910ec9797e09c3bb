"""Criteria: their registry, the drive that they judge, and their findings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from schemas.common.discovery import load

if TYPE_CHECKING:
    from runner.recording import Recording, Track
    from xodr.network import RoadNetwork


class Finding(NamedTuple):
    """A criterion's answer. passed: None where it can't be judged. value: what it measured, None where nothing was."""

    passed: bool | None
    value: float | None
    reason: str


class CriterionResult(NamedTuple):
    """The result of one criterion for one participant.

    Attributes:
        name: of the criterion, e.g. `DrivenDistanceTest`.
        entity: the participant; empty where there was none to judge.
        passed: None where it could not be judged; the reason then says why.
        value: what was measured, None where nothing was.
        unit: of the value.
        reason: one sentence with the figures.
    """

    name: str
    entity: str
    passed: bool | None
    value: float | None
    unit: str
    reason: str

    @property
    def state(self) -> str:
        """`passed`, `failed` or `not judged`."""
        return "not judged" if self.passed is None else "passed" if self.passed else "failed"

    def __str__(self) -> str:
        return f"{self.name}{f' of {self.entity}' if self.entity else ''}: {self.reason}"


class Contact(NamedTuple):
    """Start of a contact: time (s), and partner."""

    time: float
    other: str


LightStates = Mapping[str, list[tuple[float, str]]]
"""For each traffic signal that had a state: since when (s, ascending) which, in the terms of the scenario."""


@dataclass(frozen=True, eq=False)
class Drive:
    """Motion of one entity in a run.

    Args:
        track: the participant's; not empty.
        recording: of the run.
        contacts: the participant's, in ascending time.
        lights: states of the traffic signals.
        since: time from which it is judged, s.
    """

    track: Track
    recording: Recording
    contacts: tuple[Contact, ...] = ()
    lights: LightStates = field(default_factory=dict)
    since: float = 0.0

    @property
    def network(self) -> RoadNetwork:
        """The roads; only for criteria that say `on_roads`."""
        assert self.recording.network is not None
        return self.recording.network

    @cached_property
    def columns(self) -> dict[str, np.ndarray]:
        """The track's columns from `since` on, each of shape (n,); see `runner.recording.COLUMNS`."""
        if self.recording.network is not None:
            self.track.locate(self.recording.network)
        columns = self.track.columns
        rows = columns["time"] >= self.since - 1e-9
        return {name: values[rows] for name, values in columns.items()}

    @cached_property
    def steps(self) -> np.ndarray:
        """Distances covered by the reference point from row to row (n - 1,), m."""
        return np.hypot(np.diff(self.columns["x"]), np.diff(self.columns["y"]))

    def at(self, ahead: float, left: float) -> tuple[np.ndarray, np.ndarray]:
        """World positions (n,) of the point that is so far ahead and to the left of the reference point, m."""
        columns = self.columns
        cos, sin = np.cos(columns["h"]), np.sin(columns["h"])
        return columns["x"] + ahead * cos - left * sin, columns["y"] + ahead * sin + left * cos

    def centre(self) -> tuple[np.ndarray, np.ndarray]:
        """World positions (n,) of the centre of the bounding box, m."""
        return self.at(self.track.box.x, self.track.box.y)

    def corners(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """World positions (n,) of the box's corners, counter-clockwise from the front left one, m."""
        box = self.track.box
        half = ((1, 1), (-1, 1), (-1, -1), (1, -1))
        return [self.at(box.x + i * box.length / 2, box.y + j * box.width / 2) for i, j in half]


class Kind(NamedTuple):
    """A criterion that scenarios may declare.

    Attributes:
        name: after `criteria_`, e.g. `DrivenDistanceTest`.
        unit: of the measured value.
        summary: the condition to pass, with its parameters in backquotes.
        parameters: defaults by name, in the order in which a scenario gives them; None where there is no default.
        on_roads: whether it needs a road network.
        evaluate: function of a drive and the parameters that returns the finding.
    """

    name: str
    unit: str
    summary: str
    parameters: dict[str, float | None]
    on_roads: bool
    evaluate: Callable[..., Finding]


_registered: dict[str, Kind] = {}
_Evaluate = TypeVar("_Evaluate", bound=Callable[..., Finding])


def criterion(
    name: str, *, unit: str, summary: str, parameters: dict[str, float | None] | None = None, on_roads: bool = False
) -> Callable[[_Evaluate], _Evaluate]:
    """Register a function of a drive as a criterion; the arguments are those of `Kind`."""

    def register(evaluate: _Evaluate) -> _Evaluate:
        _registered[name.casefold()] = Kind(name, unit, summary, parameters or {}, on_roads, evaluate)
        return evaluate

    return register


@cache
def kinds() -> dict[str, Kind]:
    """All criteria by their name in lower case: scenario_runner's documentation and its code differ in letters."""
    load("runner.criteria.kinds")
    return dict(sorted(_registered.items()))


def intervals(holds: np.ndarray) -> list[tuple[int, int]]:
    """First and last row of each stretch of true values (n,)."""
    edges = np.diff(np.concatenate([[0], holds.astype(np.int8), [0]]))
    return list(zip(np.flatnonzero(edges == 1).tolist(), (np.flatnonzero(edges == -1) - 1).tolist(), strict=True))


def duration_of(holds: np.ndarray, time: np.ndarray) -> float:
    """Time (s) within the stretches; a single row has none."""
    return float(sum(time[last] - time[first] for first, last in intervals(holds)))
