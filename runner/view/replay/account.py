"""Account of a run: the entity that the ego interacts with most at each instant, the run in a few
sentences, and its timeline.

The timeline is the event log as rows of bars over time: acts, events and actions of the storyboard,
interventions, collisions, notes.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from runner.judging.measures.contacts import FULL, Conflict, sentence
from runner.judging.measures.measure import GREATEST_DECELERATION
from runner.recording import LogEntry

if TYPE_CHECKING:
    from runner.judging.measures.contacts import Impact
    from runner.judging.measures.criticality import Criticality
    from runner.judging.result import RunResult
    from runner.recording import Track


_FAR = 100.0
"""Others farther away than this do not matter, m"""
_SHORT = 1.0
"""Shortest time (s) as nearest entity that is mentioned"""

Stretches = list[tuple[int, str]]
"""Numbers of samples from which on something holds, and what"""


def main_partner(measures: Criticality) -> str | None:
    """The other one of the whole run: of the contact, else of the least time to collision, else of
    the least distance."""
    if measures.impact is not None:
        return measures.impact.other
    extremes = [measures.summary[name] for name in ("min_ttc", "min_distance")]
    return next((str(extreme["other"]) for extreme in extremes if extreme is not None), None)


def partners(measures: Criticality, dt: float, stride: int) -> Stretches:
    """The partner over time: the main one while it is near, else the nearest, if near; empty for
    none."""
    near = measures.distance.valid & (measures.distance.value <= _FAR)
    found = np.where(near, measures.nearest, "").astype(object)
    main = main_partner(measures)
    if main is not None:
        other = measures.other(main)
        # By steps: rounded times of two tracks need not be equal to the last bit.
        rows, theirs = (np.rint(time / dt).astype(np.int64) for time in (measures.time, other.time))
        _, mine, its = np.intersect1d(rows, theirs, return_indices=True)
        away = np.hypot(measures.ego.x[mine] - other.x[its], measures.ego.y[mine] - other.y[its])
        # The main partner wins over a nearer one that happens to pass.
        found[mine[away <= _FAR]] = main
    return _steady(stretches(measures.time, found, dt, stride), round(_SHORT / (dt * stride)))


def stretches(
    time: NDArray[np.float64], values: Sequence[str] | NDArray[np.object_], dt: float, stride: int
) -> Stretches:
    """Names over time as stretches of samples."""
    ticks = np.rint(time / dt).astype(np.int64)
    found: Stretches = []
    for tick, name in zip(ticks.tolist(), values, strict=True):
        if tick % stride == 0 and (not found or found[-1][1] != name):
            found.append((tick // stride, str(name)))
    return found


def _steady(found: Stretches, shortest: int) -> Stretches:
    """Merge stretches that are too short to look at into the preceding one."""
    kept: Stretches = []
    ends = [start for start, _ in found[1:]]
    for index, (start, name) in enumerate(found):
        # The last stretch is never too short: nothing follows it.
        lasting = index == len(ends) or ends[index] - start >= shortest
        if (not kept or lasting) and not (kept and kept[-1][1] == name):
            kept.append((start, name))
    return kept


_BRAKES = -1.0
"""Accelerations below this (m/s²) are braking"""
_STANDS = 0.1
"""Speeds below this (m/s) are standing"""
_ENDS = {"completed": "Its stop trigger ended the run", "timeout": "The time limit ended the run"}
_KMH = 3.6


class Sentence(NamedTuple):
    """A sentence, and the instant (s) that it is about; None where it is about the whole run."""

    text: str
    time: float | None = None


def account(result: RunResult) -> list[Sentence]:
    """The sentences, the most important one first."""
    ego = result.recording.tracks.get(result.ego) if result.ego is not None else None
    measures = result.criticality
    if ego is None or measures is None or not len(ego.columns["time"]):
        return [
            *_contacts(result),
            Sentence(f"{_ENDS.get(result.status, 'The run ended')} at {result.end_time:.2f} s."),
        ]
    if measures.impact is not None:
        return list(_contact(ego, measures, measures.impact))
    # Contacts within a step are in the log only: rows show none.
    brief = [entry for entry in result.events if entry.kind == "collision" and _is_of(entry, ego)]
    return [*map(_brief, brief[:1]), *_without_contact(result, ego, measures, bool(brief))]


def _is_of(entry: LogEntry, ego: Track) -> bool:
    return entry.subject == ego.name or entry.text == f"touches {ego.name}"


def _brief(entry: LogEntry) -> Sentence:
    """A contact that began and ended within a step: the rows show none."""
    told = f"{entry.subject} {entry.text} at {entry.time:.2f} s, between two steps."
    return Sentence(told, entry.time)


def _contacts(result: RunResult) -> Iterator[Sentence]:
    """Describe the contacts of a run without an ego."""
    contacts = [entry for entry in result.events if entry.kind == "collision"]
    for entry in contacts[:3]:
        yield Sentence(f"{entry.subject} {entry.text} at {entry.time:.2f} s.", entry.time)
    if not contacts:
        yield Sentence("Nobody touched anybody; there is no ego.")


# a contact ----------------------------------------------------------------------------------


def _contact(ego: Track, measures: Criticality, impact: Impact) -> Iterator[Sentence]:
    who = sentence(ego.name, impact.other, impact.side, impact.striking)
    speed = f"relative speed {impact.speed:.1f} m/s ({impact.speed * _KMH:.0f} km/h)"
    yield Sentence(f"{who} at {impact.time:.2f} s, {speed}.", impact.time)
    row = int(np.searchsorted(measures.time, impact.time - 1e-6))
    conflict = Conflict(measures.ego, measures.other(impact.other), row)
    began = _braking(ego, row)
    yield _began(ego, measures, began, row)
    yield from _needed(conflict, began, impact.time)


def _braking(ego: Track, row: int) -> int | None:
    """First row of the braking that lasts at a row, or ended up to half a second before it."""
    time, braking = ego.columns["time"], ego.columns["acceleration"] < _BRAKES
    rows = np.flatnonzero(braking[: row + 1] & (time[: row + 1] >= time[row] - 0.5))
    if not rows.size:
        return None
    before = np.flatnonzero(~braking[: rows[-1]])
    return (
        int(before[-1]) if before.size else 0
    )  # an acceleration is that of the step that ends at its row


def _began(ego: Track, measures: Criticality, began: int | None, row: int) -> Sentence:
    if began is None:
        stood = abs(float(ego.columns["speed"][row])) < _STANDS
        return Sentence(f"{ego.name} {'was standing' if stood else 'did not brake'}.")
    time, hardest = (
        float(ego.columns["time"][began]),
        -float(ego.columns["acceleration"][began : row + 1].min()),
    )
    ttc = (
        f", at a time to collision of {measures.ttc.value[began]:.2f} s"
        if measures.ttc.valid[began]
        else ""
    )
    return Sentence(
        f"{ego.name} began to brake at {time:.2f} s{ttc}, with up to {hardest:.1f} m/s².", time
    )


def _needed(conflict: Conflict, began: int | None, impact: float) -> Iterator[Sentence]:
    """Describe the braking needed at the start of the conflict, and the latest time for full
    braking."""
    if began is not None:
        least = conflict.least(float(conflict.ego.time[began]))
        if least is None:
            yield Sentence(
                f"By then no braking avoided it any more (more than {GREATEST_DECELERATION:.1f} "
                "m/s² was needed)."
            )
        else:
            yield Sentence(f"From then on, {least:.1f} m/s² would have avoided it.")
    latest = conflict.latest(FULL)
    if latest is None:
        yield Sentence("Full braking would not have avoided it at any time of the 10 s before.")
    else:
        earlier = impact - latest if began is None else float(conflict.ego.time[began]) - latest
        of = "before the contact" if began is None else "earlier"
        by = f" ({earlier:.2f} s {of})" if earlier > 0.0 else ""
        yield Sentence(
            f"Full braking ({FULL:.0f} m/s²) from {latest:.2f} s on{by} would have avoided it.",
            latest,
        )


# no contact ---------------------------------------------------------------------------------


def _without_contact(
    result: RunResult, ego: Track, measures: Criticality, touched: bool
) -> Iterator[Sentence]:
    """Describe a run without a contact of the ego in its rows.

    Args:
        touched: whether it has between two of them.
    """
    summary = measures.summary
    nearest, ttc = summary["min_distance"], summary["min_ttc"]
    if nearest is None:
        yield Sentence(f"{ego.name} met no other participant.")
    else:
        close = f"{nearest['value']:.2f} m to {nearest['other']}"
        begin = "The" if touched else f"{ego.name} had no contact; the"
        told = f"{begin} least distance was {close}, at {nearest['time']:.2f} s."
        yield Sentence(told, nearest["time"])
    if ttc is not None and ttc["value"] < 10.0:
        to = f"{ttc['value']:.2f} s to {ttc['other']}"
        yield Sentence(
            f"The least time to collision was {to}, at {ttc['time']:.2f} s.", ttc["time"]
        )
    acceleration = ego.columns["acceleration"]
    braking = np.flatnonzero(acceleration < _BRAKES)
    if braking.size:
        # An acceleration is that of the step that ends at its row: it began a row before.
        time = float(ego.columns["time"][max(int(braking[0]) - 1, 0)])
        hardest = -float(acceleration.min())
        yield Sentence(
            f"{ego.name} first braked at {time:.2f} s; its hardest braking was {hardest:.1f} m/s².",
            time,
        )


_LEVELS = {2: "act", 5: "event", 6: "action"}
"""Storyboard elements that are shown, by their depth: story, act, maneuver group, maneuver, event,
action"""
_STARTS = {"startTransition", "interventionStart", "collision"}
_ENDED = {
    "endTransition": "startTransition",
    "stopTransition": "startTransition",
    "interventionEnd": "interventionStart",
    "collisionEnd": "collision",
}
_ORDER = ("act", "event", "action", "intervention", "collision", "note")
_INIT = "Init::"
_SEPARATOR = "::"
_GROUP = 3
"""Depth of maneuver groups, which have the actors"""
_PAIR = " – "


@dataclass
class TimelineRow:
    """One thing over time.

    Args:
        level: one of act, event, action, intervention, collision, note.
        label: its own name. subject: its whole name, as in the event log.
        who: entities it concerns; empty for the whole run.
        bars: from when to when (s; None: to the end of the run), and why.
    """

    level: str
    label: str
    subject: str
    who: tuple[str, ...] = ()
    bars: list[tuple[float, float | None, str]] = field(default_factory=list)


def is_shown(entry: LogEntry) -> bool:
    """Whether a line of the event log is worth a line in a list, beyond the bookkeeping of the
    storyboard."""
    return not entry.kind.endswith("Transition") or (
        not entry.subject.startswith(_INIT) and _level(entry) != ""
    )


def rows(
    events: Iterable[LogEntry], actors: Mapping[str, tuple[str, ...]], names: Collection[str]
) -> list[TimelineRow]:
    """Rows in the order of the storyboard's levels, then of their first appearance.

    Args:
        actors: actors of each maneuver group, by its path.
        names: of all participants.
    """
    found: dict[tuple[str, str], TimelineRow] = {}
    for entry in events:
        level = _level(entry)
        if not level:
            continue
        who = tuple(name for name in _who(entry, level, actors) if name in names)
        key = (level, f"{_whole(entry)} {who}" if level == "note" else _whole(entry))
        if entry.kind in _ENDED:
            if key in found:
                _close(found[key], entry.time)
            continue
        row = found.setdefault(key, TimelineRow(level, _label(entry), _whole(entry), who))
        until = None if entry.kind in _STARTS else entry.time
        row.bars.append((entry.time, until, entry.text))
    # Initial actions that end at once would be bars without length.
    lasting = [
        row
        for row in found.values()
        if not row.subject.startswith(_INIT) or any(a != b for a, b, _ in row.bars)
    ]
    return sorted(lasting, key=lambda row: _ORDER.index(row.level))


def _who(entry: LogEntry, level: str, actors: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
    """The participants that a line may be about."""
    if level == "collision":
        return tuple(_whole(entry).split(_PAIR))
    parts = entry.subject.split(_SEPARATOR)
    # Other entries are about their subject itself.
    if not entry.kind.endswith("Transition"):
        return (entry.subject,)
    if entry.subject.startswith(_INIT):
        return tuple(parts[1:2])
    return actors.get(_SEPARATOR.join(parts[:_GROUP]), ()) if level != "act" else ()


def _close(row: TimelineRow, time: float) -> None:
    start, end, text = row.bars[-1]
    if end is None:
        row.bars[-1] = (start, time, text)


def _level(entry: LogEntry) -> str:
    """The level of the row that a line belongs to; empty for storyboard elements that are not
    shown."""
    if entry.kind.endswith("Transition"):
        return (
            "action"
            if entry.subject.startswith(_INIT)
            else _LEVELS.get(entry.subject.count(_SEPARATOR) + 1, "")
        )
    kind = _ENDED.get(entry.kind, entry.kind)
    return {"interventionStart": "intervention", "collision": "collision"}.get(kind, "note")


def _whole(entry: LogEntry) -> str:
    """Return the text that distinguishes rows of one level: both entities of a collision, the kind
    of notes."""
    level = _level(entry)
    if level == "collision":
        other = entry.text.removeprefix("no longer ").removeprefix("touches ")
        return f"{entry.subject}{_PAIR}{other}"
    return entry.kind if level == "note" else entry.subject


def _label(entry: LogEntry) -> str:
    whole = _whole(entry)
    return whole.rpartition(_SEPARATOR)[2] if entry.kind.endswith("Transition") else whole
