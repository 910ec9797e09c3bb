"""Draws from recordings: findings of rules and model in strata, vehicles at random."""

from __future__ import annotations

import json
import math
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.judging.kinematics import REASONS, Instant, instants
from recognition import recordings as datasets
from recognition.catalogue import detect
from recognition.catalogue.detect import KNOWN, Detection, Recogniser, joined
from recognition.catalogue.pipeline import looked
from recognition.catalogue.recordings import CatalogueSettings
from recognition.labels import Label, Rules
from recognition.labels.scene import EGOS
from recognition.recordings import Source, cache_roads
from recognition.scenes import place, site_of
from runner.recording import Recording, Track
from schemas.common.errors import InvalidFile, ToolchainError
from schemas.common.storage import read_object
from xodr.graph.network import RoadNetwork

RULES, MODEL, BOTH, BASELINE = "rules", "model", "both", "baseline"
CLASSES = tuple(label.title for label in Label if label is not Label.UNKNOWN)
SAME = 2.0
"""Time (s) around a finding within which another one of the same class and vehicle is the same
event"""
STRETCH, AROUND = 20.0, 10.0
"""Longest stretch (s) of a vehicle's track that a reviewer looks at; the same around a moment that
kinematics single out"""
_DRIVES, _LEAST = 10.0, 3.0
"""Least extent (m) and length (s) of a stretch in which a vehicle drives"""
_HELD, _TURN_TIME = 1.0, 6.0
"""Time (s) for which the baseline wants a lane held; time within which a heading changes in a turn
"""


@dataclass(frozen=True)
class Finding:
    """A finding of rules, of the model, of both, or of the plain baseline.

    Attributes:
        recording, site, vehicle, partner: names; partner is None without one.
        title: of the class.
        time, start, end: s.
        source: rules, model, both or the plain baseline.
    """

    recording: str
    site: str
    vehicle: str
    partner: str | None
    title: str
    time: float
    start: float
    end: float
    source: str


@dataclass(frozen=True)
class Item:
    """An item of a draw.

    Attributes:
        recording, site, vehicle: names.
        start, end: stretch of the recording that is looked at, s.
        finding: the finding to judge; None if all events of the vehicle are asked for.
        weight: number of findings in the population for which this one stands.
        found: findings of rules and model in the stretch, for the key.
        hidden: whether the reviewer has to say the class of the finding.
    """

    recording: str
    site: str
    vehicle: str
    start: float
    end: float
    finding: Finding | None = None
    weight: float = 1.0
    found: tuple[Finding, ...] = field(default=())
    hidden: bool = False


def find(
    recordings: Sequence[Path],
    model: Recogniser | None,
    rules: Rules = Rules(),  # noqa: B008
) -> list[Finding]:
    """Return the findings of the rules and of a model, if there is one, in recordings, as a
    catalogue would have them.

    Recordings that can't be read are named on stderr and left out.

    Args:
        model: sorts by its own labels, and gives no discovered classes.
        rules: their thresholds.
    """
    gap, events = CatalogueSettings().gap, {}
    sources = []
    for _, source in sources_of(recordings):
        try:
            recording, site, events[source.name] = looked(source, rules)
        except ToolchainError as error:
            print(f"left out: {error}", file=sys.stderr)
            continue
        sources.append(source)
        if model is not None:
            model.look(source.name, recording, site, events[source.name], lambda _: None)
    found: list[Finding] = []
    for source in sources:
        by_rules = joined(map(detect.by_rules, events[source.name]), gap)
        labelled = (
            moment
            for moment in (model.moments(source.name) if model is not None else ())
            if moment.state == KNOWN and moment.title in CLASSES
        )
        found += merged(source.name, source.site, by_rules, joined(labelled, gap))
    return sorted(
        found, key=lambda one: (one.recording, one.vehicle, one.time, one.title, one.source)
    )


def merged(
    recording: str, site: str, by_rules: Sequence[Detection], by_model: Sequence[Detection]
) -> Iterator[Finding]:
    """Yield the findings in a recording: of the rules, by both if the model has the same, and the
    others of the model."""
    for own, others, source in (by_rules, by_model, RULES), (by_model, by_rules, MODEL):
        for one in own:
            moment, shared = one.moment, any(_same(one, other) for other in others)
            if source == RULES or not shared:
                by = BOTH if shared else source
                partner = moment.partner if source == RULES else None
                yield Finding(
                    recording,
                    site,
                    moment.ego,
                    partner,
                    moment.title,
                    moment.time,
                    one.start,
                    one.end,
                    by,
                )


def _same(one: Detection, other: Detection) -> bool:
    """Whether two findings are of the same class and vehicle at about the same time."""
    alike = (one.moment.ego, one.moment.title) == (other.moment.ego, other.moment.title)
    return alike and max(one.start, other.start) - min(one.end, other.end) <= SAME


