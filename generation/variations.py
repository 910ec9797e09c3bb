"""Edge cases as files of the standard: a variation file, concrete scenarios, the density; with tags that tell the evidence.

All files lie in one folder with copies of the scenario, its catalogues and its road, so that they run wherever it is moved to.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

import numpy as np

import xosc
from generation.density.base import Density
from generation.outcomes.judges import Cases
from generation.search.space import Space
from runner.settings import RunSettings
from schemas.common.array_types import FloatArray
from schemas.common.storage import digest, read_object, write_object
from schemas.common.text import many
from xosc.distributions import (
    Deterministic,
    DeterministicMultiParameterDistribution,
    Histogram,
    HistogramBin,
    ParameterValueDistribution,
    Range,
    Stochastic,
    StochasticDistribution,
)
from xosc.document import Document, to_bytes
from xosc.exports import standard
from xosc.exports.concrete import concrete, copied
from xosc.exports.draft import Draft, ExportSettings, Folder, roads_in
from xosc.files import FileHeader, new_document
from xosc.tags import Tag, annotated
from xosc.tags import to_bytes as as_openlabel

_AS_USUAL = RunSettings()

AUTHOR = "xosc-toolchain"
_BINS = 20
_DRAWS = 20_000
"""Draws from the density whose histograms are written"""
_WRITTEN = "{}_edge_case*", "{}_density.xosc", "{}_*_failure*", "{}_region_*", "report.html"
"""Patterns of the files that a search writes, by the name of its scenario"""
_RUNS = 100
"""Test runs that a stochastic file asks for"""


@dataclass(frozen=True)
class Evidence:
    """Evidence for all cases of a file.

    Attributes:
        sut: name of the system under test.
        method: of the search.
        rss: name of the RSS parameter set.
        seed: of the search.
        calls: simulator calls of the search.
        timestep: s.
    """

    sut: str
    method: str
    rss: str
    seed: int
    calls: int
    timestep: float

    def tags(self, pinned: Mapping[str, str]) -> list[Tag]:
        """As tags, with the values of parameters that were not searched."""
        return [
            Tag("SystemUnderTest", self.sut),
            Tag("SearchMethod", self.method),
            Tag("RssParameterSet", self.rss),
            Tag("Seed", float(self.seed)),
            Tag("SimulatorCalls", float(self.calls)),
            Tag("Timestep", self.timestep),
            Tag("PinnedParameters", [f"{name}={value}" for name, value in pinned.items()]),
        ]


class Writer:
    """Writes into a folder.

    Args:
        scenario: the logical scenario, which is copied with all that it refers to.
        space: the parameters that were searched.
        folder: where to; what is there already is not overwritten.
        run: where road networks and catalogues are looked for that are not where the scenario says.

    Raises:
        UsageError: something else is in the way there.
    """

    def __init__(self, scenario: Path, space: Space, folder: Path, run: RunSettings = _AS_USUAL) -> None:
        self._document = xosc.load(scenario)
        self._space, self._folder, self._stem = space, Folder(folder), scenario.stem
        draft = Draft(self._folder, ExportSettings(roads=roads_in(*run.road_path), catalog_path=run.catalog_path))
        standard.add(
            _with_road(self._document, space), None, draft
        )  # parameters must stay: in other versions of the standard they may not
        draft.write()

    def cases(self, cases: Cases, evidence: Evidence) -> Path:
        """The variation file of the cases: a set of values for each, of pinned parameters too; the best first."""
        sets = tuple(self._values(row) for row in cases.theta)
        definition = Deterministic((DeterministicMultiParameterDistribution(sets),))
        description = f"{many(len(cases), 'edge case')} of {self._stem} for {evidence.sut}, the best first"
        tags = [Tag(name, values) for name, values in cases.tags().items()]
        document = self._variation(definition, description)
        return self._write(f"{self._stem}_edge_cases", document, [*tags, *evidence.tags(self._space.pinned)])

    def concrete(self, cases: Cases, evidence: Evidence, names: Sequence[str] = ()) -> list[Path]:
        """A scenario of each case in which all values are worked out, numbered from 0 as the sets of the variation file are.

        Args:
            names: what the files are called after the scenario, in the place of numbers.
        """
        scenario, values = xosc.load(self._folder.path / f"{self._stem}.xosc"), cases.tags()
        written = []
        for number, row in enumerate(cases.theta):
            name = names[number] if names else f"edge_case_{number:06d}"
            tags = [Tag(name, column[number]) for name, column in values.items()] + evidence.tags(self._space.pinned)
            document = concrete(scenario, self._values(row))
            written.append(self._write(f"{self._stem}_{name}", document, tags))
        return written

    def density(self, density: Density, seed: int) -> Path:
        """A stochastic variation file of the density, as far as the standard can say it: each parameter on its own.

        Histograms of what the density draws within the box. That parameters depend on each other is lost.
        """
        drawn = density.sample(_DRAWS, np.random.default_rng(seed))
        drawn = drawn[((drawn >= self._space.low) & (drawn <= self._space.high)).all(axis=1)]
        single = tuple(
            StochasticDistribution(each.name, _histogram(drawn[:, column], each.low, each.high))
            for column, each in enumerate(self._space.parameters)
        )
        description = (
            f"Recorded parameters of {self._stem}, each on its own: the standard can't express how they depend on each other"
        )
        document = self._variation(Stochastic(_RUNS, single, float(seed)), description)
        return self._write(f"{self._stem}_density", document, [])

    def _values(self, row: FloatArray) -> dict[str, str]:
        return {**self._space.pinned, **self._space.values(row)}

    def _variation(self, definition: Deterministic | Stochastic, description: str) -> Document:
        distribution = ParameterValueDistribution(f"{self._stem}.xosc", definition)
        return new_document(self._folder.path / "variation.xosc", self._header(description), [distribution.write()])

    def _header(self, description: str) -> FileHeader:
        """With the scenario's date, so that the same search gives the same bytes."""
        date = self._document.node.need("FileHeader").get("date")
        return FileHeader(description, AUTHOR, datetime.fromisoformat(date))

    def _write(self, stem: str, document: Document, tags: list[Tag]) -> Path:
        path = self._folder.path / f"{stem}.xosc"
        document = replace(document, path=path)
        if tags:
            self._folder.write(f"{stem}.openlabel.json", as_openlabel(tags, path.name, AUTHOR))
            document = annotated(document, tags) if document.version >= (1, 2) else document
        self._folder.write(path.name, to_bytes(document))
        return path


