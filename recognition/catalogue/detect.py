"""Detections: classes found in a recording by rules or by a model, and the episodes cut out about
them."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, NamedTuple, Protocol

import numpy as np

from recognition.labels.classes import Label, LabelledEvent
from recognition.labels.critical import UNNAMED
from recognition.recordings.intake import Exclusion
from recognition.scenes import Site
from runner.recording import Recording, Track
from xodr.graph.network import RoadNetwork
from xodr.model import RoadPoint

KNOWN, UNKNOWN, DISCOVERED = "known", "unknown", "discovered"
RULES, MODEL = "rules", "model"
"""Sources of the labels that sort a catalogue"""
WINDOW = 1.5
"""Length (s) of what is looked at about a moment"""


@dataclass(frozen=True)
class Moment:
    """A window of a recording about one ego, labelled.

    Attributes:
        ego: name of the track.
        time: the middle of the window, s.
        title: name of the class that it is sorted by: one of the 17, `unknown`, or a discovered
            class.
        state: known, unknown or discovered.
        rule: what the rules say, UNKNOWN for nothing.
        model: the model's label: one of the 17, `unknown`, or a discovered class; None without a
            model.
        nearest: of the known classes the one that the model takes it for rather than any other;
            None without a model.
        confidence: of the model in `nearest`, in [0, 1]; None without.
        partner, tags, why, severity, critical, participants: of the event.
    """

    ego: str
    time: float
    title: str
    state: str
    rule: Label = Label.UNKNOWN
    model: str | None = None
    nearest: str | None = None
    confidence: float | None = None
    partner: str | None = None
    tags: dict[str, bool | float] = field(default_factory=dict)
    why: str = ""
    severity: float | None = None
    critical: str = ""
    participants: tuple[str, ...] = ()

    @property
    def trust(self) -> str:
        """Agreement of rules and model: `agree`, `differ`, `rules alone`, `model alone` or, of no
        class, `measures`."""
        if self.labels_agree is None and not self.rule and self.severity is not None:
            return "measures"
        if self.labels_agree is None:
            return "rules alone" if self.rule else "model alone"
        return "agree" if self.labels_agree else "differ"

    @property
    def labels_agree(self) -> bool | None:
        """Whether rules and model say the same; None where one of them says nothing."""
        return self.model == self.rule.title if self.rule and self.model is not None else None


@dataclass(frozen=True)
class Detection:
    """A stretch of a recording in which one class is recognised about one ego.

    Attributes:
        moment: the one with a rule's event, if any, else the one with most confidence.
        start, end: of the windows, s.
        moments: how many there are.
    """

    moment: Moment
    start: float
    end: float
    moments: int


def by_rules(event: LabelledEvent) -> Moment:
    """The moment of a rule's event, or of a critical one of no class, without a model."""
    named = bool(event.label)
    return Moment(
        event.ego,
        event.time,
        event.label.title if named else UNNAMED,
        KNOWN if named else UNKNOWN,
        event.label,
        partner=event.partner,
        tags=event.tags,
        why=event.why,
        severity=event.severity,
        critical=event.critical,
        participants=event.participants,
    )


Advance = Callable[[float], None]
"""Called with the share of some work that is done, after each part of it; they add up to 1."""


class Recogniser(Protocol):
    """Labels moments of recordings: it looks at all of them, then gives the moments of each."""

    @property
    def sorted_by(self) -> str:
        """Source of the labels that sort the moments: `RULES` or `MODEL`."""
        ...

    def look(
        self,
        name: str,
        recording: Recording,
        site: Site,
        events: list[LabelledEvent],
        advance: Advance,
    ) -> None:
        """Take in a recording and the events that rules have found in it."""
        ...

    by_rules: bool
    """Whether the moments are those of the rules, which depend on no other recording"""
    discovers: bool
    """Whether it gives moments of classes that it discovers"""
    name: str
    """Tells its labels from those of another one: findings of two are not mixed in one store"""

    def moments(self, name: str) -> list[Moment]:
        """The moments of a recording that was looked at; asked for once."""
        ...


class ByRules:
    """The rules alone."""

    sorted_by = RULES
    by_rules, discovers, name = True, False, RULES

    def __init__(self) -> None:
        self._events: dict[str, list[LabelledEvent]] = {}

    def look(
        self,
        name: str,
        recording: Recording,
        site: Site,
        events: list[LabelledEvent],
        advance: Advance,
    ) -> None:
        """Keep the events."""
        self._events[name] = events
        advance(1.0)

    def moments(self, name: str) -> list[Moment]:
        """One for each event."""
        return [by_rules(event) for event in self._events.pop(name)]


