"""Answers of the page that `xosc-explore` serves: pages as HTML, requests as JSON.

A page may ask for points of the named files, with systems under test that the command offers.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from runner.batch import journal
from runner.batch.pool import dismiss, executor
from runner.judging.settings import RunSettings
from runner.systems import system_name, systems
from runner.view.explore import (
    Explored,
    ExploredParameter,
    FilmProcess,
    FilmRequest,
    PointVerdict,
    border,
    verdict_at,
)
from runner.view.page import page
from runner.view.replay.player import SCRIPTS, STYLES, steps
from schemas.common.errors import ToolchainError, UsageError
from schemas.common.storage import read_object
from xosc.listing.questions import condition
from xosc.listing.tables import EPISODES, INDEX, RUNS, Index, read_all, read_index, table_of
from xosc_toolchain.plugin import copy_scenario, declare, vary

_MOST_CELLS = 25
"""Columns, and rows, of a map at most"""
_MOST_ROWS = 500
"""Rows of a folder that the page shows"""
_EXPLORE = ("explore/explore.css",), ("explore/explore.js", "explore/map.js", "explore/start.js")
_FOLDER = ("base.css", "report.css", "explore/explore.css"), ("dom.js", "explore/folder.js")
_PAGES = ("report.html", "index.html", "history.html", "catalogue.html")
"""Pages of a folder, the first of which is shown"""
KINDS = {
    ".html": "text/html; charset=utf-8",
    ".png": "image/png",
    ".gif": "image/gif",
    ".svg": "image/svg+xml",
    ".json": "application/json",
    ".csv": "text/plain; charset=utf-8",
}
"""Files of a folder that are served, with their types"""

# what pages ask for -----------------------------------------------------------------------------


class ExploreSite:
    """Answers of the server: pages as HTML, requests of pages as JSON.

    Args:
        paths: one scenario or variation file, or folders with tables of rows.
        settings: of all runs.
        given: values of parameters at the beginning.
        out: folder to save into; None for none.
        jobs: processes that play maps and borders.

    Raises:
        UsageError, InvalidFile, Unsupported: these are no such files.
    """

    def __init__(
        self,
        paths: list[Path],
        settings: RunSettings,
        given: Mapping[str, str],
        out: Path | None,
        jobs: int,
    ) -> None:
        self._settings, self._out, self._jobs = settings, out, jobs
        own = system_name(settings.sut)
        offered = [name for name in systems() if name.islower() and ":" not in name]
        self.systems = list(dict.fromkeys([own, *offered]))
        self._films = FilmProcess()
        self._pool: ProcessPoolExecutor | None = None
        self._maps, self._lock = 0, threading.Lock()
        self._explored: dict[str, tuple[Explored, str]] = {}
        self.folder: Collection | None = None
        if all(table_of(path) is not None for path in paths):
            self.folder = Collection(paths)
        elif len(paths) > 1 or paths[0].is_dir():
            told = (
                "one scenario or variation file is expected, or folders of batches, "
                "searches or catalogues"
            )
            raise UsageError(told, path=paths[-1])
        else:
            self._explored[""] = Explored.of(paths[0], given), own

    def close(self) -> None:
        """End the processes."""
        self._films.close()
        if self._pool is not None:
            dismiss(self._pool)

    # pages --------------------------------------------------------------------------------------

    def start(self) -> str:
        """The page that the address leads to."""
        return self.explore("") if self.folder is None else self._listing(self.folder)

    def explore(self, row: str) -> str:
        """The page of a scenario, or of that of a row of a folder."""
        explored, system = self._of(row)
        data = {
            "steps": steps(),
            "row": row,
            "name": explored.source.stem,
            "description": explored.description,
            "parameters": [_told(each) for each in explored.parameters],
            "systems": self.systems,
            "system": system,
            "saves": self._out is not None,
            "folder": self.folder is not None,
        }
        styles, scripts = _EXPLORE
        title = f"{explored.source.stem} – explore"
        return page(title, [*STYLES, *styles], [*SCRIPTS, *scripts], data, served=True)

    def _listing(self, folder: Collection) -> str:
        data = {"title": folder.title, "pages": folder.pages(), **folder.rows("")}
        return page(f"{folder.title} – explore", *_FOLDER, data, served=True)

    def _of(self, row: object) -> tuple[Explored, str]:
        """A scenario, and the name of the system under test that it begins with."""
        key = str(row)
        if key not in self._explored:
            if self.folder is None:
                raise UsageError(f"there is no row {key!r}")
            path, given, system = self.folder.target(key)
            chosen = system if system in self.systems else self.systems[0]
            self._explored[key] = Explored.of(path, given), chosen
        return self._explored[key]

    # requests -----------------------------------------------------------------------------------

    def rows(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """Rows of the folder for which a condition holds."""
        if self.folder is None:
            raise UsageError("questions are asked to folders")
        return self.folder.rows(str(asked.get("where", "")))

    def film(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """The run at a point, or two runs by two systems."""
        explored, values = self._point(asked)
        names = asked.get("systems")
        if not isinstance(names, list) or not 1 <= len(names) <= 2:
            raise UsageError("one system under test or two are expected")
        settings = tuple(map(self._with, names))
        ground = str(asked.get("ground", ""))
        return self._films.film(FilmRequest(explored.scenario, values, settings, ground))

    def map(self, asked: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
        """Values of both axes, then the verdict of each cell, those near the point first; a newer
        map ends it."""
        explored, values = self._point(asked)
        settings = self._with(asked.get("system"))
        axes = [explored.parameter(asked.get(axis)) for axis in "xy"]
        if axes[0] == axes[1]:
            raise UsageError("a map has two different parameters")
        counts = [_count(asked.get(name)) for name in ("columns", "rows")]
        x, y = (axis.spread(count) for axis, count in zip(axes, counts, strict=True))
        if min(len(x), len(y)) < 2:
            raise UsageError("the axes of a map are parameters with a range")
        with self._lock:
            self._maps += 1
            number = self._maps
        at = [_nearest(axis, own, values) for axis, own in zip(axes, (x, y), strict=True)]
        cells = [(i, j) for i in range(len(x)) for j in range(len(y))]
        cells.sort(key=lambda cell: max(abs(cell[0] - at[0]), abs(cell[1] - at[1])))
        points = {(i, j): {**values, axes[0].name: x[i], axes[1].name: y[j]} for i, j in cells}
        return self._cells(x, y, points, partial(verdict_at, explored.scenario), settings, number)

    def _cells(
        self,
        x: list[str],
        y: list[str],
        points: Mapping[tuple[int, int], dict[str, str]],
        play: Callable[[dict[str, str], RunSettings], PointVerdict],
        settings: RunSettings,
        number: int,
    ) -> Iterator[dict[str, Any]]:
        yield {"x": x, "y": y}
        left, running = list(points), dict[Any, tuple[int, int]]()
        try:
            while left or running:
                if number != self._maps:
                    return
                while left and len(running) < 2 * self._jobs:
                    cell = left.pop(0)
                    running[self._workers().submit(play, points[cell], settings)] = cell
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    verdict: PointVerdict = future.result()
                    cell = running.pop(future)
                    yield {"cell": cell, "state": verdict.state, "reason": verdict.reason}
            yield {"done": True}
        except BrokenProcessPool:
            self._pool = None
            yield {"error": "a process that played the map has ended"}
        finally:
            for future in running:
                future.cancel()

    def border(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """Border of failure along a parameter."""
        explored, values = self._point(asked)
        settings = self._with(asked.get("system"))
        parameter = explored.parameter(asked.get("parameter"))
        parameter = replace(parameter, value=values.get(parameter.name, parameter.value))

        def judge(texts: Any) -> list[str]:
            jobs = [
                self._workers().submit(
                    verdict_at, explored.scenario, {**values, parameter.name: text}, settings
                )
                for text in texts
            ]
            return [job.result().state for job in jobs]

        try:
            return border(parameter, judge)._asdict()
        except BrokenProcessPool:
            self._pool = None
            raise ToolchainError("a process that played points has ended") from None

    def save(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """Write a scenario with the point as its declared values, or a variation with the values of
        a map."""
        explored, values = self._point(asked)
        if self._out is None:
            raise UsageError("start with --out DIR to save")
        name = str(asked.get("name", ""))
        varied = None
        if asked.get("kind") == "variation":
            varied = _sets(explored, asked.get("varied"))
        files = copy_scenario(explored.scenario, name, self._out)
        declare(files[0], values)
        if varied is not None:
            files.insert(0, vary(files[0], varied))
        return {"files": [str(path) for path in files]}

    def _point(self, asked: Mapping[str, Any]) -> tuple[Explored, dict[str, str]]:
        explored, _ = self._of(asked.get("row", ""))
        return explored, explored.values(asked.get("parameters"))

    def _with(self, name: object) -> RunSettings:
        """Settings with a system under test that is offered; others may name code."""
        if name not in self.systems:
            raise UsageError(f"the system {name!r} is not offered: name it by --sut")
        own = name == self.systems[0]
        return self._settings if own else replace(self._settings, sut=str(name))

    def _workers(self) -> ProcessPoolExecutor:
        with self._lock:
            if self._pool is None:
                self._pool = executor(self._jobs, anew=True)
            return self._pool


def _told(parameter: ExploredParameter) -> dict[str, Any]:
    return dict(vars(parameter)) | {"choices": list(parameter.choices)}


def _count(given: object) -> int:
    if type(given) is not int or not 2 <= given <= _MOST_CELLS:
        raise UsageError(f"a map has 2 to {_MOST_CELLS} columns and rows")
    return given


def _nearest(axis: ExploredParameter, texts: list[str], values: Mapping[str, str]) -> int:
    """Index of the value of an axis that is nearest to a point's."""
    value = values.get(axis.name, axis.value)
    if value in texts:
        return texts.index(value)
    with suppress(ValueError):
        return min(range(len(texts)), key=lambda n: abs(float(texts[n]) - float(value)))
    return 0


