"""Inputs of the loop: recordings and scenarios of a folder, and the targets that are searched."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, count
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import xosc
from generation.loop.findings import DensitySource, Refused
from generation.pipeline import LEAST
from generation.search.settings import Ask
from generation.search.variations import Asked, NothingToVary, asked_of, scenario_of
from generation.space.logical.library import SCENARIOS
from generation.space.recorded import Recorded, RecordedScenario, kind_of, of_catalogue, of_samples
from generation.space.space import Space
from recognition import recordings as datasets
from recognition.labels.classes import Label
from recognition.labels.maneuvers.units import OWN, Samples
from recognition.recordings import Source
from runner.batch.inputs import files
from runner.judging.settings import RunSettings
from schemas.common.errors import InvalidFile, ToolchainError, Unsupported, UsageError
from schemas.common.storage import digest


class Inputs(NamedTuple):
    """Contents of a folder.

    Attributes:
        folder: the folder.
        recordings: of the formats that recognition reads.
        scenarios: OpenSCENARIO files but catalogues: scenarios and variation files, those that
            can't be read among them.
    """

    folder: Path
    recordings: list[Source]
    scenarios: list[Path]

    @classmethod
    def of(cls, folder: Path) -> Inputs:
        """Look through a folder and all below it.

        Raises:
            UsageError: it is a file.
            InvalidFile: it does not exist, or holds neither recordings nor scenarios.
        """
        if folder.is_file():
            raise UsageError(
                "a folder is expected, with recordings or scenarios in it", path=folder
            )
        if not folder.exists():
            raise InvalidFile("no such folder", path=folder)
        scenarios = [
            path
            for path in sorted(folder.rglob("*.xosc"))
            if not path.is_dir() and not _is_catalog(path)
        ]
        try:
            # The folder itself is named where no format claims anything in it; a folder of
            # scenarios alone is as good an input.
            recordings = datasets.open(folder).sources
        except InvalidFile as error:
            if error.path != str(folder):  # a recording whose name no scenario can have
                raise
            if not scenarios:
                raise InvalidFile(
                    f"{error.message}, and no scenario (.xosc)", path=folder
                ) from None
            recordings = []
        return cls(folder, recordings, scenarios)

    @property
    def names(self) -> dict[Path, str]:
        """A name for each scenario, no two the same: its file's, with the folders below ours where
        others have that too."""
        # Two folders often have a file of one name, as copies of a scenario for two versions.
        stems = Counter(path.stem for path in self.scenarios)
        inside = {path: path.relative_to(self.folder).with_suffix("") for path in self.scenarios}
        return distinct(
            {
                path: path.stem if stems[path.stem] == 1 else "_".join(inside[path].parts)
                for path in self.scenarios
            }
        )

    @property
    def recorded(self) -> str:
        """A short name for all files of the folder but scenarios, by their content; empty without
        recordings.

        Raises:
            InvalidFile: one of them can't be read.
        """
        if not self.recordings:
            return ""
        # All files, not the recordings alone: maps and declarations beside them decide too.
        paths = sorted(
            path for path in self.folder.rglob("*") if path.is_file() and path.suffix != ".xosc"
        )
        return digest(
            repr(
                [(path.relative_to(self.folder).as_posix(), _content(path)) for path in paths]
            ).encode()
        )

    def played(self, run: RunSettings) -> str:
        """A short name for the scenarios, with the roads and catalogues that they refer to, by
        their content."""
        return digest(repr([played(path, run) for path in self.scenarios]).encode())


def distinct(names: Mapping[Path, str], taken: Iterable[str] = ()) -> dict[Path, str]:
    """Names by file, numbered where a file before it has the same name, or `taken` holds it."""
    # A target's name is that of its stage and folder: of two with one name the second would be lost
    # without a word. `a/b.xosc` has the name of `a_b.xosc`, and a file may have that of a class.
    used, named = set(taken), dict[Path, str]()
    for path, name in names.items():
        numbered = (f"{name}_{number}" for number in count(2))
        named[path] = next(other for other in chain([name], numbered) if other not in used)
        used.add(named[path])
    return named


def played(path: Path, run: RunSettings, pinned: Mapping[str, str] = MappingProxyType({})) -> Any:
    """The content of a scenario, or of a variation file and its scenario, and what is wrong with
    it."""
    # An invalid scenario has a digest too: when it is mended, the stages after it are done again.
    content = ""
    try:
        content = _content(path)
        return content, files(scenario_of(path), run, pinned)
    except ToolchainError as error:
        return content, str(error)


def _is_catalog(path: Path) -> bool:
    """Whether a file is a catalogue; false for a file that can't be read, which each stage reports
    by itself."""
    try:
        return xosc.load(path).kind == "catalog"
    except ToolchainError:
        return False


def _content(path: Path) -> str:
    """A digest of a file, which may be larger than memory."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "blake2b").hexdigest()
    except OSError as error:
        raise InvalidFile(f"the file can't be read: {error.strerror or error}", path=path) from None


