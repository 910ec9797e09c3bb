"""Criteria: registry, findings, and declarations in the stop triggers of scenarios, as for
CARLA."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from schemas.common.errors import UsageError, blame, guess
from schemas.common.packages import load
from schemas.common.plugins import NameTaken
from schemas.common.plugins import register as register_plugins
from schemas.common.policy import current
from xosc.document.carla import CRITERION_PREFIX, is_criterion

if TYPE_CHECKING:
    from runner.recording import Recording, Track
    from xodr.graph.network import RoadNetwork
    from xosc.document.node import Node


class CriterionFinding(NamedTuple):
    """A criterion's answer. passed: None where it can't be judged. value: what it measured, None
    where nothing was. margin: signed distance to the border between pass and failure, at most 0 in
    a failure, as a share of what is allowed or in m or s; None where the criterion has none."""

    passed: bool | None
    value: float | None
    reason: str
    margin: float | None = None

    @property
    def signed(self) -> float:
        """Margin; -1 for a failure and infinite for a pass where the criterion has none."""
        if self.passed is None:
            return math.inf
        if self.margin is None:
            return math.inf if self.passed else -1.0
        # A value at a limit that allows it is no failure, however little there is left.
        return max(self.margin, _TINY) if self.passed else min(self.margin, 0.0)


_TINY = float(np.finfo(float).tiny)


def share_left(left: float, allowed: float) -> float:
    """Margin of what is left (negative: exceeded) of something that is allowed, in its own unit
    where nothing is."""
    return left / (abs(allowed) or 1.0)


class CriterionResult(NamedTuple):
    """The result of one criterion for one participant.

    Attributes:
        name: of the criterion, e.g. `DrivenDistanceTest`.
        entity: the participant; empty where there was none to judge.
        passed: None where it could not be judged; the reason then says why.
        value: what was measured, None where nothing was.
        unit: of the value.
        reason: one sentence with the figures.
        margin: see `CriterionFinding.signed`.
    """

    name: str
    entity: str
    passed: bool | None
    value: float | None
    unit: str
    reason: str
    margin: float = math.inf

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
"""For each traffic signal that had a state: since when (s, ascending) which, in the terms of the
scenario."""


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
        """The track's columns from `since` on, each of shape (n,); see
        `runner.recording.COLUMNS`.
        """
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
        """World positions (n,) of a point at distances ahead and to the left of the reference
        point, m."""
        columns = self.columns
        cos, sin = np.cos(columns["h"]), np.sin(columns["h"])
        return columns["x"] + ahead * cos - left * sin, columns["y"] + ahead * sin + left * cos

    def centre(self) -> tuple[np.ndarray, np.ndarray]:
        """World positions (n,) of the centre of the bounding box, m."""
        return self.at(self.track.box.x, self.track.box.y)

    def corners(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """World positions (n,) of the box's corners, counter-clockwise from the
        front left one, m.
        """
        box = self.track.box
        half = ((1, 1), (-1, 1), (-1, -1), (1, -1))
        return [self.at(box.x + i * box.length / 2, box.y + j * box.width / 2) for i, j in half]


class CriterionKind(NamedTuple):
    """A criterion that scenarios may declare.

    Attributes:
        name: after `criteria_`, e.g. `DrivenDistanceTest`.
        unit: of the measured value.
        summary: the condition to pass, with its parameters in backquotes.
        parameters: defaults by name, in the order in which a scenario gives them; None where there
            is no default.
        on_roads: whether it needs a road network.
        evaluate: function of a drive and the parameters that returns the finding.
    """

    name: str
    unit: str
    summary: str
    parameters: dict[str, float | None]
    on_roads: bool
    evaluate: Callable[..., CriterionFinding]


_registered: dict[str, CriterionKind] = {}
_Evaluate = TypeVar("_Evaluate", bound=Callable[..., CriterionFinding])


def criterion(
    name: str,
    *,
    unit: str,
    summary: str,
    parameters: dict[str, float | None] | None = None,
    on_roads: bool = False,
) -> Callable[[_Evaluate], _Evaluate]:
    """Register a function of a drive as a criterion; arguments as in `CriterionKind`.

    Raises:
        NameTaken: there is one of that name.
    """

    def register(evaluate: _Evaluate) -> _Evaluate:
        if name.casefold() in _registered:
            home = _registered[name.casefold()].evaluate.__module__
            raise NameTaken(f"the criterion {name} is registered by {home}")
        _registered[name.casefold()] = CriterionKind(
            name, unit, summary, parameters or {}, on_roads, evaluate
        )
        return evaluate

    return register


@cache
def _own() -> dict[str, CriterionKind]:
    """Criteria of the folder `kinds`."""
    load("runner.judging.criteria.kinds")
    return dict(sorted(_registered.items()))


@cache
def _of_plugins() -> dict[str, CriterionKind]:
    """Criteria of installed packages."""
    own = _own()
    register_plugins(
        "xosc.criterion", lambda: [kind.evaluate.__module__ for kind in _registered.values()]
    )
    return {name: kind for name, kind in sorted(_registered.items()) if name not in own}


def kinds() -> dict[str, CriterionKind]:
    """All criteria by their name in lower case: scenario_runner's documentation and its code differ
    in letters.

    Packages name modules of criteria by the entry-point group `xosc.criterion`. --untrusted leaves
    them out.
    """
    return _own() if current().untrusted else {**_own(), **_of_plugins()}


def intervals(holds: np.ndarray) -> list[tuple[int, int]]:
    """First and last row of each stretch of true values (n,)."""
    # Zeros at both ends close open stretches; signed, since differences of booleans have no -1.
    edges = np.diff(np.concatenate([[0], holds.astype(np.int8), [0]]))
    return list(
        zip(
            np.flatnonzero(edges == 1).tolist(),
            (np.flatnonzero(edges == -1) - 1).tolist(),
            strict=True,
        )
    )


def duration_of(holds: np.ndarray, time: np.ndarray) -> float:
    """Time (s) within the stretches; a single row has none."""
    return float(sum(time[last] - time[first] for first, last in intervals(holds)))


Contacts = Iterable[tuple[float, str, str]]
"""Beginnings of contacts: time (s) and the names of both participants."""


def judge_criteria(
    criteria: Sequence[Criterion],
    names: Sequence[str],
    recording: Recording,
    contacts: Contacts,
    lights: LightStates,
) -> tuple[CriterionResult, ...]:
    """The result of each criterion for each participant that it is about.

    A criterion that can't be judged says so: it has no such participant, no value, no roads, or no
    kind of its name.

    Args:
        criteria: of the scenario.
        names: the participants that they are about, the egos of the scenario.
        recording: of the run, with its road network where it had one.
        contacts: of all participants, in ascending time.
        lights: states of the traffic signals.
    """
    history = list(contacts)
    results = []
    for criterion in criteria:
        if criterion.kind is None:
            results.append(CriterionResult(criterion.name, "", None, None, "", criterion.remark))
        elif not names:
            results.append(
                CriterionResult(
                    criterion.name, "", None, None, criterion.kind.unit, "the scenario has no ego"
                )
            )
        else:
            for name in names:
                finding = _find(criterion, criterion.kind, name, recording, history, lights)
                results.append(
                    CriterionResult(
                        criterion.name,
                        name,
                        finding.passed,
                        finding.value,
                        criterion.kind.unit,
                        finding.reason,
                        finding.signed,
                    )
                )
    return tuple(results)


def _find(
    criterion: Criterion,
    kind: CriterionKind,
    name: str,
    recording: Recording,
    history: list[tuple[float, str, str]],
    lights: LightStates,
) -> CriterionFinding:
    """A criterion's finding on one participant."""
    track = recording.tracks.get(name)
    if kind.on_roads and recording.network is None:
        return CriterionFinding(None, None, "there is no road network")
    # CARLA's files may leave values out: a guess would decide the verdict.
    missing = [parameter for parameter, value in criterion.parameters.items() if value is None]
    if missing:
        return CriterionFinding(
            None, None, f"the scenario gives no value for {' and '.join(missing)}"
        )
    if track is None:
        return CriterionFinding(None, None, f"{name} never appeared")
    mine = tuple(
        Contact(time, second if first == name else first)
        for time, first, second in history
        # The delay of its condition is when a criterion begins to count.
        if name in (first, second) and time >= criterion.delay
    )
    drive = Drive(track, recording, mine, lights, criterion.delay)
    if not len(drive.columns["time"]):
        return CriterionFinding(None, None, f"{name} was not there after {criterion.delay:g} s")
    return _evaluated(kind, drive, criterion.parameters)