def _sets(explored: Explored, given: object) -> dict[str, list[str]]:
    """Values of each parameter that varies.

    Raises:
        UsageError: there are none, or these are no such values.
    """
    if not isinstance(given, Mapping) or not given:
        raise UsageError("a variation takes the values of a map: draw one first")
    found: dict[str, list[str]] = {}
    for name, texts in given.items():
        if not isinstance(texts, list) or not 1 <= len(texts) <= _MOST_CELLS:
            raise UsageError(f"up to {_MOST_CELLS} values of {name} are expected")
        found[name] = [explored.values({name: text})[name] for text in texts]
    return found


# folders of results -----------------------------------------------------------------------------


class Collection:
    """Rows of batches, searches or catalogues, each with the scenario that can be explored.

    Args:
        paths: folders of one kind.

    Raises:
        UsageError, InvalidFile: their tables can't be read, or are of different kinds.
    """

    def __init__(self, paths: list[Path]) -> None:
        self._index: Index = read_all([str(path) for path in paths])
        self._origins = [path for path in paths for _ in range(read_index(path).table.num_rows)]
        self._root = Path(paths[-1])
        self.title = " and ".join(path.resolve().name for path in paths)

    def rows(self, where: str) -> dict[str, Any]:
        """Columns and rows that keep a condition, those of `xosc-list`, and the number of all that
        do.

        Raises:
            UsageError: the text is no condition.
        """
        import pyarrow as pa

        table = self._index.table
        numbers, shown, hint = pa.array(range(table.num_rows)), self._index.shown, ""
        if where.strip():
            question = condition(where, table.schema)
            shown = [*shown, *question.columns]
            chosen = table.append_column("\0", numbers).filter(question.expression)
            table, hint = chosen, "" if len(chosen) else question.missing(table)
            numbers = table["\0"]
        shown = list(dict.fromkeys(shown))
        cells = table.select(shown).slice(0, _MOST_ROWS).to_pylist()
        return {
            "columns": shown,
            "names": self._index.table.column_names,
            "noun": self._index.noun,
            "count": len(table),
            "hint": hint,
            "rows": [
                [number, *map(_cell, row.values())]
                for number, row in zip(numbers.to_pylist(), cells, strict=False)
            ],
        }

    def target(self, row: str) -> tuple[Path, dict[str, str], str]:
        """Scenario, values of its parameters and system under test of a row.

        Raises:
            UsageError: there is no such row, or nothing says its scenario.
        """
        if not row.isdecimal() or int(row) >= len(self._origins):
            raise UsageError(f"there is no row {row!r}")
        root = self._origins[int(row)]
        values = self._index.table.slice(int(row), 1).to_pylist()[0]
        if self._index.name == RUNS:
            batch = root if journal.is_batch(root) else root.parent
            outcome = journal.finished(batch).outcomes.get(str(values.get("name")))
            if outcome is None:
                raise UsageError("the journal of the batch does not know this run", path=batch)
            system = str(journal.settings(batch).get("sut"))
            return outcome.job.scenario, outcome.job.parameters, system
        if self._index.name == INDEX:
            file = root / str(values.get("maneuver") or values["file"])
            if not file.resolve().is_relative_to(root.resolve()):
                raise UsageError("this file lies outside of the catalogue", path=file)
            return file, {}, ""
        if self._index.name == EPISODES:
            scenario, pinned, system = _searched(root)
            names = {each.name for each in Explored.of(scenario).parameters}
            drawn = {name: f"{value:.6g}" for name, value in values.items() if name in names}
            return scenario, pinned | drawn, system
        raise UsageError(f"a {self._index.noun} names no scenario", path=root)

    def pages(self) -> list[str]:
        """Addresses of the folder's own pages."""
        return [f"page/{name}" for name in _PAGES if (self._root / name).is_file()]

    def file(self, name: str) -> Path | None:
        """A file of the folder that may be served; None for all others, links
        out of it included.
        """
        try:
            path = (self._root / name).resolve(strict=True)
        except (OSError, ValueError):
            return None
        inside = path.is_relative_to(self._root.resolve())
        return path if inside and path.suffix in KINDS and path.is_file() else None


def _cell(value: Any) -> str:
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


def _searched(folder: Path) -> tuple[Path, dict[str, str], str]:
    """Scenario of a search, the values that it has pinned, and its system under test.

    Raises:
        UsageError: the scenario is gone. InvalidFile: the search's summary is damaged.
    """
    for path in sorted(folder.glob("*_search.json")):
        summary = read_object(path)
        # Beside edge cases lies a copy; a search that has found none names the file.
        own = folder / str(summary.get("scenario"))
        for scenario in (own, Path(str(summary.get("file", own)))):
            if scenario.is_file():
                pinned = summary.get("pinned") or {}
                values = {str(name): str(value) for name, value in pinned.items()}
                return scenario, values, str(summary.get("sut", ""))
    raise UsageError("the scenario of this search is gone: name another one", path=folder)