LIBRARY = {
    Label.FREE_CRUISE: "free_cruise_highway",
    Label.CAR_FOLLOWING: "car_following_highway",
    Label.CUT_IN: "cut_in_highway",
    Label.CUT_OUT: "cut_out_highway",
    Label.LANE_CHANGE_LEFT: "lane_change_left_highway",
    Label.LANE_CHANGE_RIGHT: "lane_change_right_highway",
    Label.RAMP_ENTERING: "ramp_entering_highway",
    Label.RAMP_EXITING: "ramp_exiting_highway",
    Label.URBAN_CUT_IN: "cut_in_narrow_road",
    Label.URBAN_CUT_OUT: "cut_out_narrow_road",
}
"""The library's logical scenario of a class, for those whose parameters can be measured in
recordings."""


class SearchTarget(NamedTuple):
    """Scenario to search, with its recordings and settings.

    Attributes:
        name: of its folder.
        title: the class, or the user's scenario.
        scenario: the logical scenario.
        recorded: gives the recorded parameters of its space.
        prior: how many these are, and whose.
        asked: what the user's options and a variation file say of it; None where all is by default.
    """

    name: str
    title: str
    scenario: Path
    recorded: Callable[[Space], Recorded]
    prior: DensitySource
    asked: Asked | None = None


def of_classes(
    rows: Iterable[dict[str, Any]], catalogue: Path, own: Samples | None
) -> Iterator[SearchTarget | Refused]:
    """Yield the search of each class of a catalogue, in the order of the classes.

    Its own manoeuvres are varied where there are enough of them for a density; else the library's
    scenario of the class.

    Args:
        rows: of the catalogue's index.
        catalogue: its folder.
        own: units of the same recordings; None for none.
    """
    own_scenarios = {scenario.path.parent.name: scenario for scenario in of_catalogue(catalogue)}
    folders = {str(row["class"]): Path(row["file"]).parts[0] for row in rows}
    # Discovered classes have titles of their own: they come last, in order of the alphabet.
    labels = {label.title: label for label in Label}
    for title in sorted(folders, key=lambda title: (labels.get(title, len(labels)), title)):
        folder, label = folders[title], labels.get(title, Label.UNKNOWN)
        if (target := _of_catalogue(folder, title, own_scenarios.get(folder))) is not None:
            yield target
        elif label in LIBRARY:
            yield of_scenario(SCENARIOS / f"{LIBRARY[label]}.xosc", own, folder, title)
        else:
            yield Refused(title, _why_not(own_scenarios.get(folder)))


def _of_catalogue(
    folder: str, title: str, scenario: RecordedScenario | None
) -> SearchTarget | None:
    """The catalogue's own scenario; None where there are too few of its like."""
    if scenario is None:
        return None
    space = Space.of(scenario.path)
    # Counted within the limits of the scenario: units beyond them never enter its density.
    recorded = len(scenario.on(space).within(space).theta)
    return (
        SearchTarget(folder, title, scenario.path, scenario.on, DensitySource(recorded, own=True))
        if recorded >= LEAST
        else None
    )


def _why_not(scenario: RecordedScenario | None) -> str:
    if scenario is None:
        return "nothing is recorded of parameters by which it could be varied"
    return (
        f"{len(scenario.recorded.theta)} manoeuvres with another participant are recorded, "
        f"{LEAST} make a density"
    )


def of_scenario(
    path: Path, own: Samples | None, name: str | None = None, title: str | None = None
) -> SearchTarget | Refused:
    """A logical scenario, with the parameters of these recordings where there are enough, else of
    the units that are shipped.

    Args:
        own: units of these recordings; None for none.
        name, title: of the target; by default the file's.
    """
    name, title = name or path.stem, title or path.stem
    try:
        # The kind tells which units are like the scenario: a cut-in knows nothing of cut-outs.
        kind = kind_of(path)
        recorded, prior = _recorded(Space.of(path), kind, own)
    except (UsageError, Unsupported) as error:
        return Refused(title, error.message)
    return SearchTarget(name, title, path, recorded, prior)