def write_findings(found: Sequence[Finding], path: Path) -> None:
    """Write findings as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        json.dumps({"findings": [asdict(one) for one in found]}, indent=1) + "\n", encoding="utf-8"
    )


def read_findings(path: Path) -> list[Finding]:
    """Read what `write_findings` wrote.

    Raises:
        InvalidFile: it is not readable.
    """
    try:
        return [Finding(**one) for one in read_object(path)["findings"]]
    except (KeyError, TypeError) as error:
        raise InvalidFile(f"these are no findings: {error}", path=path) from None


def draw_findings(everything: Sequence[Finding], number: int, seed: int) -> list[Item]:
    """Draw findings: as many of each source, and within a source by the root of the number of each
    class."""
    generator = np.random.default_rng(seed)
    sources = [
        source for source in (RULES, MODEL, BOTH) if any(one.source == source for one in everything)
    ]
    items = []
    for source in sources:
        strata = _by_class(one for one in everything if one.source == source)
        for stratum, count in zip(
            strata, _shares([len(each) for each in strata], number // len(sources)), strict=True
        ):
            chosen = generator.choice(len(stratum), count, replace=False)
            items += [
                _item(stratum[index], len(stratum) / count) for index in sorted(chosen.tolist())
            ]
    return [items[index] for index in generator.permutation(len(items)).tolist()]


def draw_hidden(
    everything: Sequence[Finding], library: Library, number: int, seed: int
) -> list[Item]:
    """Draw so many findings of each set of recordings, whose classes reviewers have to say."""
    items = []
    for name in sorted(set(library.sets.values())):
        of = [
            one
            for one in everything
            if one.title in CLASSES and library.sets.get(one.recording) == name
        ]
        items += [replace(item, hidden=True) for item in draw_findings(of, number, seed)]
    return items


def _item(one: Finding, weight: float) -> Item:
    return Item(one.recording, one.site, one.vehicle, one.start, one.end, one, weight)


def _by_class(found: Iterable[Finding]) -> list[list[Finding]]:
    strata: dict[str, list[Finding]] = {}
    for one in found:
        strata.setdefault(one.title, []).append(one)
    return [strata[title] for title in sorted(strata)]


def _shares(sizes: Sequence[int], number: int) -> list[int]:
    """Numbers to draw from strata: one from each, the others by the root of their sizes."""
    counts = [1] * len(sizes)
    while sum(counts) < min(number, sum(sizes)):
        wanting = [
            math.sqrt(size) / count if count < size else 0.0
            for size, count in zip(sizes, counts, strict=True)
        ]
        counts[int(np.argmax(wanting))] += 1
    return counts


def draw_vehicles(
    everything: Sequence[Finding],
    library: Library,
    number: int,
    seed: int,
    singled_out: bool = False,
) -> list[Item]:
    """Draw vehicles that drive, in turn from each set of recordings, and a stretch of each track.

    Args:
        singled_out: draw only stretches around moments that plain kinematics single out
            (`kinematics.instants`), as many of each reason as there are.
    """
    generator = np.random.default_rng(seed)
    sets: dict[str, list[Source]] = {}
    for name, source in library.sources:
        sets.setdefault(name, []).append(source)
    waiting = {
        name: [of[index] for index in generator.permutation(len(of)).tolist()]
        for name, of in sorted(sets.items())
    }
    items: list[Item] = []
    used: Counter[str] = Counter()
    while len(items) < number and any(waiting.values()):
        for of in filter(None, waiting.values()):
            source = of.pop(0)
            if not library.readable(source.name):
                continue
            taken = {(one.recording, one.vehicle) for one in items}
            stretches = [
                one
                for one in _stretches(source.name, library, generator, singled_out)
                if (one.recording, one.vehicle) not in taken
            ]
            if stretches and len(items) < number:
                rarest = min(
                    (one.reason for one in stretches),
                    key=lambda reason: (used[reason], REASONS.index(reason)),
                )
                stretches = [one for one in stretches if one.reason == rarest]
                recording, vehicle, start, end, _ = stretches[
                    int(generator.integers(len(stretches)))
                ]
                used[rarest] += 1
                own = (
                    one
                    for one in everything
                    if (one.recording, one.vehicle) == (recording, vehicle)
                )
                inside = tuple(one for one in own if one.end > start and one.start < end)
                plain = baseline(library, recording, source.site, vehicle, start, end)
                items.append(
                    Item(recording, source.site, vehicle, start, end, found=(*inside, *plain))
                )
                of.append(source)
    return items


def baseline(
    library: Library, recording: str, site: str, vehicle: str, start: float, end: float
) -> list[Finding]:
    """Return the findings of a plain baseline in a stretch: what the lane number and the heading
    alone tell.

    Another lane of the same road, held for a second after one that was held as long, is a lane
    change. A change of the heading by 45 to 135 degrees within 6 s is a turn.
    """
    track = library.recording(recording).tracks[vehicle]
    place(library.recording(recording), library.network(recording))
    columns = track.columns
    rows = np.flatnonzero((columns["time"] >= start) & (columns["time"] <= end))
    time, lane, road = (
        columns["time"][rows],
        columns["lane_id"][rows].astype(int),
        columns["road_id"][rows],
    )
    found = []
    for row in (
        np.flatnonzero(
            (lane[1:] != lane[:-1]) & (road[1:] == road[:-1]) & (lane[1:] * lane[:-1] > 0)
        )
        + 1
    ).tolist():
        before, after = (
            (time < time[row]) & (time >= time[row] - _HELD),
            (time >= time[row]) & (time <= time[row] + _HELD),
        )
        if (lane[before] == lane[row - 1]).all() and (lane[after] == lane[row]).all():
            forward = (
                library.network(recording)
                .roads[road[row]]
                .direction(int(lane[row]), float(columns["s"][rows][row]))
                > 0
            )
            left = (lane[row] > lane[row - 1]) == forward
            found.append(("left lane change" if left else "right lane change", float(time[row])))
    heading, last = np.degrees(np.unwrap(columns["h"][rows])), -np.inf
    step = max(round(_TURN_TIME / library.recording(recording).timestep), 1)
    for row in range(len(rows)):
        turned = heading[min(row + step, len(rows) - 1)] - heading[row]
        if 45.0 <= abs(turned) <= 135.0 and time[row] > last:
            middle = float(time[row]) + 0.5 * _TURN_TIME
            found.append(
                ("unsignalised left turn" if turned > 0.0 else "unsignalised right turn", middle)
            )
            last = time[row] + 2.0 * _TURN_TIME
    return [
        Finding(recording, site, vehicle, None, title, at, at - 0.75, at + 0.75, BASELINE)
        for title, at in found
    ]


class _RoadStretch(NamedTuple):
    """A part of a vehicle's track (s), and why it was chosen."""

    recording: str
    vehicle: str
    start: float
    end: float
    reason: str


