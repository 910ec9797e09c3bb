"""Variation files: reading what varies, and writing edge cases.

What varies beyond recordings are ranges, distributions of variation files and names of roles. Edge
cases are written as a variation file, concrete scenarios and the density, with tags that tell the
evidence. All files lie in one folder with copies of the scenario, its catalogues and its road, so
that they run wherever it is moved to.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lxml import etree

import xosc
from generation.search.outcomes import Cases
from generation.search.settings import Ask
from generation.space import SpaceChoice
from generation.space.density.base import Density
from generation.space.density.marginals import Choices, Marginal, categories, marginal, uniform
from generation.space.density.models import UNIFORM
from generation.space.density.roles import EGO, ROLES, Role
from generation.space.recorded import Recorded, kind_of, of_recordings, of_samples, of_statements
from generation.space.space import Space
from recognition.labels.maneuvers.parameters import Parameter
from runner.judging.settings import RunSettings
from runner.systems import OF_SYSTEM
from schemas.common.array_types import FloatArray
from schemas.common.errors import UsageError, nearest
from schemas.common.storage import digest, read_object, write_object
from schemas.common.terminal.text import many
from schemas.common.xml import parse_bytes
from xosc.distributions import (
    Deterministic,
    DeterministicMultiParameterDistribution,
    Histogram,
    HistogramBin,
    ParameterSpace,
    ParameterValueDistribution,
    ProbabilityDistributionSet,
    Range,
    Stochastic,
    StochasticDistribution,
)
from xosc.document import Document, to_bytes
from xosc.document.node import Node
from xosc.document.road_files import logic_file
from xosc.exports import standard
from xosc.exports.concrete import concrete, copied
from xosc.exports.draft import Draft, ExportSettings, Folder, roads_in
from xosc.exports.references import take_roads
from xosc.writing.files import FileHeader, new_document
from xosc.writing.tags import Tag, annotated
from xosc.writing.tags import to_bytes as as_openlabel

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
        calls: runs that the cases are chosen from.
        timestep: s.
    """

    sut: str
    method: str
    rss: str
    seed: int
    calls: int
    timestep: float

    def tags(self, pinned: Mapping[str, str]) -> list[Tag]:
        """Return tags, with the values of parameters that were not searched."""
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
        folder: where to.
        run: where road networks and catalogues are looked for that are not where the scenario says.
        overwrite: replace other files that are there; otherwise they are in the way.

    Raises:
        UsageError: something else is in the way there.
    """

    def __init__(
        self,
        scenario: Path,
        space: Space,
        folder: Path,
        run: RunSettings = _AS_USUAL,
        overwrite: bool = False,
    ) -> None:
        self._document = xosc.load(scenario)
        self._space, self._folder, self._stem = space, Folder(folder, overwrite), scenario.stem
        draft = Draft(
            self._folder,
            ExportSettings(roads=roads_in(*run.road_path), catalog_path=run.catalog_path),
        )
        # Copies of everything that the scenario refers to, so that the folder runs wherever it is
        # moved to.
        document = _with_road(self._document, space)
        self._road, self._copies = _take_varied_roads(document, space, draft)
        if self._copies:
            _name_road(document.node, next(iter(self._copies)))
        # Parameters must stay: in other versions of the standard they may not.
        standard.add(document, None, draft)
        if self._copies:
            name = self._folder.name(document.path, f"{self._stem}.xosc")
            draft.add(name, self._by_parameter(draft.content(name)))
        draft.write()

    def _by_parameter(self, content: bytes) -> bytes:
        """The written scenario with its road named by the searched parameter again, whose default
        is a copy's name."""
        root = parse_bytes(content, self._document.path).getroot()
        node = Node(root, self._document.path)
        _name_road(node, f"${self._road}")
        for declared in root.iter("ParameterDeclaration"):
            if declared.get("name") == self._road:
                text = str(declared.get("value"))
                declared.set("value", self._copies.get(text, next(iter(self._copies.values()))))
        return to_bytes(replace(self._document, root=root))

    def _copied(self, name: str, text: str) -> str:
        """Value of a parameter in this folder: of a road, the name of its copy."""
        return self._copies.get(text, text) if name == self._road else text

    def cases(self, cases: Cases, evidence: Evidence) -> Path:
        """The variation file of the cases: a set of values for each, of pinned parameters too; the
        best first."""
        sets = tuple(self._values(row) for row in cases.theta)
        definition = Deterministic((DeterministicMultiParameterDistribution(sets),))
        description = (
            f"{many(len(cases), 'edge case')} of {self._stem} for {evidence.sut}, the best first"
        )
        tags = [Tag(name, values) for name, values in cases.tags().items()]
        document = self._variation(definition, description)
        return self._write(
            f"{self._stem}_edge_cases", document, [*tags, *evidence.tags(self._space.pinned)]
        )

    def concrete(self, cases: Cases, evidence: Evidence, names: Sequence[str] = ()) -> list[Path]:
        """A scenario of each case in which all values are worked out, numbered from 0 as the sets
        of the variation file are.

        Args:
            names: what the files are called after the scenario, in the place of numbers.
        """
        scenario, values = xosc.load(self._folder.path / f"{self._stem}.xosc"), cases.tags()
        written = []
        for number, row in enumerate(cases.theta):
            name = names[number] if names else f"edge_case_{number:06d}"
            tags = [Tag(name, column[number]) for name, column in values.items()] + evidence.tags(
                self._space.pinned
            )
            document = concrete(scenario, self._values(row))
            written.append(self._write(f"{self._stem}_{name}", document, tags))
        return written

    def density(self, density: Density, seed: int) -> Path:
        """Write a stochastic variation file of the density. The standard has no joint densities, so
        each parameter stands alone.

        Histograms of what the density draws within the box. That parameters depend on each other is
        lost.
        """
        drawn = density.sample(_DRAWS, np.random.default_rng(seed))
        # Draws beyond the box would stretch the histograms over values that the scenario refuses.
        drawn = drawn[((drawn >= self._space.low) & (drawn <= self._space.high)).all(axis=1)]
        single = tuple(
            StochasticDistribution(parameter.name, self._single(parameter, drawn[:, column]))
            for column, parameter in enumerate(self._space.parameters)
        )
        description = (
            f"Recorded parameters of {self._stem}, each drawn on its own: the standard can't "
            "express how they depend on each other; xosc-generate --draw N draws them together"
        )
        document = self._variation(Stochastic(_RUNS, single, float(seed)), description)
        return self._write(f"{self._stem}_density", document, [])

    def _single(
        self, parameter: Parameter, drawn: FloatArray
    ) -> Histogram | ProbabilityDistributionSet:
        """The distribution of one parameter from its draws (n,)."""
        categories = self._space.categories(parameter.name)
        if not categories:
            return _histogram(drawn, parameter.low, parameter.high)
        nearest_code = np.abs(drawn[:, None] - np.array(list(categories))).argmin(axis=1)
        counts = np.bincount(nearest_code, minlength=len(categories)).tolist()
        weights = Counter[str]()
        for texts, count in zip(categories.values(), counts, strict=True):
            weights[self._copied(parameter.name, texts[parameter.name])] += count
        return ProbabilityDistributionSet(
            tuple((text, float(weight)) for text, weight in weights.items() if weight)
        )

    def _values(self, row: FloatArray) -> dict[str, str]:
        values = {**self._space.pinned, **self._space.values(row)}
        return {name: self._copied(name, text) for name, text in values.items()}

    def _variation(self, definition: Deterministic | Stochastic, description: str) -> Document:
        distribution = ParameterValueDistribution(f"{self._stem}.xosc", definition)
        return new_document(
            self._folder.path / "variation.xosc", self._header(description), [distribution.write()]
        )

    def _header(self, description: str) -> FileHeader:
        """Return a header with the scenario's date, so that the same search
        gives the same bytes.
        """
        date = self._document.node.need("FileHeader").get("date")
        return FileHeader(description, AUTHOR, datetime.fromisoformat(date))

    def _write(self, stem: str, document: Document, tags: list[Tag]) -> Path:
        path = self._folder.path / f"{stem}.xosc"
        document = replace(document, path=path)
        if tags:
            self._folder.write(f"{stem}.openlabel.json", as_openlabel(tags, path.name, AUTHOR))
            # Properties in the FileHeader exist from 1.2 on; OpenLABEL beside the file has the tags
            # of any version.
            document = annotated(document, tags) if document.version >= (1, 2) else document
        self._folder.write(path.name, to_bytes(document))
        return path


