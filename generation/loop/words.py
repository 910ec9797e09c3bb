"""A finished stage in one line."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from generation.loop.stages import Found
from generation.outcomes.cases import AVOIDED, COLLISION


def summary(stage: str, found: Found) -> str:
    """What a stage has found."""
    number, _, rest = stage.removeprefix("round_").partition("_") if stage.startswith("round_") else ("", "", stage)
    told = _WORDS[rest.partition("_")[0]](found)
    return f"round {number}: {told}" if number else told


def closing(found: Found) -> str:
    """A whole loop in one line."""
    cases = [case for each in found["rounds"] for search in each["searches"] for case in search.get("cases", [])]
    collisions = [case for case in cases if case["Verdict"] == COLLISION]
    avoidable = sum(case["CarefulDriver"] == AVOIDED for case in collisions)
    return f"{len(cases)} edge cases, {len(collisions)} of them collisions, of which a careful driver avoids {avoidable}"


def _recognised(found: Found) -> str:
    states = ", ".join(f"{count} {state}" for state, count in found["states"].items())
    return f"{sum(found['classes'].values())} scenarios recognised: {states or 'none'}"


def _measured(found: Found) -> str:
    return "manoeuvres measured: " + (", ".join(f"{count} {kind}" for kind, count in found["kinds"].items()) or "none")


def _searched(found: Found) -> str:
    if "error" in found:
        return f"{found['title']} was not searched: {found['error']}"
    cases = len(found["cases"])
    return (
        f"{found['title']}: {found['calls']} runs, {found['collisions']} collisions, {found['distinct']} of them unlike "
        f"each other ({found['new']} new), {cases} edge cases written; density of {found['prior']}"
    )


def _ran(found: Found) -> str:
    states = [run["state"] for runs in found.values() for run in runs]
    words = {"passed": "passed", "failed": "failed", "error": "with errors"}
    return f"{len(states)} runs: " + ", ".join(f"{states.count(state)} {word}" for state, word in words.items())


def _labelled(found: Found) -> str:
    return f"{sum(map(len, found.values()))} scenarios recognised about the ego in {len(found)} runs of edge cases"


def _checked(found: Found) -> str:
    problems = found["problems"]
    return f"{found['files']} files checked, " + (
        f"{len(problems)} problems, the first: {problems[0]}" if problems else "all valid"
    )


_WORDS: Mapping[str, Callable[[Found], str]] = {
    "recognise": _recognised,
    "label": _labelled,
    "measure": _measured,
    "search": _searched,
    "run": _ran,
    "play": _ran,
    "check": _checked,
}
"""By the first word of a stage's name."""
