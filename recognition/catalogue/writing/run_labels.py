"""Labels for the results of runs, written about the scenarios that they are runs of."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import xosc
from recognition import recordings as datasets
from recognition.catalogue import detect
from recognition.catalogue.detect import Detection, Moment, Recogniser
from recognition.catalogue.pipeline import looked
from recognition.catalogue.recordings import CatalogueSettings
from recognition.catalogue.writing.store import digests, write_unless_edited
from recognition.catalogue.writing.write import AUTHOR
from recognition.recordings import Source
from recognition.recordings.formats import runs
from schemas.common.errors import InvalidFile, Unsupported
from schemas.common.storage import digest
from schemas.common.terminal.files import LIBRARY
from xosc.document import to_bytes
from xosc.writing import tags
from xosc.writing.tags import Tag

if TYPE_CHECKING:
    from schemas.common.terminal.command_line import Bar


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