class Written:
    """Files that searches have written into a folder for a scenario, so that a resumed search can
    replace them.

    Args:
        folder: of the files. stem: name of the scenario's file without its ending.
    """

    def __init__(self, folder: Path, stem: str) -> None:
        self._folder, self._stem = folder, stem
        self._notes = folder / f"{stem}_files.json"

    def withdraw(self, changed: bool = False) -> None:
        """Remove the unchanged files of an earlier search; with `changed`, edited ones too.

        Raises:
            InvalidFile: the notes on it are malformed.
        """
        for name, content in (read_object(self._notes) if self._notes.exists() else {}).items():
            path = self._folder / name
            if (
                # Names come from a file that may have been edited: nothing outside the folder is
                # removed.
                path.parent == self._folder
                and path.is_file()
                and (changed or digest(path.read_bytes()) == content)
            ):
                path.unlink()

    def note(self) -> None:
        """Record names and digests of the present files."""
        found = [
            path for pattern in _WRITTEN for path in self._folder.glob(pattern.format(self._stem))
        ]
        # A search without cases leaves no notes, unless they have to say that files of before are
        # gone.
        if found or self._notes.exists():
            write_object(
                {path.name: digest(path.read_bytes()) for path in sorted(found)}, self._notes
            )


def _with_road(document: Document, space: Space) -> Document:
    """The scenario with the names of its road files that are values of parameters: files are taken
    along by name."""
    found = copied(document)
    for element in found.root.iter("LogicFile", "SceneGraphFile"):
        name = str(element.get("filepath", "")).removeprefix("$")
        if name in space.pinned:
            element.set("filepath", space.pinned[name])
    return found


