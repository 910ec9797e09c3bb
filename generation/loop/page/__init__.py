"""The page of a loop: what was recognised, generated, checked and run, with all of it to open and
to play."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from generation.loop.findings import Against, EdgeCase, LoopResult, Ran, Round, Searched, ShownRun
from generation.loop.loop import CATALOGUE, RECOGNISED, chosen
from generation.report.regression import Fate
from generation.report.report import PARTS_CSS, PARTS_JS
from recognition.catalogue.writing.index import rows_of
from recognition.labels.classes import Label
from runner.batch.outputs.folder import load_run
from runner.view.page import page, write_page
from runner.view.replay.player import REPORT, preview

PAGE = "index.html"
"""Name of the page in the output folder"""
_FOLDER = Path(__file__).parent
_STYLES = "base.css", "report.css", "play/colours.css", PARTS_CSS, str(_FOLDER / "loop.css")
_PLAYED = *(f"play/{part}.js" for part in ("data", "drawing", "pair", "preview")), PARTS_JS
_PARTS = "common", "avoided", "flow", "recognised", "generated", "space", "against", "main"
_SCRIPTS = "dom.js", "axes.js", *_PLAYED, *(str(_FOLDER / f"{part}.js") for part in _PARTS)
_MOVING = 12
"""Avoidable collisions that are shown as moving pictures"""
_MEASURES = ("min_ttc", "min_thw", "min_distance", "pet")
_NOT_PLOTTED = ("cases", "failed", "failures")
"""Fields of a search that its page shows in another form, or not at all"""

_NUMBER = re.compile(r"\d+(\.\d+)?")
Json = dict[str, Any]
"""Values for the page's scripts: numbers, texts from files, and codes whose wording they choose."""


def write(found: LoopResult, out: Path) -> Path:
    """Write the page into the output folder; links in it are relative to it. The same findings give
    the same bytes."""
    path = out / PAGE
    begin = "recordings" if found.recordings else "scenarios"
    write_page(
        path,
        page(
            f"{out.resolve().name} – from {begin} to edge cases",
            _STYLES,
            _SCRIPTS,
            _data(found, out),
        ),
    )
    return path


def _data(found: LoopResult, out: Path) -> Json:
    """Return the data of the page."""
    rows = rows_of(out / CATALOGUE) if found.recordings else []
    searches = [_search(search, of) for of in found.rounds for search in of.searches]
    _add_previews([(search["title"], case) for search in searches for case in search["cases"]], out)
    return {
        "title": out.resolve().name,
        "settings": found.settings,
        "recordings": found.recordings,
        "unread": found.recognised.failures,
        "errors": [
            f"{name}: {error}"
            for of in (found.played, *(round_.runs for round_ in found.rounds))
            for name, error in of.failures.items()
        ],
        "classes": _classes(rows, found),
        "catalogue": f"{CATALOGUE}/index.csv" if rows else None,
        "searches": searches,
        "refused": [asdict(refusal) for refusal in found.refused],
        "scenarios": [
            _run(run, name) for name, runs in found.scenarios.files.items() for run in runs
        ],
        "sampled": found.scenarios.sampled,
        "against": _against(found.against),
        "reports": list(_reports(found)),
        "checked": asdict(found.checked),
    }


def _classes(rows: list[Json], found: LoopResult) -> list[Json]:
    """The classes of a catalogue, the most frequent first, with the scenarios of each that are
    shown."""
    counts = found.recognised.classes
    shown: dict[str, list[Json]] = {}
    for row in chosen(rows, int(found.settings["shown"])):
        shown.setdefault(row["class"], []).append(row)
    return [
        {
            "title": title,
            "state": shown[title][0]["state"],
            "count": counts[title],
            "rows": [_recorded(row, found.played) for row in shown[title]],
        }
        for title in sorted(counts, key=lambda title: (-counts[title], title))
    ]


