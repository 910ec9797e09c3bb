"""Criticality measures of a run: meanings, registry, and limits that fail runs (`--fail-if`).

A limit is a measure and a number, as `min_ttc<1`, one of `EVENTS`, a criterion, as `KeepLaneTest`,
or a formula of signal temporal logic, as `stl: eventually (ttc < 1 and speed > 20)`.

A measure is one class in a family file of `runner.judging.measures.kinds`. Everything else that
names measures (`result.json`, tables of runs, `--fail-if`, reports, tags, docs/measures.md) takes
them from `measures()`.
"""

from __future__ import annotations

import math
import operator
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, TypeVar

from schemas.common.errors import UsageError, blame, guess, nearest
from schemas.common.packages import MissingExtra, load, optional
from schemas.common.plugins import NameTaken
from schemas.common.plugins import register as register_plugins
from schemas.common.policy import current

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from runner.judging.criteria.criterion import Criterion
    from schemas.common.array_types import BoolArray, FloatArray


GREATEST_DECELERATION = 9.81
"""Deceleration (m/s²) beyond which tyres on a dry road do not brake: a coefficient of friction of 1
"""
LONGEST_PET = 10.0
"""Post-encroachment times above this (s) are no encounter"""


class Series(NamedTuple):
    """Values of a quantity over time, and where it is defined; values elsewhere
    are 0, never NaN.
    """

    value: FloatArray
    valid: BoolArray


class Extreme(NamedTuple):
    """The extreme of a quantity over a run: its value, the instant (s) and the
    other participant.
    """

    value: float
    time: float
    other: str


def least(series: Series, other: NDArray[np.object_], time: FloatArray) -> Extreme | None:
    """The least value of a series where it is defined, the first of equal ones; None where it is
    never defined."""
    return (
        _pick(series, other, time, int(series.value[series.valid].argmin()))
        if series.valid.any()
        else None
    )


def greatest(series: Series, other: NDArray[np.object_], time: FloatArray) -> Extreme | None:
    """The greatest value of a series where it is defined, the first of equal ones; None where it is
    never defined."""
    return (
        _pick(series, other, time, int(series.value[series.valid].argmax()))
        if series.valid.any()
        else None
    )


def _pick(series: Series, other: NDArray[np.object_], time: FloatArray, index: int) -> Extreme:
    row = series.valid.nonzero()[0][index]
    return Extreme(float(series.value[row]), float(time[row]), str(other[row]))


def _mean(holds: BoolArray) -> float:
    return float(holds.mean()) if len(holds) else 0.0


ALWAYS = "always"
"""Validity of measures that another participant is not needed for"""


class RunMeasure(ABC):
    """A criticality measure of a run: one number about the ego.

    Attributes:
        name: in results, tables, `--fail-if` and the index of a catalogue.
        label: in reports.
        unit: empty for a number without one.
        formula: in words and symbols.
        critical: whether `low` or `high` values are critical.
        validity: where it is defined; `ALWAYS` for measures of the ego alone.
        source: publication.
        most: value beyond which the amount no longer matters, the end of its axis in reports; None
            leaves it out of reports.
        beyond: word for values beyond `most` in reports; empty for the number.
        tag: name of the tag in catalogues; empty for none.
        is_extreme: whether it has an instant and another participant (`Extreme`), or is a number
            over the whole run.
        greatest: value that it can't exceed; none is below 0.
    """

    name: str
    label: str
    unit: ClassVar[str] = ""
    formula: str
    critical: ClassVar[str]
    validity: ClassVar[str]
    source: ClassVar[str]
    most: float | None = None
    beyond: ClassVar[str] = ""
    tag: ClassVar[str] = ""
    is_extreme: ClassVar[bool] = True
    greatest: ClassVar[float] = math.inf

    def defined(self, run: Any) -> float:
        """Share of the ego's time with a value, or with nothing critical to measure; see
        `validity`.

        By default the share in which another participant was there, or all of it with the validity
        `ALWAYS`.
        """
        return 1.0 if self.validity == ALWAYS else _mean(run.distance.valid)

    @abstractmethod
    def of(self, run: Any) -> Extreme | float | None:
        """The measure of a run, given as its `runner.judging.measures.criticality.Criticality`;
        None where it is not defined."""

    def result(self, run: Any) -> Extreme | float | None:
        """Call `of`; errors of measures of packages are raised with the measure's name.

        Raises:
            UsageError: the measure of an installed package failed.
        """
        try:
            return self.of(run)
        except Exception as error:
            module = type(self).__module__
            if self.name in _own():
                raise  # a defect of ours
            reason = blame(error, module)
            raise UsageError(f"the measure {self.name} ({module}) failed: {reason}") from error

    def sentence(self, found: Mapping[str, Any] | float) -> str:
        """A value of `Criticality.summary` in words, for the reasons of verdicts."""
        if isinstance(found, Mapping):
            return (
                f"{self.name} is {found['value']:.2f} {self.unit} with {found['other']} at "
                f"{found['time']:.2f} s"
            )
        return f"{self.name} is {found:.2f} {self.unit}"


