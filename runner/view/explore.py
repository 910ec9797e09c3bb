"""Scenarios explored point by point: parameters with their ranges, films of single points,
verdicts, borders of failure.

Films are made by one warm process (`FilmProcess`): a newer request ends the run of an older one.
"""

from __future__ import annotations

import math
import multiprocessing
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from runner.batch.pool import begin_worker
from runner.judging.execution import run
from runner.judging.result import FAILED
from runner.judging.settings import RunSettings
from runner.view.replay.player import SceneArea, roads_of, runs_of_scene
from schemas.common.errors import ToolchainError, UsageError, describe, nearest
from schemas.common.policy import CommandPolicy, current, limited
from schemas.common.terminal.files import named
from schemas.common.terminal.text import finite_number
from xosc.distributions import ParameterSpace
from xosc.listing import ListedParameter, listing

if TYPE_CHECKING:
    from runner.judging.result import RunResult

NUMBER, WHOLE, CHOICE, TEXT = "number", "whole", "choice", "text"
"""Kinds of parameters"""
_NUMBERS = {
    "double": NUMBER,
    "integer": WHOLE,
    "int": WHOLE,
    "unsignedInt": WHOLE,
    "unsignedShort": WHOLE,
}
_LOOKED_AT = 300
"""Parameter sets of a variation file from which ranges are read"""
_AROUND = 0.5
"""Share of a value by which a range without limits reaches to both sides of it"""
_FROM_ZERO = 10.0
"""Range of a value of 0 without limits"""
FINENESS = 1000
"""Part of the range to which a border is found"""
_LONGEST = 200
"""Characters of a value"""
_LOW, _HIGH = ("greaterOrEqual", "greaterThan"), ("lessOrEqual", "lessThan")


# parameters -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ExploredParameter:
    """A parameter that can be changed.

    Attributes:
        name: as declared.
        kind: one of `NUMBER`, `WHOLE`, `CHOICE`, `TEXT`.
        value: at the beginning.
        low, high: range, of numbers.
        choices: values of a choice.
        limited: whether the file gives the range; otherwise it is made up around the value.
    """

    name: str
    kind: str
    value: str
    low: float = 0.0
    high: float = 0.0
    choices: tuple[str, ...] = ()
    limited: bool = True

    def spread(self, count: int) -> list[str]:
        """Values over the range, ends included, as texts: `count` or fewer."""
        if self.kind not in (NUMBER, WHOLE):
            return list(self.choices)
        step = (self.high - self.low) / max(1, count - 1)
        return list(dict.fromkeys(self.text(self.low + n * step) for n in range(count)))

    def text(self, number: float) -> str:
        """A number as the parameter takes it, with the digits that matter in its range."""
        if self.kind == WHOLE:
            return str(round(number))
        # Digits by the range: a slider over 0.01 and one over 1000 need other ones.
        size = (self.high - self.low) / FINENESS
        grain = 10.0 ** math.floor(math.log10(size)) if size > 0.0 else 0.0
        short = round(number / grain) * grain if grain else number
        # Rounded outwards a value would violate the constraint that gives the range.
        return f"{short if self.low <= short <= self.high else number:.6g}"