def joined(moments: Iterable[Moment], gap: float) -> list[Detection]:
    """Findings, sorted by ego and time.

    Args:
        gap: greatest time between the windows of one finding, s.
    """
    # By class too: what is of two classes at a time is a scenario of each.
    groups: dict[tuple[str, str], list[Moment]] = {}
    for moment in moments:
        groups.setdefault((moment.ego, moment.title), []).append(moment)
    found = [_detection(run) for group in groups.values() for run in _runs(group, gap)]
    return sorted(
        found, key=lambda finding: (finding.moment.ego, finding.moment.time, finding.moment.title)
    )


def _runs(moments: Iterable[Moment], gap: float) -> list[list[Moment]]:
    """Moments that follow each other closely, and have no two partners."""
    runs: list[list[Moment]] = []
    for moment in sorted(moments, key=lambda moment: (moment.time, moment.partner or "")):
        # A model's moments have no partner: they join any run; two different partners are two
        # encounters.
        partners = {member.partner for member in runs[-1]} - {None} if runs else set()
        other = moment.partner is not None and bool(partners - {moment.partner})
        if not runs or other or moment.time - runs[-1][-1].time > WINDOW + gap:
            runs.append([])
        runs[-1].append(moment)
    return runs


def _detection(moments: Sequence[Moment]) -> Detection:
    best = max(
        moments,
        key=lambda moment: (
            # A rule's event has the exact time and the partner; then the gravest, the surest, the
            # earliest.
            bool(moment.rule),
            moment.severity or 0.0,
            moment.confidence or 0.0,
            -moment.time,
        ),
    )
    return Detection(
        best, moments[0].time - WINDOW / 2, moments[-1].time + WINDOW / 2, len(moments)
    )


@dataclass(frozen=True)
class EgoRequirements:
    """Requirements on an ego vehicle.

    Attributes:
        duration: least time that it was recorded, s.
        extent: least diagonal of the area that it moves in, m.
        gap: greatest time without a row, s.
        speed: greatest speed from row to row, m/s: beyond, tracks jump.
        on_road: least share of rows on a lane.
    """

    duration: float = 1.5
    extent: float = 10.0
    gap: float = 2.0
    speed: float = 80.0
    on_road: float = 0.5


class EgoVehicle(NamedTuple):
    """A vehicle that is an ego: its name, when it was recorded first and last (s), and how it
    passes."""

    name: str
    start: float
    end: float
    passage: str


def vehicles(
    recording: Recording, network: RoadNetwork, needs: EgoRequirements
) -> tuple[list[EgoVehicle], list[Exclusion]]:
    """The vehicles that are egos, and an exclusion for each other vehicle.

    The recording must have its road coordinates.
    """
    egos, exclusions = [], []
    for track in recording.tracks.values():
        if track.kind != "vehicle":
            continue
        reasons = list(_reasons(track, network, needs))
        if reasons:
            exclusions.append(Exclusion(track.name, len(track.columns["time"]), "; ".join(reasons)))
        else:
            time = track.columns["time"]
            egos.append(EgoVehicle(track.name, float(time[0]), float(time[-1]), passage(track)))
    return egos, exclusions


def _reasons(track: Track, network: RoadNetwork, needs: EgoRequirements) -> Iterator[str]:
    columns = track.columns
    time, (x, y) = columns["time"], centre(track)
    # A declared participant that never appears has a track without rows.
    if not len(time):
        yield "never recorded"
        return
    # The checks below need rows to compare.
    if time[-1] - time[0] < needs.duration:
        yield f"recorded for {time[-1] - time[0]:.1f} s only"
        return
    # The extent, not the way: places of a parked vehicle jitter, and add up to a long way.
    extent = math.hypot(np.ptp(x), np.ptp(y))
    if extent < needs.extent:
        yield f"moves within {extent:.1f} m only"
    steps = np.diff(time)
    if steps.max() > needs.gap:
        yield f"not recorded for {steps.max():.1f} s in between"
    speed = float((np.hypot(np.diff(x), np.diff(y)) / steps).max())
    if speed > needs.speed:
        yield f"jumps at {speed:.0f} m/s"
    # A vehicle beside the map drives where the scenario has no road to play it on.
    share = _on_road(track, network)
    if share < needs.on_road:
        yield f"on a road for {share:.0%} of its rows only"


def centre(track: Track) -> tuple[np.ndarray, np.ndarray]:
    """World x and y of the middle of a track's box, m."""
    columns, box = track.columns, track.box
    cos, sin = np.cos(columns["h"]), np.sin(columns["h"])
    return columns["x"] + box.x * cos - box.y * sin, columns["y"] + box.x * sin + box.y * cos