_registered: dict[str, RunMeasure] = {}
_Class = TypeVar("_Class", bound=type[RunMeasure])


def measure(kind: _Class) -> _Class:
    """Register a class of measures; its constructor takes no argument."""
    register(kind())
    return kind


def register(each: RunMeasure) -> None:
    """Register a measure.

    Raises:
        NameTaken: there is one of that name.
    """
    if each.name in _registered:
        home = type(_registered[each.name]).__module__
        raise NameTaken(f"the measure {each.name} is registered by {home}")
    _registered[each.name] = each


@cache
def _own() -> dict[str, RunMeasure]:
    """Measures of the folder `kinds`."""
    load("runner.judging.measures.kinds")
    return dict(
        sorted(_registered.items(), key=lambda entry: type(entry[1]).__module__)
    )  # whichever was imported first


@cache
def _of_plugins() -> dict[str, RunMeasure]:
    """Measures of installed packages."""
    own = _own()
    register_plugins(
        "xosc.measure", lambda: [type(measure).__module__ for measure in _registered.values()]
    )
    return {name: measure for name, measure in sorted(_registered.items()) if name not in own}


def measures() -> dict[str, RunMeasure]:
    """All measures by name, in the order of their families and of their places in these; then those
    of installed packages.

    Packages name modules of measures by the entry-point group `xosc.measure`. --untrusted leaves
    them out.

    Example:
        >>> import xosc_toolchain as xt
        >>> measure = xt.measures()["min_ttc"]
        >>> measure.label, measure.unit
        ('Least time to collision', 's')
    """
    return _own() if current().untrusted else {**_own(), **_of_plugins()}


def units() -> dict[str, str]:
    """Units of all measures by name."""
    return {name: measure.unit for name, measure in measures().items()}


_RSS = "rss_risk_ad_rss"
"""Measure that `rss` stands for"""
NEW_FAILURE = "new-failure"
"""Word of `xosc-run --fail-if` that is no limit of a run: a batch fails by failures that an earlier
one does not have"""
UNITS = {name: measure.unit for name, measure in _own().items()} | {"end_time": "s"}
"""Measures of a run by name, without those of plug-ins, and their units; see
`runner.judging.measures.measure` and `RunResult`."""
EVENTS = {"off-road": "offRoad", "road-end": "roadEnd", "timeout": "", "rss": ""}
"""Limits without a number, each with the kind of its event in the log: the ego leaves the road or
reaches its end; the time limit is reached first; RSS distances (parameter set `ad-rss`) are
violated."""
_COMPARISONS: dict[str, Callable[[Any, float], Any]] = {
    "<=": operator.le, "<": operator.lt, ">=": operator.ge, ">": operator.gt,
}  # fmt: skip
_CRITERION = "criterion"
"""Name of limits that are criteria"""
_OF_CRITERION = re.compile(r"\s*\w+Test\s*(?:$|=)", re.IGNORECASE)
_TINY = 1e-300
"""Margin of what only just keeps a limit"""
_FORM = re.compile(r"\s*([\w-]+)\s*(?:(<=|<|>=|>)\s*(\S+)\s*)?")