class Written:
    """The files that searches have written into a folder for a scenario, so that a search that goes on can replace them.

    Args:
        folder: of the files. stem: name of the scenario's file without its ending.
    """

    def __init__(self, folder: Path, stem: str) -> None:
        self._folder, self._stem = folder, stem
        self._notes = folder / f"{stem}_files.json"

    def withdraw(self) -> None:
        """Remove what was written before and has not been changed since.

        Raises:
            InvalidFile: the notes on it are malformed.
        """
        for name, content in (read_object(self._notes) if self._notes.exists() else {}).items():
            path = self._folder / name
            if path.parent == self._folder and path.is_file() and digest(path.read_bytes()) == content:
                path.unlink()

    def note(self) -> None:
        """Take note of what is there now."""
        found = [path for pattern in _WRITTEN for path in self._folder.glob(pattern.format(self._stem))]
        if found or self._notes.exists():
            write_object({path.name: digest(path.read_bytes()) for path in sorted(found)}, self._notes)


def _with_road(document: Document, space: Space) -> Document:
    """The scenario with the names of its road files that are values of parameters: files are taken along by name."""
    found = copied(document)
    for element in found.root.iter("LogicFile", "SceneGraphFile"):
        name = str(element.get("filepath", "")).removeprefix("$")
        if name in space.pinned:
            element.set("filepath", space.pinned[name])
    return found


def _histogram(values: FloatArray, low: float, high: float) -> Histogram:
    counts, edges = np.histogram(values, _BINS, (low, high))
    bins = zip(edges[:-1].tolist(), edges[1:].tolist(), counts.tolist(), strict=True)
    return Histogram(tuple(HistogramBin(Range(round(a, 6), round(b, 6)), float(count)) for a, b, count in bins))