@dataclass(frozen=True)
class Explored:
    """A scenario with parameters to change.

    Attributes:
        source: the file that the user named: the scenario, or a variation of it.
        scenario: the scenario file.
        description: of its header.
        parameters: in the order of their declarations.
    """

    source: Path
    scenario: Path
    description: str
    parameters: tuple[ExploredParameter, ...]

    @classmethod
    def of(cls, path: Path, given: Mapping[str, str] | None = None) -> Explored:
        """Read a scenario or variation file.

        Ranges are those of the variation's sets, else those of the constraints of the declaration.

        Args:
            path: the file, or the name of a shipped one.
            given: values at the beginning, in the place of those declared.

        Raises:
            InvalidFile, Unsupported: the file can't be read.
            UsageError: a given value is of no parameter.
        """
        source = named(path)
        space = ParameterSpace(source)
        (listed,) = listing([str(space.scenario)]).scenarios
        varied = _varied(space)
        first = {name: values[0] for name, values in varied.items()} | dict(given or {})
        names = [each.name for each in listed.parameters]
        for name in first:
            if name not in names:
                raise UsageError(
                    f"there is no parameter {name!r}; {nearest(name, names)}", path=source
                )
        parameters = tuple(
            _parameter(each, first.get(each.name, each.value), varied.get(each.name, ()))
            for each in listed.parameters
        )
        return cls(source, space.scenario, listed.description, parameters)

    def parameter(self, name: object) -> ExploredParameter:
        """The parameter of a name.

        Raises:
            UsageError: there is none.
        """
        for each in self.parameters:
            if each.name == name:
                return each
        names = [each.name for each in self.parameters]
        raise UsageError(f"there is no parameter {name!r}; {nearest(str(name), names)}")

    def values(self, given: object) -> dict[str, str]:
        """Values of parameters by name, as a request gives them.

        Raises:
            UsageError: this is no mapping of parameters to short texts.
        """
        if not isinstance(given, Mapping):
            raise UsageError("values of parameters by name are expected")
        for name, value in given.items():
            self.parameter(name)
            if not isinstance(value, str) or len(value) > _LONGEST:
                raise UsageError(f"the value of {name} must be a text of at most {_LONGEST} signs")
        return dict(given)


def _varied(space: ParameterSpace) -> dict[str, list[str]]:
    """Values of each parameter in a variation file, the first set's first."""
    if space.distribution is None:
        return {}
    count = min(space.size, _LOOKED_AT)
    sets = [
        # All sets of a small space, draws of a large one.
        (space.variation(n) if count == space.size else space.draw(n, 0))[1]
        for n in range(count)
    ]
    return {name: list(dict.fromkeys(each[name] for each in sets)) for name in sets[0]}


def _parameter(declared: ListedParameter, value: str, varied: Sequence[str]) -> ExploredParameter:
    name, kind = declared.name, _NUMBERS.get(declared.type, TEXT)
    if declared.type == "boolean":
        return ExploredParameter(name, CHOICE, value, choices=("true", "false"))
    allowed = [text for group in declared.limits for rule, text in group if rule == "equalTo"]
    # Groups of equalTo alone are a list of values; another rule among them makes it a range.
    if allowed and len(allowed) == sum(map(len, declared.limits)):
        return ExploredParameter(name, CHOICE, value, choices=_with(value, allowed))
    number = finite_number(value)
    if kind == TEXT or number is None:
        several = _with(value, varied) if len(varied) > 1 else ()
        return ExploredParameter(name, CHOICE if several else TEXT, value, choices=several)
    bounds = [found for text in varied if (found := finite_number(text)) is not None]
    if len(set(bounds)) < 2:
        bounds = _bounds(declared)
    if len(set(bounds)) > 1:
        # The value at the beginning lies within, whatever the sets say.
        return ExploredParameter(name, kind, value, min(*bounds, number), max(*bounds, number))
    low, high = sorted((number * (1 - _AROUND), number * (1 + _AROUND)))
    if low == high:
        high = low + _FROM_ZERO
    if kind == WHOLE:
        # Outwards, so that both ends are whole and the value stays within.
        low, high = math.floor(low), math.ceil(high)
    return ExploredParameter(name, kind, value, low, high, limited=False)


