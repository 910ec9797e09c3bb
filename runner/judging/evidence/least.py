"""Evidence of a run: numbers that say how much it has tested, each with a least value.

A run passes if every row of `ROWS` reaches its least value and nothing failed. A row that does not
is a cause for which the run is inconclusive. `--least NAME=VALUE` sets other least values.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from runner.judging.evidence.rows import ROWS, Observed
from runner.judging.result import Cause, RunEvidence
from schemas.common.errors import UsageError, nearest


def collect(run: Observed, least: Mapping[str, float] | None = None) -> tuple[RunEvidence, ...]:
    """All evidence of a run; before its end the evidence of dry runs.

    Args:
        least: least values by name, where others than those of `ROWS` are wanted.
    """
    chosen = least or {}
    found = []
    for row in ROWS.values():
        count = row.of(run) if run.ended or row.early else None
        if count is None:
            continue
        needed = chosen.get(row.name, row.least)
        texts = count.texts if count.value < needed else ()
        # Rows such as `seconds` have no words of their own: they are told by their meaning.
        if count.value < needed and not any(texts):
            texts = (
                f"{row.meaning}: {count.value:.2f} {row.unit}, {needed:g} {row.unit} are needed",
            )
        found.append(RunEvidence(row.name, count.value, count.planned, row.unit, needed, texts))
    return tuple(found)


def missing(evidence: Iterable[RunEvidence]) -> tuple[Cause, ...]:
    """Causes for which a run with this evidence is inconclusive."""
    lacking = {row.name: row for row in evidence if not row.enough}
    # One lack is told once: an ego that was never there was not on a road or driven, either.
    told = (row for name, row in lacking.items() if not _explained(name, lacking))
    causes = (Cause(ROWS[row.name].cause, text) for row in told for text in row.texts)
    return tuple(dict.fromkeys(causes))


def _explained(name: str, lacking: Mapping[str, RunEvidence]) -> bool:
    """Whether an outer row is lacking too."""
    outer = ROWS[name].within
    return outer in lacking or bool(outer and _explained(outer, lacking))


def least_values(texts: Iterable[str]) -> dict[str, float]:
    """Least values by name, from texts as `ego_seconds=2`.

    Raises:
        UsageError: one has no such form, there is no such evidence, or two are of one kind.
    """
    least: dict[str, float] = {}
    for text in texts:
        name, equals, number = (part.strip() for part in text.partition("="))
        if not equals:
            raise UsageError(f"--least {text!r}: a name and a value are expected, as ego_seconds=2")
        if name not in ROWS:
            raise UsageError(
                f"--least {text!r}: there is no evidence {name!r}; {nearest(name, ROWS)}"
            )
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not 0.0 <= value < math.inf:
            raise UsageError(f"--least {text!r}: {number!r} is no number from 0 on")
        if least.get(name, value) != value:
            raise UsageError(f"--least {name}: {least[name]:g} and {value:g} are given")
        least[name] = value
    return least


CAUSES: Mapping[str, str] = {
    cause: "; ".join(
        dict.fromkeys(
            row.missing for row in ROWS.values() if row.cause == cause and row.missing != "likewise"
        )
    )
    for cause in dict.fromkeys(row.cause for row in ROWS.values())
}
"""Causes for which a run is inconclusive by name, and when it is"""


def limits_evidence(shares: Mapping[str, float], least: Mapping[str, float]) -> RunEvidence:
    """The evidence of limits.

    Args:
        shares: text of each limit, at least one, and share of time in which its measure was
            defined.
        least: least values by name.
    """
    needed = least.get("limits", ROWS["limits"].least)
    texts = tuple(
        f"{text}: the measure had a value in {share:.1%} of the time: it says nothing about the run"
        for text, share in shares.items()
        if share < needed
    )
    return RunEvidence("limits", min(shares.values()), None, "share", needed, texts)
