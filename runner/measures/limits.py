"""Limits by which runs fail (`--fail-if`): a measure and a number, as `min_ttc<1`, or one of `EVENTS`."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from runner.measures.measure import measures, units
from schemas.common.errors import UsageError

_RSS = "rss_risk_ad_rss"
"""Measure that `rss` stands for"""
NEW_FAILURE = "new-failure"
"""Word of `xosc-run --fail-if` that is no limit of a run: a batch fails by failures that an earlier one does not have"""
UNITS = units() | {"end_time": "s"}
"""Measures of a run by name, and their units; see `runner.measures.measure` and `RunResult`."""
EVENTS = {"off-road": "offRoad", "road-end": "roadEnd", "timeout": "", "rss": ""}
"""Limits without a number, each with the kind of its event in the log: the ego leaves the road or reaches its end; the time
limit is reached first; RSS distances (parameter set `ad-rss`) are violated."""
_COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    "<=": operator.le, "<": operator.lt, ">=": operator.ge, ">": operator.gt,
}  # fmt: skip
_FORM = re.compile(r"\s*([\w-]+)\s*(?:(<=|<|>=|>)\s*(\S+)\s*)?")


class Facts(NamedTuple):
    """Values that limits are compared with.

    Attributes:
        criticality: `Criticality.summary` of the ego; None where there is none.
        events: kind, and text with the time, of the events of the ego.
        status: of the run.
        end_time: of the run, s.
    """

    criticality: Mapping[str, Any] | None
    events: Iterable[tuple[str, str]]
    status: str
    end_time: float


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
        """
        if text.strip() == "inconclusive":
            raise UsageError(
                f"--fail-if {text!r}: inconclusive runs fail a batch without it (exit code 6, see --allow-inconclusive); "
                "--junit-inconclusive error makes them errors of the report"
            )
        if text.strip() == NEW_FAILURE:
            raise UsageError(f"{NEW_FAILURE} compares batches, no run fails by it alone: type xosc-run --against BATCH")
        match = _FORM.fullmatch(text)
        if match is None or match[1] not in (UNITS if match[2] else EVENTS):
            raise UsageError(
                f"--fail-if {text!r}: a measure with a limit is expected, such as min_ttc<1 (of {', '.join(UNITS)}), "
                f"or one of {', '.join(EVENTS)}, or with --against {NEW_FAILURE}"
            )
        try:
            value = float(match[3] or 0.0)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise UsageError(f"--fail-if {text!r}: {match[3]!r} is no number")
        return cls(text.strip(), match[1], match[2] or "", value)

    def reason(self, facts: Facts) -> str:
        """Why a run fails by it; empty where it does not."""
        if self.name == "timeout":
            return f"{self.text}: the time limit came first, at {facts.end_time:.2f} s" if facts.status == "timeout" else ""
        if self.name == "rss":
            return Limit(self.text, _RSS, ">").reason(facts)
        if not self.comparison:
            return next((f"{self.text}: {text}" for kind, text in facts.events if kind == EVENTS[self.name]), "")
        found: Any = facts.end_time if self.name == "end_time" else (facts.criticality or {}).get(self.name)
        value = found["value"] if isinstance(found, Mapping) else found
        if value is None or not _COMPARISONS[self.comparison](value, self.value):
            return ""
        if self.name == "end_time":
            return f"{self.text}: end_time is {value:.2f} s"
        return f"{self.text}: {measures()[self.name].sentence(found)}"

    @property
    def needs_ego(self) -> bool:
        """Whether it says nothing about a run without an ego."""
        return self.name not in ("timeout", "end_time")