def _with(value: str, choices: Sequence[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys([*choices, *([] if value in choices else [value])]))


def _bounds(declared: ListedParameter) -> list[float]:
    """Least and greatest value that constraints allow; fewer than two where a side is open."""
    found: list[float] = []
    for rules in (_LOW, _HIGH):
        ends = [
            [
                number
                for rule, text in group
                if rule in rules and (number := finite_number(text)) is not None
            ]
            for group in declared.limits
        ]
        if ends and all(ends):
            # A group holds if all its rules do, and one group is enough (ConstraintGroup).
            found.append(min(map(max, ends)) if rules is _LOW else max(map(min, ends)))
    return found


# points -----------------------------------------------------------------------------------------


class PointVerdict(NamedTuple):
    """PointVerdict of a run at a point: `passed`, `failed`, `inconclusive` or `error`, and the
    reason."""

    state: str
    reason: str


def verdict_at(
    scenario: Path, parameters: Mapping[str, str], settings: RunSettings
) -> PointVerdict:
    """Play a point; an error is a verdict too."""
    try:
        # A parameter may make a run endless or too large: the page goes on, the point is an error.
        with limited():
            verdict = run(scenario, settings, parameters=parameters).verdict
    except Exception as error:
        return PointVerdict("error", describe(error)[0])
    return PointVerdict(verdict.outcome, "; ".join(verdict.reasons))


class Border(NamedTuple):
    """Border of failure along a parameter.

    Attributes:
        points: values that were played (texts, ascending), with their states.
        edge: the neighbours at the border, the one that does not fail first; None for no border.
        borders: number of borders that the scan has met.
    """

    points: list[tuple[str, str]]
    edge: tuple[str, str] | None
    borders: int


_SCANNED = 9
"""Points over the range that are played first"""


def border(parameter: ExploredParameter, judge: Callable[[Sequence[str]], Sequence[str]]) -> Border:
    """Find the border of failure that is nearest to the parameter's value: a scan, then a
    bisection.

    Args:
        parameter: a number; borders near its value are preferred.
        judge: states of values (texts), in their order.

    Raises:
        UsageError: the parameter is no number.
    """
    at = finite_number(parameter.value)
    if parameter.kind not in (NUMBER, WHOLE) or at is None:
        raise UsageError(f"{parameter.name} is no number: a bisection needs one")
    scan = sorted({*parameter.spread(_SCANNED), parameter.text(at)}, key=float)
    known = dict(zip(scan, judge(scan), strict=True))
    # Errors and inconclusive runs count as not failed: a border is one of verdicts.
    pairs = [
        pair for pair in pairwise(scan) if (known[pair[0]] == FAILED) != (known[pair[1]] == FAILED)
    ]
    edge = None
    if pairs:
        low, high = min(pairs, key=lambda pair: _away(at, float(pair[0]), float(pair[1])))
        least = 1.0 if parameter.kind == WHOLE else (parameter.high - parameter.low) / FINENESS
        while float(high) - float(low) > least:
            middle = parameter.text((float(low) + float(high)) / 2)
            if middle in known:
                break
            (known[middle],) = judge([middle])
            if (known[middle] == FAILED) == (known[low] == FAILED):
                low = middle
            else:
                high = middle
        # The side that does not fail comes first, whichever of them is lower.
        edge = (high, low) if known[low] == FAILED else (low, high)
    points = sorted(known.items(), key=lambda point: float(point[0]))
    return Border(points, edge, len(pairs))


def _away(at: float, low: float, high: float) -> float:
    return max(low - at, at - high, 0.0)


# films ------------------------------------------------------------------------------------------


class Superseded(ToolchainError):
    """A newer request has taken the place of this one."""


@dataclass(frozen=True)
class FilmRequest:
    """A point to be played, once for each of the settings.

    Attributes:
        scenario, parameters: the point.
        settings: of one run, or of two to be compared.
        ground: mark of the roads that the asker has; they are sent again where others are needed.
    """

    scenario: Path
    parameters: Mapping[str, str]
    settings: tuple[RunSettings, ...]
    ground: str = ""


@dataclass
class _Projector:
    """Plays requests; keeps the roads that were drawn last."""

    mark: str = ""
    number: int = 0
    around: SceneArea | None = None
    roads: tuple[str, ...] = ()

    def film(self, request: FilmRequest, progress: Callable[[float], object]) -> dict[str, Any]:
        """Data of the page's player, with roads where they are others; an error by its message."""
        try:
            with limited():
                results = [
                    run(request.scenario, each, parameters=request.parameters, progress=progress)
                    for each in request.settings
                ]
                roads = tuple(_road(result) for result in results)
                # Small changes of a parameter keep roads and origin: these need not be sent again.
                if self.around is None or roads != self.roads or not self.around.hold(results):
                    self.around, self.roads = SceneArea.of(results), roads
                    self.number += 1
                    # With the process: after a crash another one would count from 1 again.
                    self.mark = f"{multiprocessing.current_process().pid}-{self.number}"
                scene: dict[str, Any] = {"runs": runs_of_scene(results, self.around)}
                # The page keeps the roads it was sent: they are sent again only where they differ.
                if request.ground != self.mark:
                    scene["roads"] = roads_of(results, self.around)
        except Superseded:
            raise
        except Exception as error:
            return {"error": describe(error)[0]}
        return {"scene": scene, "ground": self.mark}


def _road(result: RunResult) -> str:
    network = result.recording.network
    return "" if network is None else str(network.path)


def _project(connection: Any, policy: CommandPolicy, start: str) -> None:
    """Answer requests, each a number and a point, to the end of the connection."""
    begin_worker(policy, start)

    def watch(_: float) -> None:
        if connection.poll():
            raise Superseded("a newer request is there")

    projector = _Projector()
    with suppress(EOFError, OSError):
        while True:
            number, request = connection.recv()
            # A newer request waits already: this one's answer would be thrown away.
            if connection.poll():
                continue
            with suppress(Superseded):
                connection.send((number, projector.film(request, watch)))


@dataclass
class FilmProcess:
    """Process that plays points in sequence; it starts with the first request, and again after a
    crash.

    Threads may ask at the same time: the newest request is answered, the others are superseded.
    """

    _number: int = 0
    _answers: dict[int, dict[str, Any]] = field(default_factory=dict)
    _changed: threading.Condition = field(default_factory=threading.Condition)
    _process: Any = None
    _connection: Any = None

    def film(self, request: FilmRequest) -> dict[str, Any]:
        """Return the film of a point, or `error`.

        Raises:
            Superseded: a newer request came.
        """
        with self._changed:
            if self._process is None:
                self._start()
            self._number += 1
            number, process = self._number, self._process
            with suppress(OSError):  # it has died: the reader says so
                self._connection.send((number, request))
            self._changed.notify_all()
            # The end of the process and a newer request wake it, too.
            self._changed.wait_for(
                lambda: (
                    number in self._answers or number < self._number or process is not self._process
                )
            )
            answer = self._answers.pop(number, None)
            if answer is None and number < self._number:
                raise Superseded("a newer request is there")
        return answer or {"error": "the process that plays has ended: this point may need too much"}

    def close(self) -> None:
        """End the process."""
        with self._changed:
            process, self._process = self._process, None
        if process is not None:
            process.terminate()
            process.join(1.0)
            process.kill()
            process.join()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")  # this process has threads
        self._connection, other = context.Pipe()
        start = multiprocessing.get_start_method()
        self._process = context.Process(target=_project, args=(other, current(), start))
        self._process.start()
        other.close()
        reader = threading.Thread(
            target=self._read, args=(self._process, self._connection), daemon=True
        )
        reader.start()

    def _read(self, process: Any, connection: Any) -> None:
        with suppress(EOFError, OSError):
            while True:
                number, answer = connection.recv()
                with self._changed:
                    # Answers to older requests have nobody who waits for them.
                    if number == self._number:
                        self._answers[number] = answer
                    self._changed.notify_all()
        with self._changed:
            # Another one may have been started meanwhile.
            if self._process is process:
                self._process = None
            self._changed.notify_all()
        process.join()
