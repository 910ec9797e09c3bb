"""Recordings to a catalogue: finding scenarios in them, then writing these; and labels for the
results of runs, written about the scenarios that they are runs of.

Each stage goes over recordings in parallel, by functions that other processes import:

- `recognise` has a model look at all recordings, where one labels: it discovers classes from all of
  them together. Rules need no such stage.
- `find_in` reads a recording, places it on its roads, labels it, and sets begin and end of the
  scenarios. `recognition.catalogue.findings` keeps them for later; a catalogue goes on at once.
- `write_in` writes the scenarios, in blocks; `play_in` plays each once.

A catalogue is found and written some recordings at a time, so that memory holds what is found in
these alone; each recording that was read waits for its next stages in a copy on disk.
"""

from __future__ import annotations

import gc
import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import xosc
from recognition.catalogue import detect
from recognition.catalogue.detect import (
    Advance,
    ByRules,
    Detection,
    Episode,
    Moment,
    Recogniser,
    by_rules,
    of_findings,
    of_vehicles,
    plain,
)
from recognition.catalogue.exposure import Mileage, exposure_of
from recognition.catalogue.recordings import (
    VEHICLES,
    CatalogueSettings,
    PlacedRecording,
    RecordingLocation,
    RecordingStore,
    naming,
)
from recognition.catalogue.writing.index import Catalogue, recordings_of
from recognition.catalogue.writing.played import Played, Trial, play
from recognition.catalogue.writing.store import digests, write_unless_edited
from recognition.catalogue.writing.write import AUTHOR, CatalogWriter, Material, PendingCatalog
from recognition.labels import LabelledEvent, Rules, label
from recognition.labels.critical import with_critical
from recognition.labels.labelling import BY_ROLE
from recognition.recordings import Exclusion, Report, Source, cache_roads
from recognition.recordings import source as datasets
from recognition.recordings.formats import runs
from recognition.recordings.intake import REPAIRED
from recognition.scenes import LIT, Site, place, site_of
from recognition.scenes.cut import Scope
from runner.batch.pool import Workers, results
from runner.recording import Recording
from schemas.common.errors import InvalidFile, NotWritten, ToolchainError, Unsupported, UsageError
from schemas.common.policy import limited
from schemas.common.storage import digest, stamp
from schemas.common.terminal.files import LIBRARY
from xosc.document import to_bytes
from xosc.writing import tags
from xosc.writing.tags import Tag

if TYPE_CHECKING:
    from schemas.common.terminal.command_line import Bar


SHIPPED = Path(__file__).resolve().parents[1] / "models" / "cpu"
"""The model that comes with the package"""
_STORE = ".recordings"
"""Folder for what was read, in that of the catalogue, until this is finished"""
_PART = 50
"""Number of recordings with findings in memory at a time"""
_EPISODES = 25
"""Scenarios of a recording that are written at a time"""
_READ = 0.5
"""Share of the progress of a recording that a model looks at when it has been read"""
_LONG = 200
"""Participants of a recording that takes so long to write that it is worth a search for garbage, in
all that is loaded"""
REFUSALS = (InvalidFile, Unsupported, UsageError)
"""Errors that concern one recording: the others go on"""


_DOUBTFUL = 0.35
"""Share that fails a check, from which on the catalogue tells it: no real recording has as many
places off the roads on its own map"""