def _on_road(track: Track, network: RoadNetwork) -> float:
    columns = track.columns
    names = ("road_id", "s", "t", "lane_id", "lane_offset")
    return float(
        np.mean(
            [
                network.on_road(RoadPoint(*place))
                for place in zip(*(columns[name].tolist() for name in names), strict=True)
            ]
        )
    )


def passage(track: Track, reach: float = 5.0) -> str:
    """Return the direction of a passage (left, right, straight, back), from the headings of its
    first and last metres.

    Args:
        reach: way (m) over which the direction is taken.
    """
    # Of the box, not of the reference point: recorded headings that jump would move that.
    x, y = centre(track)
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    # First and last part must not overlap on short ways.
    reach = min(reach, way[-1] / 3)
    a, b = int(np.searchsorted(way, reach)), int(np.searchsorted(way, way[-1] - reach))
    first, last = math.atan2(y[a] - y[0], x[a] - x[0]), math.atan2(y[-1] - y[b], x[-1] - x[b])
    turn = math.degrees(math.remainder(last - first, math.tau))
    if abs(turn) > 135.0:
        return "back"
    return "straight" if abs(turn) < 45.0 else "left" if turn > 0.0 else "right"


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
        finding: what was recognised; for a vehicle's scene the most telling of all findings, None
            for nothing.
        passage: how a vehicle passes, where the scene is all that was recorded of it.
    """

    folder: str
    name: str
    title: str
    state: str
    ego: str
    start: float
    end: float
    finding: Detection | None
    passage: str | None = None

    @property
    def label(self) -> Label:
        """The class, as far as it is one of the 17."""
        return _LABELS.get(self.title, Label.UNKNOWN)

    def as_json(self) -> str:
        """Return all of it as text, for `of_json`; numbers keep every digit."""
        return json.dumps(asdict(self), ensure_ascii=False, default=_plain_number)

    @classmethod
    def of_json(cls, text: str) -> Episode:
        """Return the episode that was written as text."""
        values = json.loads(text)
        finding = values.pop("finding")
        if finding is not None:
            moment = finding.pop("moment")
            moment |= {
                "rule": Label(moment["rule"]),
                "participants": tuple(moment["participants"]),
            }
            finding = Detection(Moment(**moment), **finding)
        return cls(**values, finding=finding)


def _plain_number(value: Any) -> Any:
    """The number of Python's own that a number of numpy is."""
    return value.item()


def of_findings(recording: str, findings: Iterable[Detection], around: Around) -> list[Episode]:
    """A scenario for each finding, in the folder of its class."""
    episodes = []
    for finding in findings:
        moment = finding.moment
        # Padded: names in the order of letters are in that of time.
        name = f"{plain(recording)}_{plain(moment.ego)}_{moment.time:07.2f}"
        start, end = finding.start - around.before, finding.end + around.after
        episodes.append(
            Episode(
                plain(moment.title),
                name,
                moment.title,
                moment.state,
                moment.ego,
                start,
                end,
                finding,
            )
        )
    return _distinct(episodes)


def of_vehicles(
    recording: str, vehicles: Iterable[EgoVehicle], findings: Sequence[Detection]
) -> list[Episode]:
    """A scenario for each vehicle, of its whole track."""
    episodes = []
    for ego, start, end, passage in vehicles:
        own = [finding for finding in findings if finding.moment.ego == ego]
        best = max(
            own,
            key=lambda finding: (
                _LABELS.get(finding.moment.title, Label.UNKNOWN),
                -finding.moment.time,
            ),
            default=None,
        )
        title, state = (
            (best.moment.title, best.moment.state) if best is not None else (UNLABELLED, UNLABELLED)
        )
        name = f"{plain(recording)}_{plain(ego)}"
        episodes.append(Episode(VEHICLES, name, title, state, ego, start, end, best, passage))
    return _distinct(episodes)


def plain(text: str) -> str:
    """Text as part of a file's name."""
    return _UNFIT.sub("_", text).strip("._") or "_"


def _distinct(episodes: list[Episode]) -> list[Episode]:
    """Episodes with names that are unique in their folders, also on file systems without case."""
    seen: dict[str, int] = {}
    distinct = []
    for episode in episodes:
        # Windows and macOS take `Left` and `left` for one file.
        key = f"{episode.folder}/{episode.name}".casefold()
        seen[key] = seen.get(key, 0) + 1
        distinct.append(
            episode if seen[key] == 1 else replace(episode, name=f"{episode.name}_{seen[key]}")
        )
    return distinct