def of_inputs(
    names: Mapping[Path, str], own: Samples | None, ask: Ask
) -> Iterator[SearchTarget | Refused]:
    """The scenarios and variation files of the user; one that is not searched is reported with its
    replacements.

    Args:
        names: of the targets, by file.
        own: units of the user's recordings; None for none.
    """
    outcomes = {path: _of_input(path, own, ask, name) for path, name in names.items()}
    # First all outcomes, then the refusals: each names what is searched in its place, which may
    # stand after it in the folder.
    searched: dict[Path, list[str]] = {}
    for outcome in outcomes.values():
        if isinstance(outcome, SearchTarget):
            searched.setdefault(outcome.scenario.resolve(), []).append(outcome.title)
    beside = {path.resolve(): name for path, name in names.items()}
    for path, outcome in outcomes.items():
        if isinstance(outcome, NothingToVary):
            of = outcome.scenario.resolve()
            # Two variation files of one scenario, of which one varies nothing.
            if of in searched:
                yield Refused(
                    names[path], f"{outcome.reason}; in its place: {', '.join(searched[of])}"
                )
            elif of in beside:  # which says what can be done
                yield Refused(
                    names[path],
                    f"{outcome.reason}, and its scenario {beside[of]} is not searched either",
                )
            else:
                yield Refused(names[path], outcome.message)
        # A scenario without ranges of its own is no loss where its variation file states them.
        elif isinstance(outcome, Refused) and path.resolve() in searched:
            instead = searched[path.resolve()]
            files = "its variation file is" if len(instead) == 1 else "its variation files are"
            yield Refused(names[path], f"{files} searched in its place: {', '.join(instead)}")
        else:
            yield outcome


def _of_input(
    path: Path, own: Samples | None, ask: Ask, name: str
) -> SearchTarget | Refused | NothingToVary:
    """A scenario or a variation file of the user: as the options say, else by its name.

    Options count for those scenarios that declare the parameters that they name.

    Args:
        own: units of the user's recordings; None for none.
        name: of the target.
    """
    try:
        asking = _concerning(ask, path)
        # Without options, a scenario is searched by the kind that its name tells, as in
        # xosc-generate.
        if asking == Ask() and xosc.load(path).kind == "scenario":
            return of_scenario(path, own, name, name)
        asked = asked_of(asking, path)
        space = Space.of(asked.scenario, asked.choice)
        recorded = asked.recorded(space)
        count = len(recorded.within(space).theta)
        if count < LEAST:
            raise UsageError(f"fewer than {LEAST} recorded manoeuvres are like it")
    except NothingToVary as error:
        return error
    except (UsageError, Unsupported, InvalidFile) as error:
        return Refused(name, _with_place(error, path))
    # With a density stated of each parameter, recordings were not asked: none are claimed.
    stated = len(recorded.marginals) == len(space.names)
    return SearchTarget(
        name,
        name,
        asked.scenario,
        asked.recorded,
        DensitySource(0 if stated else count, own=False),
        asked,
    )


def _with_place(error: ToolchainError, path: Path) -> str:
    """Return an error of a file with its line, or with the other file it is in."""
    if error.path in (None, str(path)):
        return f"line {error.line}: {error.message}" if error.line else error.message
    return f"{Path(str(error.path)).name}{f':{error.line}' if error.line else ''}: {error.message}"


def _concerning(ask: Ask, path: Path) -> Ask:
    """Return the options that concern the parameters a scenario declares."""
    declared = xosc.load(scenario_of(path)).node.find("ParameterDeclarations")
    # A folder holds scenarios of many kinds: an option for one may not refuse the others.
    names = (
        {declaration.get("name") for declaration in declared.children("ParameterDeclaration")}
        if declared is not None
        else set()
    )
    pinned = {name: value for name, value in ask.pinned.items() if name in names}
    free, maps = (
        tuple(text for text in texts if text.partition("=")[0] in names)
        for texts in (ask.free, ask.maps)
    )
    return replace(ask, pinned=pinned, free=free, maps=maps)


def _recorded(
    space: Space, kind: str, own: Samples | None
) -> tuple[Callable[[Space], Recorded], DensitySource]:
    """Return the function for the recorded parameters of a space, and their source."""
    # Own recordings first, if only they are enough: they are the traffic that was asked about.
    for samples in (own, Samples.read(OWN)):
        if samples is not None:
            recorded = partial(of_samples, samples.of_kind(kind))
            count = len(recorded(space).within(space).theta)
            if count >= LEAST:
                return recorded, DensitySource(count, own=samples is own)
    raise UsageError(f"fewer than {LEAST} recorded manoeuvres are like it")


def split(outcomes: Iterable[SearchTarget | Refused]) -> tuple[list[SearchTarget], list[Refused]]:
    """Split into searches and refusals."""
    listed: Sequence[SearchTarget | Refused] = list(outcomes)
    return [target for target in listed if isinstance(target, SearchTarget)], [
        refusal for refusal in listed if isinstance(refusal, Refused)
    ]