def _take_varied_roads(
    document: Document, space: Space, draft: Draft
) -> tuple[str, dict[str, str]]:
    """Take along all roads that a searched parameter names: its name, and names of their copies by
    its values; none where no searched parameter names the road."""
    logic, copies = logic_file(document.node), dict[str, str]()
    name = "" if logic is None else logic.get("filepath").removeprefix("$")
    # Names of roads are words, which a search has as categories: all of them are known.
    for texts in (texts for coded in space.follows.values() for texts in coded.values()):
        if name in texts and texts[name] not in copies:
            one = copied(document)
            _name_road(one.node, texts[name])
            take_roads(one, draft)
            copies[texts[name]] = one.node.need("RoadNetwork").need("LogicFile").get("filepath")
    return name, copies


def _name_road(scenario: Node, text: str) -> None:
    scenario.need("RoadNetwork").need("LogicFile").element.set("filepath", text)


def _histogram(values: FloatArray, low: float, high: float) -> Histogram:
    counts, edges = np.histogram(values, _BINS, (low, high))
    bins = zip(edges[:-1].tolist(), edges[1:].tolist(), counts.tolist(), strict=True)
    return Histogram(
        tuple(HistogramBin(Range(round(a, 6), round(b, 6)), float(count)) for a, b, count in bins)
    )