class Facts(NamedTuple):
    """Values that limits are compared with.

    Attributes:
        criticality: `Criticality.summary` of the ego; None where there is none.
        events: kind, and text with the time, of the events of the ego.
        status: of the run.
        end_time: of the run, s.
        criteria: `runner.judging.criteria.criterion.CriterionResult` of the run.
        seen: `runner.judging.measures.criticality.Criticality` of the ego, whose signals formulas
            are about; None where there is none.
    """

    criticality: Mapping[str, Any] | None
    events: Iterable[tuple[str, str]]
    status: str
    end_time: float
    criteria: Iterable[Any] = ()
    seen: Any = None


FORMULA = "stl"
"""Name of limits that are formulas; a colon follows it"""
SIGNALS = {
    "ttc": "s", "thw": "s", "drac": "m/s²", "distance": "m", "rss_margin": "m", "speed": "m/s",
    "acceleration": "m/s²", "jerk": "m/s³", "x": "m", "y": "m", "s": "m", "t": "m",
}  # fmt: skip
"""Signals of formulas and their units: relations to the lead and to others, RSS's margin
(`ad-rss`), motion of the ego, its place in the world and on its road"""
_WORD = re.compile(r"(?<![\w.])[A-Za-z_]\w*")
_OF_LOGIC = frozenset(
    (
        *("always", "historically", "eventually", "once", "until", "since", "and", "or", "not"),
        *("implies", "iff", "xor", "rise", "fall", "prev", "next", "abs", "sqrt", "exp", "pow"),
        *("G", "F", "U", "H", "O", "S", "X", "s", "ms", "us", "ns", "inf", "unless"),
    )
)
"""Words of formulas that are no signals"""


class Formula:
    """A formula of signal temporal logic about `SIGNALS`, monitored by rtamt.

    D. Ničković, T. Yamaguchi, RTAMT: online robustness monitors from STL, ATVA 2020.

    Raises:
        UsageError: it is none. MissingExtra: rtamt is not installed.
    """

    def __init__(self, text: str, timestep: float = 0.05) -> None:
        library = optional("rtamt")
        unknown = [
            word for word in _WORD.findall(text) if word not in SIGNALS and word not in _OF_LOGIC
        ]
        if unknown:
            near = nearest(unknown[0], SIGNALS)
            raise UsageError(f"there is no signal {unknown[0]!r}; {near}")
        self._names = sorted({word for word in _WORD.findall(text) if word in SIGNALS})
        if not self._names:
            raise UsageError(f"it names no signal; signals: {', '.join(SIGNALS)}")
        self._monitor = library.StlDiscreteTimeSpecification()
        for name in self._names:
            self._monitor.declare_var(name, "float")
        self._monitor.set_sampling_period(max(round(timestep * 1e3), 1), "ms", 0.1)
        self._monitor.spec = text
        try:
            self._monitor.parse()
            # Bounds the wrong way round show at the first evaluation.
            self._robustness({name: [0.0, 0.0] for name in self._names}, [0.0, timestep])
        except ValueError:
            raise UsageError("limits of time have to ascend, as [0:3]") from None
        except Exception as error:  # of the library, of several kinds
            reason = " ".join(str(error).split()).partition(", expecting")[0]
            reason = reason.partition(" expecting {")[0].removeprefix("RTAMT Exception: ")
            raise UsageError(f"the formula is malformed: {reason}") from None

    def robustness(self, seen: Any) -> float:
        """Robustness of the formula at the beginning of a run: above 0 where it holds.

        Args:
            seen: `runner.judging.measures.criticality.Criticality` of the run.
        """
        signals = {name: seen.signals[name].tolist() for name in self._names}
        return self._robustness(signals, seen.time.tolist())

    def _robustness(self, signals: Mapping[str, list[float]], time: list[float]) -> float:
        found = self._monitor.evaluate({"time": time, **signals})
        return float(found[0][1])


@cache
def _formula(text: str, timestep: float) -> Formula:
    """A formula for runs of a time step, s."""
    return Formula(text, timestep)


def _guess(text: str) -> str:
    """Question for the most similar measure or event to that of a limit, with a blank after it."""
    name = re.split(r"[<>=\s]", text.strip(), maxsplit=1)[0]
    return guess(name, (*UNITS, *units(), *EVENTS))