def _stretches(
    name: str, library: Library, generator: np.random.Generator, singled_out: bool
) -> list[_RoadStretch]:
    """Stretches of the tracks of vehicles that drive: one of each at random, or one around each
    moment singled out."""
    recording, chosen = library.recording(name), list[_RoadStretch]()
    drivers = [track for track in recording.tracks.values() if track.category in EGOS]
    found = library.instants(name) if singled_out else {}
    for track in drivers:
        first, last = float(track.columns["time"][0]), float(track.columns["time"][-1])
        if singled_out:
            starts = [
                (max(one.time - 0.5 * AROUND, first), AROUND, one.reason)
                for one in found[track.name]
            ]
        else:
            starts = [
                (float(generator.uniform(first, max(last - STRETCH, first))), STRETCH, REASONS[0])
            ]
        chosen += [
            _RoadStretch(name, track.name, start, min(start + long, last), why)
            for start, long, why in starts
        ]
    return [one for one in chosen if _drives(recording.tracks[one.vehicle], one)]


def _drives(track: Track, stretch: _RoadStretch) -> bool:
    time = track.columns["time"]
    rows = (time >= stretch.start) & (time <= stretch.end)
    extent = math.hypot(*(float(np.ptp(track.columns[axis][rows])) for axis in "xy"))
    return extent >= _DRIVES and float(np.ptp(time[rows])) >= _LEAST


class Library:
    """Recordings in paths, each read once.

    A recording belongs to a set: the folder directly below the given path that it is in.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self.sources = sources_of(paths)
        self.sets = {source.name: name for name, source in self.sources}
        self._of = {source.name: source for _, source in self.sources}
        self._recordings: dict[str, Recording] = {}
        self._networks: dict[str, RoadNetwork] = {}
        self._instants: dict[str, dict[str, list[Instant]]] = {}

    def readable(self, name: str) -> bool:
        """Whether a recording and its roads can be read; one that can't is named on stderr."""
        try:
            self.network(name)
        except ToolchainError as error:
            print(f"left out: {error}", file=sys.stderr)
            return False
        return True

    def recording(self, name: str) -> Recording:
        """Return a recording by its name."""
        if name not in self._recordings:
            self._recordings[name] = self._of[name].load()
        return self._recordings[name]

    def instants(self, name: str) -> dict[str, list[Instant]]:
        """Return the moments that plain kinematics single out, by vehicle."""
        if name not in self._instants:
            self._instants[name] = instants(self.recording(name))
        return self._instants[name]

    def network(self, name: str) -> RoadNetwork:
        """Return the roads of a recording by its name."""
        if name not in self._networks:
            self._networks[name] = site_of(
                self._of[name], self.recording(name), cache_roads()
            ).network
        return self._networks[name]


def sources_of(recordings: Sequence[Path]) -> list[tuple[str, Source]]:
    """Recordings in paths, each with the name of its set: the folder directly below the path that
    it is in."""
    found = []
    for path in recordings:
        for source in datasets.open(path).sources:
            below = source.path.relative_to(path).parts if path.is_dir() else ()
            found.append((below[0] if len(below) > 1 else path.stem, source))
    return found