class NothingToVary(UsageError):
    """A variation file leaves nothing to search.

    Attributes:
        reason: without a remedy. scenario: its scenario, which can be searched itself.
    """

    def __init__(self, reason: str, scenario: Path, path: Path) -> None:
        super().__init__(f"{reason}: search {scenario.name} itself", path=path)
        self.reason, self.scenario = reason, scenario

    def __reduce__(self) -> tuple[object, ...]:
        return (type(self), (self.reason, self.scenario, Path(str(self.path))))


class Varied(NamedTuple):
    """Contents of a variation file.

    Attributes:
        scenario: its file.
        marginals: densities of the parameters that it varies.
        pinned: single values by parameter.
    """

    scenario: Path
    marginals: dict[str, Marginal]
    pinned: dict[str, str]


def varied(path: Path) -> Varied | None:
    """Read a variation file; None for a scenario.

    Raises:
        InvalidFile: the file is malformed, or a catalogue.
        UsageError: one of its distributions has no density.
    """
    if xosc.load(path).kind != "distribution":
        return None
    space = ParameterSpace(path)
    found = Varied(space.scenario, {}, {})
    if space.distribution is None:
        return None
    for variation in space.distribution.definition.distributions:
        if isinstance(variation, DeterministicMultiParameterDistribution):
            _add_sets(found, variation.value_sets, path)
            continue
        try:
            of = marginal(variation.distribution, variation.parameter_name)
        except UsageError as error:
            raise UsageError(f"{variation.parameter_name}: {error.message}", path=path) from None
        # One value: nothing to search, but the scenario's own default is not what the file says.
        if isinstance(of, str):
            found.pinned[variation.parameter_name] = of
        else:
            found.marginals[variation.parameter_name] = of
    return found


def _add_sets(found: Varied, sets: Sequence[Mapping[str, str]], path: Path) -> None:
    """Add sets of values as the values of one parameter, which the others follow: the first number
    that is another one in each set; else the sets are categories of the first parameter of all.

    Raises:
        NothingToVary: sets differ, and no parameter is in all of them.
    """
    for name in sets[0]:
        try:
            values = [float(assignment[name]) for assignment in sets]
        except (KeyError, ValueError):
            continue
        # As a number it has an order and distances, which codes have not.
        if len(values) > 1 and len(set(values)) == len(values) and np.isfinite(values).all():
            rest = [
                {other: text for other, text in assignment.items() if other != name}
                for assignment in sets
            ]
            follows = dict(sorted(zip(values, rest, strict=True), key=lambda pair: pair[0]))
            found.marginals[name] = Choices(
                tuple(follows), (1.0,) * len(values), follows if any(rest) else {}
            )
            return
    codes = categories(sets, [1.0] * len(sets))
    # All sets are equal: they pin their parameters.
    if codes is None:
        found.pinned.update(sets[0])
        return
    common = [name for name in sets[0] if all(name in each for each in sets)]
    if not common:
        raise NothingToVary("no parameter is in all of its sets of values", found.scenario, path)
    found.marginals[common[0]] = codes


def scenario_of(path: Path) -> Path:
    """The scenario of a variation file; of a scenario, itself."""
    variation = varied(path)
    return path if variation is None else variation.scenario


def _refuse_undeclared(scenario: Path, roles: Mapping[str, Role]) -> None:
    """A role of what the scenario does not declare is better named before anything else is asked
    for."""
    holder = xosc.load(scenario).node.find("ParameterDeclarations")
    declared = (
        [declaration.get("name") for declaration in holder.children("ParameterDeclaration")]
        if holder is not None
        else []
    )
    for name in roles:
        if name not in declared:
            raise UsageError(
                f"--map: there is no parameter {name!r}; {nearest(name, declared)}", path=scenario
            )


def freed(texts: Iterable[str]) -> tuple[tuple[str, ...], dict[str, Marginal]]:
    """Read the names to search, and ranges where given, from texts NAME or NAME=LOW..HIGH.

    Raises:
        UsageError: a text has neither form.
    """
    names, ranges = [], {}
    for text in texts:
        name, equals, limits = text.partition("=")
        low, dots, high = limits.partition("..")
        try:
            if equals:
                ranges[name] = uniform(float(low), float(high))
            elif name:
                names.append(name)
            if not name or bool(equals) != bool(dots):
                raise ValueError
        except (ValueError, UsageError):
            raise UsageError(
                f"--free {text!r}: NAME or NAME=LOW..HIGH is expected, as Ego_Speed_mps=10..40"
            ) from None
    return tuple(names), ranges