def _recorded(row: Json, played: Ran) -> Json:
    """A scenario of the catalogue of recordings; classes that rules or model do
    not give are None.
    """
    runs = played.files.get(f"{CATALOGUE}/{row['file']}", [])
    files = {
        "scenario": row["file"],
        "manoeuvre": row["maneuver"],
        "road": row["road"],
        "tags": row["openlabel"],
    }
    copied = {
        name: row[name] for name in ("recording", "vehicle", "time", "confidence", "participants")
    }
    labels = {
        name: row[name] if row[name] != Label.UNKNOWN.title else None
        for name in ("rule_class", "model_class")
    }
    return {
        **copied,
        **labels,
        "name": Path(row["file"]).stem,
        "measures": {name: row[name] for name in _MEASURES},
        "play": runs[0].replay if runs else None,
        "files": {name: f"{CATALOGUE}/{file}" for name, file in files.items() if file},
    }


def _search(search: Searched, of: Round) -> Json:
    """A search with its edge cases and the number of its failures."""
    values = {name: value for name, value in asdict(search).items() if name not in _NOT_PLOTTED}
    return {
        **values,
        "failed": len(search.failed),
        "cases": [_case(case, of) for case in search.cases],
    }


def _case(case: EdgeCase, of: Round) -> Json:
    """An edge case with what became of its run."""
    run = next(iter(of.runs.files.get(case.file, [])), None)
    labels = of.recognised.runs.get(run.name, []) if run else []
    tags = case.file.removesuffix(".xosc") + ".openlabel.json"
    return {
        "name": Path(case.file).stem,
        "theta": case.theta,
        "verdict": case.verdict,
        "careful": case.careful,
        "avoidable": case.avoidable,
        "survivors": case.survivors,
        "preview": None,
        "likelihood": case.likelihood,
        "risk": case.risk,
        "state": run.state if run else None,
        "message": run.message if run else None,
        "play": run.replay if run else None,
        "recognised": [
            {"title": label.title, "file": f"round_{of.number}/{RECOGNISED}/{label.file}"}
            for label in labels
        ],
        "files": {
            "scenario": case.file,
            **({"road": case.road} if case.road else {}),
            "tags": tags,
        },
    }


def _add_previews(cases: list[tuple[str, Json]], out: Path) -> None:
    """Add moving pictures of collisions that a careful driver would have avoided, the first of each
    kind first.

    A kind is a search and the participant that was touched. `turn` is the place of a case among
    those of its kind.

    Args:
        cases: with the titles of their searches.
    """
    turns: Counter[tuple[str, str]] = Counter()
    shown = []
    for title, case in cases:
        if case["avoidable"] and case["play"]:
            kind = title, _NUMBER.sub("", case["message"] or "")
            case["turn"] = turns[kind]
            turns[kind] += 1
            shown.append(case)
    for case in sorted(shown, key=lambda case: int(case["turn"]))[:_MOVING]:
        case["preview"] = preview(load_run((out / case["play"].partition("#")[0]).parent))


def _against(found: Against | None) -> Json | None:
    """Return the fates of an earlier loop's failures."""
    if found is None:
        return None
    compared = [
        {**asdict(comparison), "counts": {fate: comparison.counts[fate] for fate in Fate}}
        for comparison in found.compared
    ]
    return {
        "folder": found.folder,
        "sut": found.sut,
        "counts": {fate: found.counts[fate] for fate in Fate},
        "compared": compared,
    }


def _run(run: ShownRun, name: str) -> Json:
    """The run of a scenario of the user's."""
    measures = {key: run.measures.get(key) for key in _MEASURES}
    outcome = {
        "name": run.name,
        "state": run.state,
        "status": run.status,
        "message": run.message,
        "end": run.end,
    }
    return {**outcome, "file": name, "measures": measures, "play": run.replay}


def _reports(found: LoopResult) -> Iterator[Json]:
    """The reports of the batches."""
    if found.played.files:
        yield {"of": "played", "file": f"played/{REPORT}"}
    for of in found.rounds:
        if of.runs.files:
            yield {"of": "cases", "round": of.number, "file": f"round_{of.number}/runs/{REPORT}"}
    if found.scenarios.files:
        yield {"of": "scenarios", "file": f"scenarios/{REPORT}"}