def _evaluated(
    kind: CriterionKind, drive: Drive, values: Mapping[str, float | None]
) -> CriterionFinding:
    """A kind's finding on a drive.

    Raises:
        UsageError: the criterion of an installed package failed.
    """
    module = kind.evaluate.__module__
    told = f"the criterion {kind.name} ({module}) failed"
    try:
        finding = kind.evaluate(drive, **values)
    except Exception as error:
        if kind.name.casefold() in _own():
            raise  # a defect of ours
        raise UsageError(f"{told}: {blame(error, module)}") from error
    if not isinstance(finding, CriterionFinding):
        raise UsageError(f"{told}: it returned {finding!r}, no CriterionFinding")
    return finding


def light_states(events: Iterable[tuple[float, str, str]]) -> Mapping[str, list[tuple[float, str]]]:
    """States of traffic signals by signal, from the times (s), signals and states of all changes in
    ascending time."""
    states: dict[str, list[tuple[float, str]]] = {}
    for time, signal, state in events:
        states.setdefault(signal, []).append((time, state))
    return states


_SEPARATORS = re.compile(r"[\s,;]+")


@dataclass(frozen=True)
class Criterion:
    """A criterion of a scenario.

    Args:
        name: as in the scenario, without `criteria_`.
        kind: None where no criterion has that name.
        parameters: of the kind, by name; None where neither the scenario nor the kind gives a
            value.
        delay: time (s) from which it is judged.
        where: `file:line` of the condition.
        remark: what the scenario says that has no meaning for it; empty where there is nothing.
    """

    name: str
    kind: CriterionKind | None
    parameters: dict[str, float | None]
    delay: float
    where: str
    remark: str = ""


