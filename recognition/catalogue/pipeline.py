"""Recordings to a catalogue, and labels for the results of runs.

A catalogue is made in passes over its recordings, each in parallel, by functions of
`recognition.catalogue.recordings`: `read` loads, places and labels a recording and keeps it on the
store (a folder of the catalogue); the recogniser looks at each; `episodes` cuts the moments into
scenes, and `write` writes their scenarios, in blocks; `played` plays each scenario once. Where
moments do not depend on other recordings, as those of the rules, the first three go over some
recordings at a time, so that findings are held of these alone. What happens in a run is written
down about the scenario that it is a run of.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

import xosc
from recognition import recordings as datasets
from recognition.catalogue import detect, recordings
from recognition.catalogue.detect import Detection, Episode, Moment, by_rules
from recognition.catalogue.recordings import (
    Block,
    CatalogueSettings,
    LabelledRecording,
    RecordingLocation,
    RecordingStore,
    TrialBlock,
    looked,
)
from recognition.catalogue.writing.index import Catalogue, recordings_of
from recognition.catalogue.writing.store import digests, write_unless_edited
from recognition.catalogue.writing.write import AUTHOR
from recognition.labels import LabelledEvent
from recognition.recordings import Report, Source
from recognition.recordings.formats import runs
from recognition.recordings.intake import REPAIRED
from recognition.scenes import LIT, Site
from runner.batch.pool import Workers, results
from runner.recording import Recording
from schemas.common.errors import InvalidFile, ToolchainError, Unsupported, UsageError
from schemas.common.storage import digest
from schemas.common.terminal.files import LIBRARY
from schemas.common.terminal.text import many
from xosc.document import to_bytes
from xosc.writing import tags
from xosc.writing.tags import Tag

if TYPE_CHECKING:
    from schemas.common.terminal.command_line import Bar


SHIPPED = Path(__file__).resolve().parents[1] / "models" / "cpu"
"""The model that comes with the package"""
_STORE = ".recordings"
"""Folder for what was read, in that of the catalogue, until this is finished"""


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

    by_recording: bool
    """Whether the moments of a recording depend on no other one"""

    def moments(self, name: str) -> list[Moment]:
        """The moments of a recording that was looked at; asked for once."""
        ...


class ByRules:
    """The rules alone."""

    sorted_by = detect.RULES
    by_recording = True

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


class Summary(NamedTuple):
    """Outcome of the recordings.

    classes: scenarios by title of the class. passages: vehicles' scenes by how they pass.
    exclusions: vehicles without a scene. colliding: scenarios in which the ego touches another one
    from the start, as recorded. edited: files that a person has edited, left alone. removed: files
    of earlier runs that are no longer part of the catalogue. failures: recordings that could not be
    read, and why. skipped: files of an unknown format. repaired: recordings that were repaired, and
    why. unplayable: scenarios that do not play, which are not part of the catalogue, and why.
    unlit: recordings of junctions with traffic lights whose passages the rules do not count.
    """

    classes: Counter[str]
    passages: Counter[str]
    exclusions: list[dict[str, Any]]
    colliding: list[str]
    edited: list[str]
    removed: list[str]
    failures: dict[str, ToolchainError]
    skipped: list[Path]
    repaired: dict[str, str]
    unplayable: dict[str, str]
    unlit: int


Selection = Mapping[str, frozenset[tuple[str, str]]]
"""Folders and names of the scenarios that are wanted of each recording, by its name"""

_PART = 50
"""Number of recordings with findings in memory at a time"""
_EPISODES = 25
"""Scenarios of a recording that are written at a time"""
_READ = 0.5
"""Share of the progress of a recording when it has been read"""


@contextmanager
def _silent(_description: str, _steps: int) -> Iterator[Advance]:
    """Show no progress."""
    yield lambda _: None


def build(
    paths: Sequence[Path],
    out: Path,
    settings: CatalogueSettings | None = None,
    recogniser: Callable[[], Recogniser] = ByRules,
    bar: Bar = _silent,
    workers: Workers = Workers(),  # noqa: B008 - immutable
    selection: Selection | None = None,
) -> Summary:
    """Make a catalogue of the recordings in files and folders, with the same
    bytes for any number of workers.

    A recording that can't be read does not keep the others from their place in the catalogue.
    Recordings that were read before an interruption are not read again by the next call.

    Args:
        settings: for recognising and writing; the defaults if None.
        recogniser: recogniser factory, the rules by default.
        bar: shows how many recordings are recognised, and how many scenarios are written.
        workers: processes that read, label and write the recordings.
        selection: the scenarios to write; all, if None.

    Raises:
        InvalidFile: there is no recording of a known format in a path.
        UsageError: the folder can't be written or has the catalogue of other recordings, or two
            recordings have one name.

    Example:
        >>> from pathlib import Path
        >>> import xosc_toolchain as xt
        >>> from runner.batch.outputs.folder import write_run
        >>> result = xt.run("xosc/library/cut_in_highway.xosc", world="kinematic")
        >>> written = write_run(result, Path("run"))
        >>> sorted(xt.recognise([Path("run")], Path("catalogue")).classes)
        ['highway car following', 'highway cut in', 'highway free cruise', 'right lane change']
    """
    settings = settings or CatalogueSettings()
    recordings.forget()  # another call in this process may be of other files with the same names
    sources = recordings.opened(tuple(paths), settings.road, settings.columns)
    refuse_twins(sources)
    if selection is not None:
        sources = [source for source in sources if source.name in selection]
    _refuse_others(out, {source.name for source in sources})
    work = _CatalogueBuild(out, settings, recogniser(), workers, selection)
    for part in work.parts(sources):
        locations = [
            RecordingLocation(
                tuple(paths), source.name, out / _STORE, settings.road, settings.columns
            )
            for source in part
        ]
        with results(partial(recordings.read, settings), locations, workers) as found:
            labelled = work.take(part, found, bar)
        work.write(labelled, bar)
    work.play(bar)
    return work.close(
        [
            file
            for found in recordings.listed(tuple(paths), settings.columns)
            for file in found.skipped
        ]
    )


def refuse_twins(sources: Sequence[Source]) -> None:
    """Recordings are distinguished by name; those below one folder get names that differ."""
    first: dict[str, Source] = {}
    for source in sources:
        # Names of recordings become names of files, and keys of the index.
        other = first.setdefault(source.name, source)
        if other is not source:
            message = (
                f"{other.path} has a recording called {source.name!r} too: give each once, in one "
                "folder that holds both"
            )
            raise UsageError(message, path=source.path)


def _refuse_others(out: Path, names: set[str]) -> None:
    """A catalogue is made of all its recordings at once: what is not among them would go."""
    others = sorted(set(recordings_of(out)) - names)
    if others:
        listed = f"{others[0]!r}" + (f" and {len(others) - 1} more" if len(others) > 1 else "")
        raise UsageError(
            f"this folder has a catalogue of other recordings ({listed}): give them as well, or "
            "another folder",
            path=out,
        )


class _CatalogueBuild:
    """One catalogue in the making."""

    def __init__(
        self,
        out: Path,
        settings: CatalogueSettings,
        recogniser: Recogniser,
        workers: Workers,
        selection: Selection | None,
    ) -> None:
        self._selection = selection
        self._trials: list[TrialBlock] = []
        self._repaired: dict[str, str] = {}
        self._out, self._settings, self._recogniser, self._workers = (
            out,
            settings,
            recogniser,
            workers,
        )
        self._catalogue = Catalogue(
            out, settings.config, recogniser.sorted_by, selected=selection is not None
        )
        self._store = RecordingStore(out / _STORE)
        self._failures: dict[str, ToolchainError] = {}

    def parts(self, sources: Sequence[Source]) -> Iterator[Sequence[Source]]:
        """Yield the recordings in parts, each of which is read and written before the next: all at
        once where they decide together which class a moment has."""
        size = _PART if self._recogniser.by_recording else max(len(sources), 1)
        for start in range(0, len(sources), size):
            yield sources[start : start + size]

    def take(
        self,
        sources: Sequence[Source],
        found: Iterator[LabelledRecording | ToolchainError],
        bar: Bar,
    ) -> list[tuple[Source, LabelledRecording]]:
        """Have the recogniser look at the recordings in their order, as they have been read; those
        that could be read."""
        taken = []
        with bar("recognising", len(sources)) as advance:
            for source, labelled in zip(sources, found, strict=True):
                # A recording that can't be read is named in the summary; the others go on.
                if isinstance(labelled, ToolchainError):
                    self._failures[source.name] = labelled
                    advance(1.0)
                    continue
                advance(_READ)
                recording, rest = (
                    recordings.recorded(labelled.placed.location),
                    _part(advance, 1.0 - _READ),
                )
                self._recogniser.look(
                    source.name, recording, labelled.placed.site, labelled.events, rest
                )
                if labelled.report.verdict == REPAIRED:
                    self._repaired[source.name] = _repairs(labelled.report)
                taken.append((source, labelled))
        return taken

    def write(self, taken: Sequence[tuple[Source, LabelledRecording]], bar: Bar) -> None:
        """Write the scenarios of the recordings."""
        work = partial(recordings.write, self._out, self._settings, self._recogniser.sorted_by)
        blocks = [block for source, labelled in taken for block in self._blocks(source, labelled)]
        # Blocks, not recordings: one long recording keeps all workers busy too.
        count = sum(len(block.episodes) for block in blocks)
        with bar("writing", count) as advance, results(work, blocks, self._workers) as done:
            for block, one in zip(blocks, done, strict=True):
                self._catalogue.take(one.written)
                self._trials.append(TrialBlock(block.placed.location, one.written.trials))
                if one.error is not None:
                    self._failures[block.placed.location.name] = one.error
                advance(len(block.episodes))

    def play(self, bar: Bar) -> None:
        """Play every scenario once: what does not play is no part of the catalogue."""
        # OpenSCENARIO catalogues that recordings share are complete only after the last of them.
        self._catalogue.write_catalogs()
        trials = self._trials
        play = partial(recordings.played, self._out)
        with (
            bar("playing", sum(len(block.trials) for block in trials)) as advance,
            results(play, trials, self._workers) as done,
        ):
            outcomes = []
            for trial, played in zip(trials, done, strict=True):
                outcomes += played
                advance(len(trial.trials))
        self._catalogue.judge(outcomes)

    def close(self, skipped: list[Path]) -> Summary:
        """Finish the catalogue; `skipped` are the files that no format claims."""
        catalogue = self._catalogue
        rows = catalogue.rows
        failures = {name: str(error) for name, error in self._failures.items()}
        removed = catalogue.close(failures=failures, skipped=[file.name for file in skipped])
        self._store.clear()
        return Summary(
            Counter(row["class"] for row in rows),
            Counter(row["passage"] for row in rows if row["passage"]),
            catalogue.exclusions,
            [row["file"] for row in rows if row["collision_time"] == 0.0],
            catalogue.store.edited,
            removed,
            self._failures,
            skipped,
            self._repaired,
            catalogue.unplayable,
            0 if self._settings.rules.signalised else catalogue.remarked(LIT),
        )

    def _blocks(self, source: Source, labelled: LabelledRecording) -> Iterator[Block]:
        """Yield the blocks to be written of a recording, whose road and index
        entry are written first.
        """
        self._catalogue.register(source, labelled.report, labelled.exposure, labelled.exclusions)
        # In this process: workers that write blocks of one recording must not write one road file
        # twice.
        road = self._catalogue.road(labelled.placed.road)
        episodes = recordings.episodes(
            self._settings, labelled, self._recogniser.moments(source.name)
        )
        if self._selection is not None:
            episodes = self._selected(source, episodes, self._selection[source.name])
        for start in range(0, len(episodes), _EPISODES):
            yield Block(labelled.placed, road, episodes[start : start + _EPISODES])

    def _selected(
        self, source: Source, episodes: list[Episode], wanted: frozenset[tuple[str, str]]
    ) -> list[Episode]:
        """The wanted episodes of a recording; an error names those that it has no more."""
        kept = [one for one in episodes if (one.folder, one.name) in wanted]
        lost = sorted(wanted - {(one.folder, one.name) for one in kept})
        if lost:
            what = f"{many(len(lost), 'finding')} of this recording, {lost[0][1]!r} first"
            told = f"{what}, are not found any more: find them again, in a new store"
            self._failures[source.name] = InvalidFile(told, path=source.path)
        return kept


def _repairs(report: Report) -> str:
    return "; ".join(check.reason for check in report.checks if check.verdict == REPAIRED)


def _part(advance: Advance, share: float) -> Advance:
    """Return a callback of progress for work that is a share of other work."""
    return lambda done: advance(share * done)


LABELS = "labels.json"
"""File in the folder of the runs with what was found in each, and the digests of
the files written
"""


class LabelledRuns(NamedTuple):
    """Labelled windows of simulated runs.

    findings: of each run, by its name. written, edited: files written, and those left alone because
    a person has edited them.
    """

    findings: dict[str, list[Detection]]
    written: list[Path]
    edited: list[Path]


def label_runs(
    folder: Path,
    settings: CatalogueSettings,
    recogniser: Recogniser,
    bar: Bar,
    annotate: Literal["copies", "scenarios"] | None = None,
) -> LabelledRuns:
    """Label the runs in a folder; `labels.json` there lists all that was found.

    Nothing else is written unless asked: to annotate writes the tags as OpenLABEL beside each
    scenario, and as properties of the FileHeader (from version 1.2 on) into copies,
    `<name>_labelled.xosc` beside the scenarios, or into the scenarios themselves. Shipped scenarios
    are left alone.

    Raises:
        InvalidFile: there are no runs, one is malformed, or its scenario or road is not there any
            more.
        UsageError: a file can't be written.
    """
    sources = [source for source in datasets.open(folder).sources if source.format == runs.FORMAT]
    if not sources:
        raise InvalidFile("there are no results of xosc-run --out here", path=folder)
    with bar("recognising", len(sources)) as advance:
        for source in sources:
            # Two passes, as for catalogues: classes that are discovered in one run hold for all of
            # them.
            recogniser.look(source.name, *looked(source, settings.rules), advance)
    found = {
        source.name: detect.joined(recogniser.moments(source.name), settings.gap)
        for source in sources
    }
    by_scenario: dict[Path, list[Source]] = {}
    for source in sources if annotate else ():
        by_scenario.setdefault(runs.scenario(source.path), []).append(source)
    record = folder / LABELS
    before = digests(record)
    files = {
        path: content
        for scenario, of in by_scenario.items()
        for path, content in _annotations(scenario, of, found, annotate == "scenarios")
        if path.parent.resolve() != LIBRARY.resolve()  # it is not the user's to write to
    }
    edited = [
        path
        for path, content in files.items()
        if not _write(path, content, before, annotate == "scenarios" and path in by_scenario)
    ]
    written = {str(path): digest(content) for path, content in files.items() if path not in edited}
    table = {
        "files": {**before, **written},
        "runs": {
            name: [_told(detection) for detection in listed] for name, listed in found.items()
        },
    }
    _write(record, (json.dumps(table, indent=1, ensure_ascii=False) + "\n").encode(), {}, True)
    return LabelledRuns(found, [Path(name) for name in written], edited)


def _annotations(
    scenario: Path, sources: list[Source], found: dict[str, list[Detection]], in_place: bool
) -> Iterable[tuple[Path, bytes]]:
    """The files about a scenario: annotated copy (or itself), OpenLABEL."""
    annotations = _tags(sources, found)
    document = xosc.load(scenario)
    target = scenario if in_place else scenario.with_name(f"{scenario.stem}_labelled.xosc")
    try:
        yield target, to_bytes(tags.annotated(document, annotations))
    except Unsupported:
        target = scenario  # of a version without properties: what is tagged is the scenario itself
    yield (
        scenario.with_name(f"{scenario.stem}_labelled.openlabel.json"),
        tags.to_bytes(annotations, target.name, AUTHOR),
    )


def _tags(sources: list[Source], found: dict[str, list[Detection]]) -> list[Tag]:
    """Classes that happen to the ego (to anyone, where there is no ego) in the
    runs of a scenario, and when.
    """
    listed = [
        (source, finding)
        for source in sources
        for finding in found[source.name]
        if _about_ego(source, finding)
    ]
    classes = sorted({finding.moment.title for _, finding in listed})
    when = [
        _sentence(finding, source.name if len(sources) > 1 else None) for source, finding in listed
    ]
    sure = [
        finding.moment.confidence for _, finding in listed if finding.moment.confidence is not None
    ]
    states = sorted({finding.moment.state for _, finding in listed})
    listed_tags: list[Tag] = [
        Tag("Classes", classes),
        Tag("States", states),
        Tag("Findings", when),
        Tag("Runs", len(sources)),
    ]
    return [*listed_tags, *([Tag("Confidence", min(sure))] if sure else [])]


def _about_ego(source: Source, finding: Detection) -> bool:
    ego = runs.ego(source.path)
    return ego is None or finding.moment.ego == ego


def _sentence(finding: Detection, run: str | None) -> str:
    moment = finding.moment
    parts = [
        f"{moment.title} of {moment.ego} at {moment.time:.2f} s",
        f"with {moment.partner}" if moment.partner else "",
    ]
    parts += [
        f"in {run}" if run else "",
        f"({_labels(moment)})" if moment.labels_agree is False else "",
    ]
    return " ".join(filter(None, parts))


def _labels(moment: Moment) -> str:
    """Both labels of a moment about which rules and model disagree."""
    return f"rules: {moment.rule.title}, model: {moment.model}, {moment.confidence or 0.0:.0%}"


def _told(finding: Detection) -> dict[str, Any]:
    moment = finding.moment
    return {
        "ego": moment.ego,
        "class": moment.title,
        "state": moment.state,
        "confidence": moment.confidence,
        "rule_class": moment.rule.title if moment.rule else None,
        "model_class": moment.model,
        "nearest_class": moment.nearest,
        "labels_agree": moment.labels_agree,
        "partner": moment.partner,
        "time": round(moment.time, 3),
        "start": round(finding.start, 3),
        "end": round(finding.end, 3),
        "tags": moment.tags,
        "severity": moment.severity,
        "critical": moment.critical,
    }


def _write(path: Path, content: bytes, before: dict[str, str], anyway: bool) -> bool:
    # `anyway`: the file is taken as it is now, so that it does not count as edited by a person.
    found = digest(path.read_bytes()) if anyway and path.is_file() else before.get(str(path))
    return write_unless_edited(path, content, found)