@dataclass(frozen=True)
class Limit:
    """A limit of a measure, or an event.

    Args:
        text: as it was written.
        name: one of `UNITS` or `EVENTS`.
        comparison: with which the run fails; empty for events.
        value: the number that is compared with.
    """

    text: str
    name: str
    comparison: str = ""
    value: float = 0.0

    @classmethod
    def parse(cls, text: str) -> Limit:
        """A limit from its text.

        Raises:
            UsageError: it is none, with the measures and events that there are.
            MissingExtra: it is a formula, and rtamt is not installed.
        """
        if text.partition(":")[0].strip() == FORMULA and ":" in text:
            try:
                Formula(text.partition(":")[2].strip())
            except MissingExtra:
                raise
            except UsageError as error:
                raise UsageError(f"--fail-if {text!r}: {error}") from None
            return cls(text.strip(), FORMULA)
        if _OF_CRITERION.match(text):
            from runner.judging.criteria.criterion import asked

            found = asked(text)
            if isinstance(found, str):
                raise UsageError(f"--fail-if {text!r}: {found}")
            return cls(text.strip(), _CRITERION)
        if text.strip() == "inconclusive":
            raise UsageError(
                f"--fail-if {text!r}: inconclusive runs fail a batch without it (exit code 6, see "
                "--allow-inconclusive); "
                "--junit-inconclusive error makes them errors of the report"
            )
        if text.strip() == NEW_FAILURE:
            raise UsageError(
                f"{NEW_FAILURE} compares batches, no run fails by it alone: type xosc-run "
                "--against BATCH"
            )
        match = _FORM.fullmatch(text)
        # Measures need a number, events must not have one.
        if match is None or match[1] not in (UNITS | units() if match[2] else EVENTS):
            raise UsageError(
                f"--fail-if {text!r}: {_guess(text)}a measure with a limit is "
                "expected, such as min_ttc<1 "
                f"(of {', '.join(UNITS | units())}), "
                f"one of {', '.join(EVENTS)}, a criterion, as KeepLaneTest or MaxVelocityTest=30, "
                f"a formula, as 'stl: eventually (ttc < 1)', or with --against {NEW_FAILURE}"
            )
        try:
            value = float(match[3] or 0.0)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise UsageError(f"--fail-if {text!r}: {match[3]!r} is no number")
        limit = cls(text.strip(), match[1], match[2] or "", value)
        # A limit that no run can reach would be green for ever.
        if match[2] and not limit.reachable:
            raise UsageError(f"--fail-if {text!r}: no run can reach this limit: {limit.bounds}")
        return limit

    @property
    def reachable(self) -> bool:
        """Whether a measure can have a value beyond it."""
        compare = _COMPARISONS[self.comparison]
        # The extreme value on that side decides: no measure is below 0.
        return compare(0.0 if self.comparison.startswith("<") else self._greatest, self.value)

    @property
    def bounds(self) -> str:
        """Bounds of its measure in words."""
        above = f", nor above {self._greatest:g}" if self._greatest < math.inf else ""
        return f"{self.name} is never below 0{above}"

    @property
    def _greatest(self) -> float:
        return measures()[self.name].greatest if self.name in measures() else math.inf

    def defined(self, criticality: Any) -> float:
        """Share of the ego's time in which its measure was defined, or its event could happen.

        Args:
            criticality: `runner.judging.measures.criticality.Criticality` of the ego; None where it
                never appeared, or there is none.
        """
        if not self.needs_ego or self.name == _CRITERION:  # which counts as evidence itself
            return 1.0
        if criticality is None:
            return 0.0
        name = _RSS if self.name == "rss" else self.name
        return 1.0 if name in (*EVENTS, FORMULA) else measures()[name].defined(criticality)

    def margins(self, values: FloatArray) -> FloatArray:
        """Signed distances of values (n,) to the limit: robustness as in temporal logic.

        At most 0 where the run fails, above 0 where it does not, infinite for a value that is not
        defined (NaN); a share of the limit. Limits at 0 have no scale, so that what keeps them is
        infinitely far.

        G. Fainekos, G. Pappas, Robustness of temporal logic specifications for continuous-time
        signals, Theoretical Computer Science 410, 2009.
        """
        import numpy as np  # limits are parsed before a command needs it

        fails = _COMPARISONS[self.comparison](values, self.value)
        apart = np.abs(values - self.value)
        if self.value == 0.0:
            return np.where(fails, -apart, np.inf)
        apart = np.where(np.isnan(apart), np.inf, apart / abs(self.value))
        # A value at a limit that allows it is no failure, however little there is left.
        return np.where(fails, -apart, np.maximum(apart, np.finfo(float).tiny))

    def margin(self, facts: Facts) -> float:
        """Signed distance of a run to the limit, as of `margins`; -1 for an event that happened."""
        if self.name == "rss":
            return Limit(self.text, _RSS, ">").margin(facts)
        if self.name == _CRITERION:
            own = (found.margin for found in facts.criteria if found.name == self.text)
            return min(own, default=math.inf)
        if self.name == FORMULA:
            return self._formula_margin(facts)
        if not self.comparison:
            return -1.0 if self.reason(facts) else math.inf
        import numpy as np

        value = self._value(facts)
        return float(self.margins(np.array([math.nan if value is None else value]))[0])

    def _formula_margin(self, facts: Facts) -> float:
        """Signed distance from what the formula describes, in the units of its signals: a run fails
        where it holds."""
        seen = facts.seen
        if seen is None or len(seen.time) < 2:
            return math.inf
        step = round(float(seen.time[1] - seen.time[0]), 6)
        found = _formula(self.text.partition(":")[2].strip(), step).robustness(seen)
        return -found if found > 0.0 else max(-found, _TINY)

    def _value(self, facts: Facts) -> float | None:
        """The run's value of the measure; None where it is not defined."""
        if self.name == "end_time":
            return facts.end_time
        found: Any = (facts.criticality or {}).get(self.name)
        value: float | None = found["value"] if isinstance(found, Mapping) else found
        return value

    def reason(self, facts: Facts) -> str:
        """Reason for which a run fails by the limit; empty where it does not."""
        if self.name == "timeout":
            return (
                f"{self.text}: the time limit came first, at {facts.end_time:.2f} s"
                if facts.status == "timeout"
                else ""
            )
        if self.name == "rss":
            return Limit(self.text, _RSS, ">").reason(facts)
        if self.name == _CRITERION:
            return ""  # a criterion fails the run itself
        if self.name == FORMULA:
            margin = self._formula_margin(facts)
            return (
                f"{self.text}: it holds with a robustness of {-margin:.2f}" if margin < 0.0 else ""
            )
        if not self.comparison:
            return next(
                (
                    f"{self.text}: {text}"
                    for kind, text in facts.events
                    if kind == EVENTS[self.name]
                ),
                "",
            )
        value = self._value(facts)
        if value is None or not _COMPARISONS[self.comparison](value, self.value):
            return ""
        return f"{self.text}: {self.reached(facts)}"

    def reached(self, facts: Facts) -> str:
        """Value of the measure in a run, in words; empty for other limits, and without one."""
        if self.name == "rss":
            return Limit(self.text, _RSS, ">").reached(facts)
        value = self._value(facts) if self.comparison else None
        if value is None:
            return ""
        if self.name == "end_time":
            return f"end_time is {value:.2f} s"
        found: Any = (facts.criticality or {})[self.name]
        return measures()[self.name].sentence(found)

    @property
    def needs_ego(self) -> bool:
        """Whether it says nothing about a run without an ego."""
        return self.name not in ("timeout", "end_time")

    @property
    def criterion(self) -> Criterion | None:
        """The criterion of the scenario that it asks for; None for other limits."""
        if self.name != _CRITERION:
            return None
        from runner.judging.criteria.criterion import asked

        found = asked(self.text)
        assert not isinstance(found, str)  # as it was parsed
        return found

    @property
    def needs_road(self) -> bool:
        """Whether it says nothing about a run without roads."""
        return self.name in ("off-road", "road-end")