def declared(storyboard: Node) -> tuple[Criterion, ...]:
    """The criteria in all stop triggers of a Storyboard element.

    Raises:
        InvalidFile: a value of a criterion is not a number, or there are more values than it has
            parameters.
    """
    return tuple(map(_read, elements(storyboard)))


OF_CRITERION = re.compile(r"\s*(\w+Test)\s*(?:=(.*))?", re.IGNORECASE)
"""Form of a limit by a criterion: its name, and its values"""


def asked(text: str) -> Criterion | str:
    """A criterion that an option asks for, as `KeepLaneTest` or `MaxVelocityTest=30`, whose results
    have the text as name; or the reason why it is none."""
    match = OF_CRITERION.fullmatch(text)
    kind = kinds().get(match[1].casefold()) if match else None
    if match is None or kind is None:
        known = sorted(kind.name for kind in kinds().values())
        name = match[1] if match else text
        return f"{guess(name, known)}criteria: {', '.join(known)}"
    texts = [one for one in _SEPARATORS.split((match[2] or "").strip()) if one]
    try:
        values = [float(one) for one in texts]
    except ValueError:
        values = [math.nan]
    lacking = [name for name, value in kind.parameters.items() if value is None]
    form = "".join(
        f"{', ' if number else '='}{name.upper()}" for number, name in enumerate(kind.parameters)
    )
    if not all(map(math.isfinite, values)) or not len(lacking) <= len(values) <= len(
        kind.parameters
    ):
        return f"{kind.name}{form} is expected"
    given: dict[str, float | None] = dict(kind.parameters)
    given.update(zip(kind.parameters, values, strict=False))
    return Criterion(text.strip(), kind, given, 0.0, "--fail-if")


def elements(storyboard: Node) -> Iterator[Node]:
    """Yield the Condition elements of a document or Storyboard that are criteria."""
    for trigger in storyboard.iter("StopTrigger"):
        yield from filter(is_criterion, trigger.iter("Condition"))


def _read(condition: Node) -> Criterion:
    name, parameter = (
        condition.get("name").removeprefix(CRITERION_PREFIX),
        condition.find("ByValueCondition", "ParameterCondition"),
    )
    kind, delay = kinds().get(name.casefold()), condition.finite("delay", 0.0)
    if kind is None:
        known = ", ".join(sorted(kind.name for kind in kinds().values()))
        return Criterion(
            name,
            None,
            {},
            delay,
            condition.where,
            f"there is no criterion of this name; criteria: {known}",
        )
    if parameter is None:  # a CollisionCondition, which gives no values
        return Criterion(kind.name, kind, dict(kind.parameters), delay, condition.where)
    reference, text = parameter.get("parameterRef", ""), parameter.get("value", "")
    if not kind.parameters:
        remark = (
            f"{kind.name} has no parameters: value={text!r} is not used" if text.strip() else ""
        )
        return Criterion(kind.name, kind, {}, delay, condition.where, remark)
    values = _values(parameter, kind, reference, text)
    return Criterion(kind.name, kind, kind.parameters | values, delay, condition.where)


def _values(
    parameter: Node, kind: CriterionKind, reference: str, text: str
) -> dict[str, float | None]:
    """Values by parameter: in their order, from the one on that parameterRef names; an empty one
    with a name means 0."""
    names = list(kind.parameters)
    names = names[names.index(reference) if reference in names else 0 :]
    texts = [one for one in _SEPARATORS.split(text.strip()) if one] or (["0"] if reference else [])
    if len(texts) > len(names):
        raise parameter.invalid(
            f"value={text!r} has {len(texts)} numbers, {kind.name} takes {', '.join(names)}"
        )
    return {
        name: _number(parameter, kind, one, text) for name, one in zip(names, texts, strict=False)
    }


def _number(parameter: Node, kind: CriterionKind, text: str, whole: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not math.isfinite(value):
        raise parameter.invalid(
            f"value={whole!r} is not a number: {kind.name} takes {', '.join(kind.parameters)}"
        )
    return value