class Summary(NamedTuple):
    """Outcome of the recordings.

    classes: scenarios by title of the class. passages: vehicles' scenes by how they pass.
    exclusions: vehicles without a scene. colliding: scenarios in which the ego touches another one
    from the start, as recorded. edited: files that a person has edited, left alone. removed: files
    of earlier runs that are no longer part of the catalogue. failures: recordings that could not be
    read, and why. skipped: files of an unknown format. repaired: recordings that were repaired, and
    why. doubtful: recordings that fail a check in large part, and the check's sentence.
    unplayable: scenarios that do not play, which are not part of the catalogue, and why.
    inconclusive: scenarios without a verdict as they were recorded, and why.
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
    doubtful: dict[str, str]
    unplayable: dict[str, str]
    inconclusive: dict[str, str]
    unlit: int


class ChosenScenarios(NamedTuple):
    """Scenarios of a recording that were found before.

    stamp: of the recording then (`stamp_of`). episodes: as JSON.
    """

    stamp: str
    episodes: list[str]


class SelectedScenarios(NamedTuple):
    """Scenarios that were found before, by recording, and whose labels sort them."""

    sorted_by: str
    chosen: Mapping[str, ChosenScenarios]


class RecordingSearch(NamedTuple):
    """A recording to be searched.

    moments: those of a model; None for those of the rules. episodes: those that were found before,
    as JSON; None to find them.
    """

    location: RecordingLocation
    moments: list[Moment] | None = None
    episodes: Sequence[str] | None = None


class Findings(NamedTuple):
    """Outcome of searching a recording, without the recording itself.

    exclusions: vehicles that are no egos, where scenes are of whole vehicles.
    """

    placed: PlacedRecording
    report: Report
    exposure: Mileage
    exclusions: list[Exclusion]
    episodes: list[Episode]


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
    selection: SelectedScenarios | None = None,
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
        selection: scenarios to write that were found before; None to find all that there are.

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
    sources = opened(paths, settings)
    failures: dict[str, ToolchainError] = {}
    if selection is not None:
        sources = _unchanged(sources, selection.chosen, failures)
    _refuse_others(out, {source.name for source in sources})
    searches: Sequence[RecordingSearch] = [
        RecordingSearch(
            located(paths, settings, source, out / _STORE),
            episodes=selection.chosen[source.name].episodes if selection is not None else None,
        )
        for source in sources
    ]
    made = recogniser()
    searches = recognise(made, settings, searches, failures, bar, workers)
    sorted_by = made.sorted_by if selection is None else selection.sorted_by
    work = _CatalogueBuild(
        out, settings, sorted_by, failures, workers, selected=selection is not None
    )
    for start in range(0, len(searches), _PART):
        work.write(work.find(searches[start : start + _PART], bar), bar)
    work.play(bar)
    skipped = [
        file
        for data_set in datasets.listed(tuple(paths), settings.columns)
        for file in data_set.skipped
    ]
    return work.close(skipped)


def opened(paths: Sequence[Path], settings: CatalogueSettings) -> list[Source]:
    """The recordings in files and folders, which have names of their own.

    Raises:
        InvalidFile: there is no recording of a known format in a path.
        UsageError: two recordings have one name.
    """
    # Another call in this process may be of other files with the same names.
    datasets.forget()
    recorded.cache_clear()
    _material.cache_clear()
    sources = datasets.opened(tuple(paths), settings.road, settings.columns)
    first: dict[str, Source] = {}
    for source in sources:
        # Names of recordings become names of files, in which some characters can't stand: of two
        # that are one without them, the scenarios of the second would replace those of the first.
        other = first.setdefault(plain(source.name), source)
        if other is not source:
            told = (
                f"{other.path} has a recording called {source.name!r} too: give each once, in one "
                "folder that holds both"
                if other.name == source.name
                else f"files of recording {source.name!r} would have the names of those of "
                f"{other.name!r}, as both are {plain(source.name)!r} there: rename one of them"
            )
            raise UsageError(told, path=source.path)
    return sources


def located(
    paths: Sequence[Path], settings: CatalogueSettings, source: Source, copies: Path | None
) -> RecordingLocation:
    """Location of a recording, by which other processes open it."""
    return RecordingLocation(tuple(paths), source.name, copies, settings.road, settings.columns)


def stamp_of(source: Source) -> str:
    """Text that changes with the file of a recording."""
    return f"{source.path.absolute()} {stamp(source.path)}"


def _unchanged(
    sources: Sequence[Source],
    chosen: Mapping[str, ChosenScenarios],
    failures: dict[str, ToolchainError],
) -> list[Source]:
    """The recordings with scenarios that were chosen; those that have changed since are failures,
    as are those that are gone."""
    by_name = {source.name: source for source in sources}
    again = "since its findings were added: find them again, in a new store"
    kept = []
    for name, one in chosen.items():
        source = by_name.get(name)
        # What was found is about the rows as they were: in others nothing may happen at its time.
        if source is None:
            failures[name] = InvalidFile(f"recording {name!r} has gone {again}")
        elif stamp_of(source) != one.stamp:
            failures[name] = InvalidFile(
                f"recording {name!r} has changed {again}", path=source.path
            )
    for source in sources:
        if source.name in chosen and source.name not in failures:
            kept.append(source)
    return kept


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


# finding ----------------------------------------------------------------------------------------


class _ReadRecording(NamedTuple):
    """A recording on the roads of its site, and what reading it found."""

    recording: Recording
    site: Site
    report: Report


def _read(source: Source, copies: Path | None) -> _ReadRecording:
    """Read a recording, or its copy, and place it on the roads of its site.

    Raises:
        InvalidFile, Unsupported, UsageError: it can't be read, or its roads are unknown or unsound.
    """
    store = RecordingStore(copies) if copies is not None else None
    kept = store.find(source) if store is not None else None
    recording = kept.recording if kept is not None else source.load()
    site = site_of(source, recording, cache_roads())
    place(recording, site.network)
    if kept is not None:
        return _ReadRecording(recording, site, kept.report)
    assert source.report is not None, "the recording has been read"
    # The site adds remarks to the report: only now both are whole.
    if store is not None:
        store.put(source, recording, source.report)
    return _ReadRecording(recording, site, source.report)


def _events(recording: Recording, site: Site, name: str, rules: Rules) -> list[LabelledEvent]:
    return with_critical(label(recording, site, name, rules), recording, site, name, rules)


@limited()
def looked(source: Source, rules: Rules) -> tuple[Recording, Site, list[LabelledEvent]]:
    """A recording, placed on the roads of its site, and the events and critical moments in it.

    Raises:
        InvalidFile, Unsupported, UsageError: it can't be read, or its roads are unknown or unsound.
    """
    recording, site, _ = _read(source, None)
    return recording, site, _events(recording, site, source.name, rules)


class _Labelled(NamedTuple):
    """Events that rules find in a recording, and its site."""

    site: PlacedRecording
    events: list[LabelledEvent]


def _label_in(
    settings: CatalogueSettings, location: RecordingLocation
) -> _Labelled | ToolchainError:
    """Read, keep and label a recording; return the error if it is unreadable."""
    source = location.source
    try:
        with limited():
            recording, site, report = _read(source, location.copies)
            events = _events(recording, site, source.name, settings.rules)
    except NotWritten:
        raise  # the other recordings can't be either
    except REFUSALS as error:
        return naming(source, error)
    return _Labelled(PlacedRecording(location, site.path, site.roles, report.quality), events)


def recognise(
    recogniser: Recogniser,
    settings: CatalogueSettings,
    searches: Sequence[RecordingSearch],
    failures: dict[str, ToolchainError],
    bar: Bar,
    workers: Workers,
) -> Sequence[RecordingSearch]:
    """Have a model look at all recordings, in their order: the searches with its moments.

    Recordings that can't be read join the failures. Searches by rules are returned as they are.
    """
    if recogniser.by_rules:
        return searches
    locations = [search.location for search in searches]
    read = []
    with (
        bar("recognising", len(locations)) as advance,
        results(partial(_label_in, settings), locations, workers) as labelled,
    ):
        for location, one in zip(locations, labelled, strict=True):
            if isinstance(one, ToolchainError):
                failures[location.name] = one
                advance(1.0)
                continue
            advance(_READ)
            # One model, in this process: what it discovers in one recording it knows in the next.
            rest = partial(_in_part, advance, 1.0 - _READ)
            recogniser.look(location.name, recorded(location), one.site.site, one.events, rest)
            read.append(location)
    # Labels are final after the last recording only.
    return [RecordingSearch(location, recogniser.moments(location.name)) for location in read]


def _in_part(advance: Advance, share: float, done: float) -> None:
    """Advance by work that is a share of other work."""
    advance(share * done)


def find_in(settings: CatalogueSettings, search: RecordingSearch) -> Findings | ToolchainError:
    """Find the scenarios of a recording, of which a copy is kept; return the error if it is
    unreadable."""
    try:
        with limited():
            return searched(settings, search)[1]
    except NotWritten:
        raise  # the other recordings can't be either
    except REFUSALS as error:
        return naming(search.location.source, error)


def searched(
    settings: CatalogueSettings, search: RecordingSearch
) -> tuple[_ReadRecording, Findings]:
    """Read a recording and find its scenarios.

    Raises:
        InvalidFile, Unsupported, UsageError: it can't be read, or its roads are unknown or unsound.
    """
    location = search.location
    name, read = location.name, _read(location.source, location.copies)
    recording, site, report = read
    exclusions: list[Exclusion] = []
    if search.episodes is not None:
        episodes = [Episode.of_json(text) for text in search.episodes]
    else:
        moments = search.moments
        if moments is None:
            moments = [by_rules(one) for one in _events(recording, site, name, settings.rules)]
        detections = detect.joined(moments, settings.gap)
        if settings.scenes == VEHICLES:
            egos, exclusions = detect.vehicles(recording, site.network, settings.needs)
            episodes = of_vehicles(name, egos, detections)
        else:
            episodes = of_findings(name, detections, settings.around)
    placed = PlacedRecording(location, site.path, site.roles, report.quality)
    exposure = exposure_of(recording, settings.rules)._replace(quality=report.quality)
    # Where roles of lanes are in doubt no ramp is labelled: a rate of ramps would be of nothing.
    if site.roles.doubts:
        exposure = exposure._replace(blocked=frozenset(one.title for one in BY_ROLE))
    return read, Findings(placed, report, exposure, exclusions, episodes)


# writing ----------------------------------------------------------------------------------------


class Block(NamedTuple):
    """Episodes of a recording to be written, and the name of its road in the catalogue."""

    placed: PlacedRecording
    road: str
    episodes: Sequence[Episode]


class TrialBlock(NamedTuple):
    """Scenarios of a recording to be played."""

    location: RecordingLocation
    trials: Sequence[Trial]


class WrittenBlock(NamedTuple):
    """WrittenBlock scenarios of a recording, and errors."""

    written: PendingCatalog
    error: ToolchainError | None


def write_in(out: Path, settings: CatalogueSettings, sorted_by: str, block: Block) -> WrittenBlock:
    """Write scenarios of a recording into the folder of a catalogue."""
    writer = CatalogWriter(out, settings.config, sorted_by)
    try:
        with limited():
            writer.add(_material(block.placed, settings.config.scope), block.road, block.episodes)
    except NotWritten:
        raise  # the other recordings can't be either
    except REFUSALS as error:
        return WrittenBlock(writer.written, naming(block.placed.location.source, error))
    return WrittenBlock(writer.written, None)


def play_in(out: Path, block: TrialBlock) -> list[Played]:
    """Play scenarios in the folder of a catalogue, and compare them with their recording."""
    return play(out, recorded(block.location), block.trials)


@lru_cache(maxsize=1)
def recorded(location: RecordingLocation) -> Recording:
    """The copy of a recording, which is held for its next stages, also in processes that are forked
    from this one."""
    assert location.copies is not None, "a copy was kept"
    return RecordingStore(location.copies).get(location.source).recording


@lru_cache(maxsize=1)
def _material(placed: PlacedRecording, scope: Scope) -> Material:
    """Return the used part of a recording, cached for its other blocks."""
    recording = recorded(placed.location)
    material = Material(placed.location.source, recording, placed.site, scope, placed.quality)
    if len(recording.tracks) >= _LONG:
        gc.unfreeze()
        gc.collect()
        gc.freeze()  # until the next such recording no garbage is sought in it, nor in the roads
    return material


class _CatalogueBuild:
    """One catalogue in the making."""

    def __init__(
        self,
        out: Path,
        settings: CatalogueSettings,
        sorted_by: str,
        failures: dict[str, ToolchainError],
        workers: Workers,
        *,
        selected: bool,
    ) -> None:
        self._out, self._settings, self._workers = out, settings, workers
        self._sorted_by = sorted_by
        self._failures = failures
        self._catalogue = Catalogue(out, settings.config, sorted_by, selected=selected)
        self._trials: list[TrialBlock] = []
        self._repaired: dict[str, str] = {}
        self._doubtful: dict[str, str] = {}

    def find(self, searches: Sequence[RecordingSearch], bar: Bar) -> list[Findings]:
        """Find the scenarios of recordings; the outcome of those that could be read."""
        by_model = any(search.moments is not None for search in searches)
        read = []
        with (
            bar("finding" if by_model else "recognising", len(searches)) as advance,
            results(partial(find_in, self._settings), searches, self._workers) as outcomes,
        ):
            for search, outcome in zip(searches, outcomes, strict=True):
                # A recording that can't be read is named in the summary; the others go on.
                if isinstance(outcome, ToolchainError):
                    self._failures[search.location.name] = outcome
                else:
                    read.append(outcome)
                    name, report = search.location.name, outcome.report
                    if report.verdict == REPAIRED:
                        self._repaired[name] = _repairs(report)
                    if doubts := "; ".join(
                        check.reason
                        for check in report.checks
                        if check.verdict is None and check.share > _DOUBTFUL
                    ):
                        self._doubtful[name] = doubts
                advance(1.0)
        return read

    def write(self, findings: Sequence[Findings], bar: Bar) -> None:
        """Write the scenarios of the recordings."""
        work = partial(write_in, self._out, self._settings, self._sorted_by)
        blocks = [block for one in findings for block in self._blocks(one)]
        # Blocks, not recordings: one long recording keeps all workers busy too.
        count = sum(len(block.episodes) for block in blocks)
        with bar("writing", count) as advance, results(work, blocks, self._workers) as done:
            for block, one in zip(blocks, done, strict=True):
                self._catalogue.take(one.written)
                self._trials.append(TrialBlock(block.placed.location, one.written.trials))
                if one.error is not None:
                    self._failures[block.placed.location.name] = one.error
                advance(len(block.episodes))

    def _blocks(self, found: Findings) -> Iterator[Block]:
        """Yield the blocks to be written of a recording, whose road and index
        entry are written first.
        """
        placed = found.placed
        self._catalogue.register(
            placed.location.source, found.report, found.exposure, found.exclusions
        )
        # In this process: workers that write blocks of one recording must not write one road file
        # twice.
        road = self._catalogue.road(placed.road)
        for start in range(0, len(found.episodes), _EPISODES):
            yield Block(placed, road, found.episodes[start : start + _EPISODES])

    def play(self, bar: Bar) -> None:
        """Play every scenario once: what does not play is no part of the catalogue."""
        # OpenSCENARIO catalogues that recordings share are complete only after the last of them.
        self._catalogue.write_catalogs()
        trials = self._trials
        work = partial(play_in, self._out)
        with (
            bar("playing", sum(len(block.trials) for block in trials)) as advance,
            results(work, trials, self._workers) as done,
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
        RecordingStore(self._out / _STORE).clear()
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
            self._doubtful,
            catalogue.unplayable,
            dict(sorted((row["file"], row["inconclusive"]) for row in rows if row["inconclusive"])),
            0 if self._settings.rules.signalised else catalogue.remarked(LIT),
        )


def _repairs(report: Report) -> str:
    return "; ".join(check.reason for check in report.checks if check.verdict == REPAIRED)


# labels for the results of runs ------------------------------------------------------------------

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