def with_literals(ask: Ask, path: Path, folder: Path, overwrite: bool = False) -> tuple[Ask, Path]:
    """Declare literals of a scenario that are to be searched as parameters, in a copy with its
    roads and catalogues.

    A literal is LINE@ATTRIBUTE of the file, as in `--free 87@value=10..40`. Parameters of the
    system under test, as in `--free sut_delay=0..0.5`, are declared too where the file has none of
    the name.

    Returns:
        what is asked for by the names of the parameters, and the copy; both as they are without
        literals.

    Raises:
        UsageError: it is none of a scenario, or no number, or the folder has another scenario of
            that name and `overwrite` is not asked for.
    """
    literals = [text for text in ask.free if _LITERAL.match(text)]
    of_system = [text for text in ask.free if _OF_SYSTEM.match(text)]
    # The scenario itself is searched: a copy would only have another name.
    if not literals and not of_system:
        return ask, path
    document = copied(xosc.load(path))
    # A parameter that the file declares itself keeps its limits and its default.
    known = {each.get("name") for each in document.node.iter("ParameterDeclaration")}
    of_system = [text for text in of_system if text.partition("=")[0] not in known]
    literals += of_system
    if not literals:
        return ask, path
    if document.kind != "scenario":
        raise UsageError(f"--free {literals[0]}: literals are those of a scenario", path=path)
    declared = document.node.find("ParameterDeclarations")
    holder = (
        declared.element
        if declared is not None
        else document.root.makeelement("ParameterDeclarations", {}, None)
    )
    if declared is None:
        document.node.need("FileHeader").element.addnext(holder)
    free = [text for text in ask.free if text not in literals]
    for text in literals:
        where, _, limits = text.partition("=")
        # Of a system's parameter the file has no value: the lower limit stands for one.
        name, value = where, limits.partition("..")[0]
        if text not in of_system:
            name, value = _declared(document.node, where, path)
        etree.SubElement(
            holder, "ParameterDeclaration", name=name, parameterType="double", value=value
        )
        free.append(f"{name}={limits}")
    draft = Draft(Folder(folder, overwrite), ExportSettings())
    standard.add(document, None, draft)
    draft.write()
    return replace(ask, free=free), folder / f"{path.stem}.xosc"


_LITERAL = re.compile(r"\d+@\w")
_OF_SYSTEM = re.compile(rf"{OF_SYSTEM}\w+=[-+\d.eE]+\.\.")


def _declared(root: Node, where: str, path: Path) -> tuple[str, str]:
    """Put a reference in the place of a literal; the name of its parameter, and its value."""
    line, _, attribute = where.partition("@")
    found = [node for node in root.iter() if node.line == int(line) and node.has(attribute)]
    # Several elements may stand in one line, and one attribute in two of them.
    if len(found) != 1:
        raise UsageError(
            f"--free {where}: {len(found) or 'no'} elements of this line have the "
            f"attribute {attribute}",
            path=path,
        )
    value = found[0].get(attribute)
    try:
        float(value)
    except ValueError:
        of = value.removeprefix("$")
        hint = (
            f"; --free {of}=LOW..HIGH searches it" if value[:1] == "$" and of.isidentifier() else ""
        )
        raise UsageError(
            f"--free {where}: {attribute} is {value!r}, not a number{hint}", path=path
        ) from None
    # A name that tells the place, for rules and tables that have nothing else.
    name = f"{found[0].tag}_{attribute}_{line}"
    found[0].element.set(attribute, f"${name}")
    return name, value


