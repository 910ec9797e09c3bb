"""The page of a loop: what was recognised, generated, checked and run, with all of it to open and to play."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from generation.loop.loop import CATALOGUE, RECOGNISED, chosen
from generation.loop.stages import Found
from recognition.catalogue.writing.index import rows_of
from runner.replay.page import page, write_page
from runner.replay.report import REPORT

PAGE = "index.html"
"""Name of the page in the output folder"""
_FOLDER = Path(__file__).parent
_MEASURES = ("min_ttc", "min_thw", "min_distance", "pet")


def write(found: Found, out: Path) -> Path:
    """Write the page into the output folder; links in it are relative to it. The same findings give the same bytes.

    Args:
        found: what `generation.loop.loop.run_loop` returns.
    """
    path = out / PAGE
    styles = "base.css", "report.css", str(_FOLDER / "loop.css")
    scripts = "dom.js", "axes.js", str(_FOLDER / "loop.js")
    write_page(path, page(f"{out.resolve().name} – from recordings to edge cases", styles, scripts, _data(found, out)))
    return path


def _data(found: Found, out: Path) -> dict[str, Any]:
    """What the page is made from."""
    settings = found["settings"]
    rows = rows_of(out / CATALOGUE) if found["recordings"] else []
    searches = [_search(each, each_round, out) for each_round in found["rounds"] for each in each_round["searches"]]
    return {
        "title": out.resolve().name,
        "settings": settings,
        "recordings": found["recordings"],
        "unread": found["recognised"].get("failures", {}),
        "classes": _classes(rows, found, int(settings["shown"])),
        "catalogue": f"{CATALOGUE}/index.csv" if rows else None,
        "searches": searches,
        "refused": found["refused"],
        "scenarios": [_run(run, name) for name, runs in found["scenarios"].items() for run in runs],
        "reports": _reports(found),
        "checked": found["checked"],
    }


def _classes(rows: list[dict[str, Any]], found: Found, most: int) -> list[dict[str, Any]]:
    """The classes of a catalogue, the most frequent first, with the scenarios of each that are shown."""
    counts = found["recognised"].get("classes", {})
    shown: dict[str, list[dict[str, Any]]] = {}
    for row in chosen(rows, most):
        shown.setdefault(row["class"], []).append(row)
    return [
        {
            "title": title,
            "state": shown[title][0]["state"],
            "count": counts[title],
            "rows": [_recorded(row, found["played"]) for row in shown[title]],
        }
        for title in sorted(counts, key=lambda title: (-counts[title], title))
    ]


def _recorded(row: dict[str, Any], played: Found) -> dict[str, Any]:
    """A scenario of the catalogue of recordings."""
    runs = played.get(f"{CATALOGUE}/{row['file']}", [])
    files = {"scenario": row["file"], "manoeuvre": row["maneuver"], "road": row["road"], "tags": row["openlabel"]}
    told = {
        name: row[name] for name in ("recording", "vehicle", "time", "confidence", "rule_class", "model_class", "participants")
    }
    return {
        **told,
        "name": Path(row["file"]).stem,
        "measures": {name: row[name] for name in _MEASURES},
        "play": runs[0]["replay"] if runs else None,
        "files": {name: f"{CATALOGUE}/{file}" for name, file in files.items() if file},
    }


def _search(search: Found, of: Found, out: Path) -> dict[str, Any]:
    """A search with its edge cases."""
    told = {name: value for name, value in search.items() if name not in ("failed", "cases")}
    cases = [_case(case, of, out) for case in search.get("cases", [])]
    return {**told, "round": of["number"], "failed": len(search.get("failed", [])), "cases": cases}


def _case(case: dict[str, Any], of: Found, out: Path) -> dict[str, Any]:
    """An edge case with what became of its run."""
    run = next(iter(of["runs"].get(case["file"], [])), None)
    labels = of["recognised"].get(run["name"], []) if run else []
    tags = case["file"].removesuffix(".xosc") + ".openlabel.json"
    return {
        "name": Path(case["file"]).stem,
        "theta": case["theta"],
        "verdict": case["Verdict"],
        "careful": case["CarefulDriver"],
        "likelihood": case["LogLikelihood"],
        "risk": case["RRisk"],
        "state": run["state"] if run else None,
        "play": run["replay"] if run else None,
        "recognised": [{"title": each["class"], "file": f"round_{of['number']}/{RECOGNISED}/{each['file']}"} for each in labels],
        "files": {"scenario": case["file"], **({"road": case["road"]} if case["road"] else {}), "tags": tags},
    }


def _run(run: dict[str, Any], name: str) -> dict[str, Any]:
    """The run of a scenario of the user's."""
    told = {key: run[key] for key in ("name", "state", "message", "end")}
    return {**told, "file": name, "measures": {key: run["measures"].get(key) for key in _MEASURES}, "play": run["replay"]}


def _reports(found: Found) -> list[dict[str, str]]:
    """The reports of the batches."""

    def each() -> Iterable[tuple[str, str]]:
        if found["played"]:
            yield "replays of recorded scenarios", f"played/{REPORT}"
        for of in found["rounds"]:
            if of["runs"]:
                yield f"runs of edge cases, round {of['number']}", f"round_{of['number']}/runs/{REPORT}"
        if found["scenarios"]:
            yield "runs of your scenarios", f"scenarios/{REPORT}"

    return [{"title": title, "file": file} for title, file in each()]
