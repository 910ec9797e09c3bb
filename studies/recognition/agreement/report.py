"""The report: Markdown tables of what was labelled, beside what bare positions and the data sets'
own lanes tell."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from recognition.labels import Label, counts
from studies.recognition.agreement.survey import Place, Vehicle, unique

_JUNCTION = (Label.LEFT_TURN, Label.RIGHT_TURN, Label.STRAIGHT_CROSS, Label.MERGING)
_TURN, _STRAIGHT = np.radians(45.0), np.radians(20.0)


def report(places: Sequence[Place], plots: dict[str, list[str]]) -> str:
    """The whole report.

    Args:
        plots: file names of the plots of each place.
    """
    parts = [
        "# Agreement of labels with recordings\n",
        _sizes(places),
        _classes(places),
        _lane_changes(places),
        _turns(places),
        _reasons(places),
    ]
    parts += [
        _failures(places),
        *(f"![{place}]({file})\n" for place, files in plots.items() for file in files),
    ]
    return "\n".join(part for part in parts if part)


def _table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    lines = [header, ["---"] * len(header), *([str(cell) for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def _sizes(places: Sequence[Place]) -> str:
    rows = [
        (p.name, p.recordings, p.rows, len(p.vehicles), len(unique(p.vehicles)), len(p.events))
        for p in places
    ]
    return _table(["place", "recordings", "rows", "tracks", "vehicles", "events"], rows)


def _classes(places: Sequence[Place]) -> str:
    found = [counts(place.events) for place in places]
    rows = [(int(label), label.title, *(one[label] for one in found)) for label in Label if label]
    return "## Events\n\n" + _table(["id", "class", *(place.name for place in places)], rows)


def _lane_changes(places: Sequence[Place]) -> str:
    """Vehicles that cross to another lane at all, that hold it, and that are labelled; and what the
    data set's own lanes say."""
    rows = []
    for place in places:
        groups = unique(place.vehicles)
        if not any(max(one.steps) for one in place.vehicles):
            continue

        def share(test: Callable[[Vehicle], bool], groups: list[list[Vehicle]] = groups) -> int:
            return sum(any(test(one) for one in group) for group in groups)

        own = (
            share(lambda one: bool(one.own_changes))
            if any(one.own_changes is not None for one in place.vehicles)
            else "–"
        )
        numbers = (
            share(lambda one: one.steps[0] > one.steps[1]),
            share(lambda one: one.steps[1] > one.steps[0]),
            share(lambda one: one.changes[0] > 0), share(lambda one: one.changes[1] > 0),
            share(lambda one: Label.LANE_CHANGE_LEFT in one.labels),
            share(lambda one: Label.LANE_CHANGE_RIGHT in one.labels),
            share(lambda one: one.ramps[0]), share(lambda one: one.ramps[1]),
            share(lambda one: Label.RAMP_ENTERING in one.labels),
            share(lambda one: Label.RAMP_EXITING in one.labels),
        )  # fmt: skip
        rows.append((place.name, len(groups), own, *numbers))
    header = [
        "place",
        "vehicles",
        "by own lanes",
        "left",
        "right",
        "left held",
        "right held",
        "label 5",
        "label 6",
    ]
    header += ["from ramp", "to ramp", "label 7", "label 8"]
    return "## Vehicles that change lane\n\n" + _table(header, rows) if rows else ""


def _turns(places: Sequence[Place]) -> str:
    """Moving vehicles by the turn of their way, and by the label that they have at the junction."""
    rows = []
    for place in places:
        if not any(event.label in _JUNCTION for event in place.events):
            continue
        for name, test in (
            ("left", _is_left),
            ("right", _is_right),
            ("straight", _is_straight),
            ("between", _is_between),
        ):
            mine = [one for one in place.vehicles if one.turn is not None and test(one.turn)]
            labelled = [sum(label in one.labels for one in mine) for label in _JUNCTION]
            none = sum(not set(_JUNCTION) & set(one.labels) for one in mine)
            rows.append((place.name, name, len(mine), *labelled, none))
    header = [
        "place",
        "way",
        "vehicles",
        *(label.title.removeprefix("unsignalised ") for label in _JUNCTION),
        "no label",
    ]
    return (
        "## Turns of the ways, and labels at junctions\n\n" + _table(header, rows) if rows else ""
    )


def _reasons(places: Sequence[Place]) -> str:
    """Count the reasons why moving vehicles at a junction have no label."""
    found = Counter(
        (place.name, one.unlabelled)
        for place in places
        if any(event.label in _JUNCTION for event in place.events)
        for one in place.vehicles
        if one.turn is not None and not set(_JUNCTION) & set(one.labels)
    )
    rows = [(*key, number) for key, number in sorted(found.items())]
    return (
        "## Why there is no label at the junction\n\n"
        + _table(["place", "reason", "vehicles"], rows)
        if rows
        else ""
    )


def _is_left(turn: float) -> bool:
    return turn >= _TURN


def _is_right(turn: float) -> bool:
    return turn <= -_TURN


def _is_straight(turn: float) -> bool:
    return abs(turn) < _STRAIGHT


def _is_between(turn: float) -> bool:
    return _STRAIGHT <= abs(turn) < _TURN


def _failures(places: Sequence[Place]) -> str:
    found = [(name, reason) for place in places for name, reason in place.failures.items()]
    return (
        "## Recordings that could not be labelled\n\n" + _table(["recording", "reason"], found)
        if found
        else ""
    )