def mapped(texts: Iterable[str]) -> dict[str, Role]:
    """Roles by parameter, from texts NAME=ROLE or NAME=ROLE*FACTOR.

    Raises:
        UsageError: a text has another form, there is no such role, or two parameters have the same.
    """
    roles: dict[str, Role] = {}
    for text in texts:
        name, equals, right = text.partition("=")
        role, times, factor = right.partition("*")
        try:
            scale = float(factor) if times else 1.0
        except ValueError:
            scale = 0.0
        if not (name and equals and 0.0 < scale < math.inf):
            raise UsageError(
                f"--map {text!r}: NAME=ROLE or NAME=ROLE*FACTOR is expected, as "
                "Ego_speed_kph=ego_speed*3.6"
            )
        if role not in ROLES:
            raise UsageError(
                f"--map {text!r}: recordings have no role {role!r}; roles: {', '.join(ROLES)}"
            )
        # Two parameters of one role would get the same recorded values, and never differ.
        if role in (known.role for known in roles.values()):
            raise UsageError(f"--map {text!r}: another parameter has the role {role}")
        roles[name] = Role(EGO, role, scale)
    return roles


class Asked(NamedTuple):
    """A search as it was asked for.

    Attributes:
        scenario: the file to search.
        recorded: gives what is recorded of the parameters of its space, or stated in its place.
        choice: parameters to search.
    """

    scenario: Path
    recorded: Callable[[Space], Recorded]
    choice: SpaceChoice


def asked_of(ask: Ask, path: Path) -> Asked:
    """Return the search that the options ask for, of a scenario or of a variation file's scenario
    and parameters.

    Recordings say what is likely where a kind of them is known: by `--kind`, or of a scenario of
    the library by its name. Otherwise the distributions of the variation file and the ranges of
    `--free` are the density, and with the density `uniform` the limits of all that is searched.

    Raises:
        UsageError: an option is wrong, or nothing says what is likely.
        InvalidFile: a file is malformed.
    """
    variation, (free, ranges), roles = varied(path), freed(ask.free), mapped(ask.maps)
    scenario = variation.scenario if variation is not None else path
    if variation is not None and not (variation.marginals or ranges or free or roles):
        raise NothingToVary(
            "it gives each parameter one value, which leaves nothing to search", scenario, path
        )
    _refuse_undeclared(scenario, roles)
    # What is said on the command line wins over the file.
    stated = {**(variation.marginals if variation is not None else {}), **ranges}
    marginals = {name: marginal for name, marginal in stated.items() if name not in ask.pinned}
    pinned = {**(variation.pinned if variation is not None else {}), **ask.pinned}
    pinned = {
        name: value for name, value in pinned.items() if name not in ranges and name not in free
    }
    if _is_recorded(ask, scenario, variation is not None, bool(marginals)):
        samples, simulated = (
            of_recordings(ask.recordings, ask.kind or kind_of(scenario)),
            ask.recordings is None,
        )
        # A file, or a role, says what is to be searched: nothing is added by itself.
        default = variation is None and not roles
        named = (*free, *(name for name in roles if name not in marginals))
        recorded = partial(
            of_samples, samples, mapped=roles, marginals=marginals, simulated=simulated
        )
        choice = SpaceChoice(pinned=pinned, free=named, marginals=marginals, default=default)
        return Asked(scenario, recorded, choice)
    default = variation is None and not ranges
    choice = SpaceChoice(pinned=pinned, free=free, marginals=marginals, default=default)
    return Asked(scenario, partial(of_statements, marginals), choice)


def _is_recorded(ask: Ask, scenario: Path, variation: bool, stated: bool) -> bool:
    """Whether recordings provide the density."""
    if ask.density == UNIFORM:
        return False
    # Each of these names recordings; without them the scenario's name has to.
    if ask.kind is not None or ask.recordings is not None or ask.maps:
        return True
    try:
        kind_of(scenario)
    except UsageError:
        if stated:
            return False
        raise
    return not variation
