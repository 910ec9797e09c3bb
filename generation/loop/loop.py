"""The loop itself: stage after stage, each done once, and a page of all at the end."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from generation.loop import runs as loop_runs
from generation.loop.findings import (
    Against,
    Checked,
    LabelledScenario,
    LoopResult,
    LoopStage,
    Measured,
    Ran,
    Recognised,
    RecognisedRun,
    Refused,
    Round,
    Searched,
)
from generation.loop.inputs import (
    Inputs,
    SearchTarget,
    distinct,
    of_classes,
    of_inputs,
    played,
    split,
)
from generation.loop.runs import FinishedStages, Report, run_all, sampled
from generation.loop.searches import Earlier, Searchers, compare, found_by, search
from generation.search.settings import LoopSettings
from recognition.catalogue.detect import plain
from recognition.catalogue.writing.index import rows_of
from recognition.labels.maneuvers.units import Samples
from runner.batch.inputs import plugged_in
from runner.batch.jobs import Job, Outcome, jobs_of
from runner.judging.settings import RunSettings
from schemas import check_many
from schemas.common.array_types import FloatArray
from schemas.common.errors import UsageError
from schemas.common.storage import alone, digest
from schemas.common.terminal.command_line import Bar
from schemas.common.terminal.files import files_in
from xosc.distributions.space import Selection

CATALOGUE = "catalogue"
UNITS = "units.parquet"
RUNS, RECOGNISED = "runs", "recognised"
"""Folders of a round: runs of its edge cases, and the catalogue of what is recognised in these runs
"""


def run_loop(
    folder: Path, out: Path, settings: LoopSettings, bar: Bar, report: Report
) -> LoopResult:
    """Go through the loop, or on with it where it was interrupted.

    Args:
        folder: recordings and scenarios of the user.
        out: folder for all that comes of it.
        settings: what to do.
        bar: shows progress.
        report: called with each finished stage.

    Returns:
        What all stages found, for `generation.loop.page`.

    Raises:
        InvalidFile: there is nothing in the folder that can be read.
        UsageError: a setting is wrong, or the output folder has something else.
    """
    inputs = _inputs(folder, out)
    # Before the lock and the first stage: a wrong folder is told at once, not after hours of
    # searches.
    earlier = _earlier(settings.against, out)
    with alone(out, "a loop"):
        return _looped(inputs, out, settings, bar, report, earlier)


def _looped(
    inputs: Inputs,
    out: Path,
    settings: LoopSettings,
    bar: Bar,
    report: Report,
    earlier: Earlier | None,
) -> LoopResult:
    # Another system, even one with the same name, finds other failures: its code counts as a
    # setting.
    stages = FinishedStages(
        out, settings.deciding() | {"code of the system": plugged_in(settings.run)}, report
    )
    work = _Loop(inputs, out, settings, bar, stages)
    recognised, targets, refused = work.recognise()
    # Processes last over all rounds: each keeps the densities that it has fitted for its targets.
    with Searchers(out, settings) as searchers:
        rounds = (
            [work.round(number, targets, searchers) for number in range(1, settings.rounds + 1)]
            if targets
            else []
        )
    return LoopResult(
        settings=settings.deciding(),
        recordings=len(inputs.recordings),
        recognised=recognised,
        refused=refused,
        rounds=rounds,
        played=work.play() if inputs.recordings else Ran(),
        scenarios=work.run_scenarios() if inputs.scenarios else Ran(),
        checked=work.check(targets),
        against=work.compare(earlier, targets, rounds) if earlier is not None else None,
    )


def _inputs(folder: Path, out: Path) -> Inputs:
    if out.resolve().is_relative_to(folder.resolve()):
        raise UsageError(
            "the output folder is inside the folder of the recordings, where it "
            "would be taken for one",
            path=out,
        )
    return Inputs.of(folder)


def _earlier(folder: Path | None, out: Path) -> Earlier | None:
    """The loop to compare with."""
    if folder is None:
        return None
    if folder.resolve() == out.resolve():
        raise UsageError(
            "--against: this is the output folder itself, not that of an earlier loop", path=folder
        )
    return Earlier.of(folder)


class _Loop:
    """Stages of the loop."""

    def __init__(
        self, inputs: Inputs, out: Path, settings: LoopSettings, bar: Bar, stages: FinishedStages
    ) -> None:
        self._inputs, self._out, self._settings, self._bar = inputs, out, settings, bar
        self._stages, self._once = stages, stages.once
        # Filled by `round`, in its order: what a search starts from are the failures of rounds
        # before.
        self._earlier: dict[str, list[Searched]] = {}
        self._names = inputs.names
        self._recorded, self._played = inputs.recorded, inputs.played(settings.run)

    def recognise(self) -> tuple[Recognised, list[SearchTarget], list[Refused]]:
        """Make the catalogue; what to search, and what not."""
        recognised = Recognised()
        # Without recordings nothing is measured: scenarios of the user have the units that are
        # shipped.
        own: Samples | None = None
        listed: list[SearchTarget | Refused] = []
        if self._inputs.recordings:
            catalogue, model = self._out / CATALOGUE, self._out / loop_runs.MODEL
            make = partial(
                loop_runs.catalogue,
                [self._inputs.folder],
                catalogue,
                self._settings.model,
                self._bar,
                model,
                self._settings.processes,
            )
            recognised = self._once(
                LoopStage("recognise"),
                Recognised,
                make,
                self._recorded,
                (catalogue, model),
                # Labels and tags may be corrected by hand: only a missing file is made again.
                editable=True,
            )
            table = self._out / UNITS
            # A recording that could not be read is named once, by the catalogue.
            read = [
                recording
                for recording in self._inputs.recordings
                if recording.name not in recognised.failures
            ]
            measure = partial(loop_runs.units, read, table, self._bar)
            measured = self._once(LoopStage("measure"), Measured, measure, self._recorded, (table,))
            recognised = replace(recognised, failures=recognised.failures | measured.failures)
            own = Samples.read(table) if table.is_file() else None
            listed = list(of_classes(rows_of(catalogue), catalogue, own))
        # Only of what is searched: refused classes have no folder that a scenario's could be taken
        # for.
        classes = (target.name for target in listed if isinstance(target, SearchTarget))
        self._names = distinct(self._inputs.names, classes)
        targets, refused = split([*listed, *of_inputs(self._names, own, self._settings.ask)])
        return recognised, targets, refused

    def round(self, number: int, targets: Sequence[SearchTarget], searchers: Searchers) -> Round:
        """Search everything, run what was found, and recognise it in the runs."""
        searched = self._searched(number, targets, searchers)
        for outcome in searched:
            # Of a stage that was finished before, too: a loop that goes on starts from the same
            # failures.
            self._earlier.setdefault(outcome.target, []).append(outcome)
        # Those written, not those found: a round is judged by what anybody can play from its files.
        files = [self._out / case.file for outcome in searched for case in outcome.cases]
        if not files:
            return Round(number, searched, Ran(), RecognisedRun())
        folder = self._out / f"round_{number}"
        run = partial(self._run, list(jobs_of(files, {}, True)), self._settings.run, folder / RUNS)
        of = self._all(targets)
        runs = self._once(LoopStage("run", number), Ran, run, of, (folder / RUNS,))
        label = partial(self._label, folder)
        labelled = self._once(
            LoopStage("label", number),
            RecognisedRun,
            label,
            of,
            (folder / RECOGNISED,),
            editable=True,
        )
        return Round(number, searched, runs, labelled)

    def play(self) -> Ran:
        """Replay some recorded scenarios of each class, as they were recorded."""
        jobs = [
            Job(f"{plain(row['class'])}_{Path(row['file']).stem}", path, path)
            for row in chosen(rows_of(self._out / CATALOGUE), self._settings.shown)
            for path in [self._out / CATALOGUE / row["file"]]
        ]
        # No system takes over the ego: what is shown is what was recorded.
        as_recorded = replace(self._settings.run, sut=None)
        folder = self._out / "played"
        return self._once(
            LoopStage("play"),
            Ran,
            partial(self._run, jobs, as_recorded, folder),
            self._recorded,
            (folder,),
        )

    def run_scenarios(self) -> Ran:
        """Run the user's own scenarios against the system under test."""
        folder = self._out / "scenarios"
        return self._once(
            LoopStage("run_scenarios"), Ran, partial(self._run_own, folder), self._played, (folder,)
        )

    def _run_own(self, folder: Path) -> Ran:
        own, sample = self._inputs.scenarios, self._settings.sample
        # `True`: sets that violate the scenario's constraint groups are none that it describes.
        jobs = list(jobs_of(own, {}, True, Selection(sample=sample, seed=self._settings.seed)))
        named = partial(_below, self._inputs.folder)
        return replace(
            self._run(jobs, self._settings.run, folder, named), sampled=sampled(own, sample, named)
        )

    def check(self, targets: Sequence[SearchTarget]) -> Checked:
        """Check everything that was written, and the user's scenarios."""
        files = [*files_in(self._out), *self._inputs.scenarios]
        # By the content of the files: catalogues may be edited between two goes of a loop.
        content = [loop_runs.file_digest(path) for path in files]
        of = digest(repr((self._all(targets), content)).encode())
        return self._once(LoopStage("check"), Checked, partial(self._check, files), of)

    def _check(self, files: Sequence[Path]) -> Checked:
        run, errors = self._settings.run, list[str]()
        with self._bar("checking", len(files)) as advance:
            for _, problems in check_many(files, run.catalog_path, run.road_path):
                errors += [str(problem) for problem in problems if problem.level == "error"]
                advance(1)
        return Checked(files=len(files), problems=errors)

    def compare(
        self, earlier: Earlier, targets: Sequence[SearchTarget], rounds: Iterable[Round]
    ) -> Against:
        """Return the fates of an earlier loop's failures."""
        searches = [search for round_ in rounds for search in round_.searches]
        with self._bar(f"comparing with {earlier.folder}", len(targets)) as advance:
            return compare(earlier, targets, searches, self._settings, advance)

    def _searched(
        self, number: int, targets: Sequence[SearchTarget], searchers: Searchers
    ) -> list[Searched]:
        """The searches of a round, several at a time where that many processes are wanted."""
        stages = {target.name: LoopStage("search", number, target.name) for target in targets}
        of = {target.name: self._of(target) for target in targets}
        # What was finished before needs no process: with one target left, it has them all.
        left = [
            target
            for target in targets
            if not self._stages.has(stages[target.name], of[target.name])
        ]
        works: dict[str, Callable[[], Searched]] = {
            target.name: partial(self._search, number, target) for target in targets
        }
        # A single search uses all processes for its own runs.
        if self._settings.processes > 1 and len(left) > 1:
            # All are begun before the first is waited for, or they would search one after the
            # other.
            begun = {
                target.name: searchers.begin(target, number, self._known(target)) for target in left
            }
            works |= {
                target.name: partial(self._await, target, begun[target.name]) for target in left
            }
        return [
            self._once(
                stages[name],
                Searched,
                works[name],
                of[name],
                (self._out / f"round_{number}" / name,),
            )
            for name in stages
        ]

    def _of(self, target: SearchTarget) -> str:
        """Content of the files that the result of a target's search depends on."""
        asked = target.asked
        # With the pinned values, since a road or catalogue of the scenario may be named by a
        # parameter.
        scenario = played(
            target.scenario, self._settings.run, asked.choice.pinned if asked is not None else {}
        )
        # The variation file as well: it states limits and densities that its scenario has not.
        own = [
            digest(path.read_bytes()) for path, name in self._names.items() if name == target.name
        ]
        return digest(repr((self._recorded, scenario, own)).encode())

    def _all(self, targets: Sequence[SearchTarget]) -> str:
        """The content of all targets and inputs."""
        return digest(
            repr((self._recorded, self._played, [self._of(target) for target in targets])).encode()
        )

    def _search(self, number: int, target: SearchTarget) -> Searched:
        with self._bar(f"searching {target.title}", self._settings.budget) as advance:
            return search(target, number, self._out, self._settings, self._known(target), advance)

    def _await(self, target: SearchTarget, result: Callable[[], Searched]) -> Searched:
        with self._bar(f"searching {target.title}", self._settings.budget) as advance:
            searched = result()
            # Runs in another process are not reported one by one.
            advance(self._settings.budget)
            return searched

    def _known(self, target: SearchTarget) -> FloatArray | None:
        return found_by(self._earlier.get(target.name, []))

    def _run(
        self,
        jobs: Sequence[Job | Outcome],
        settings: RunSettings,
        folder: Path,
        named: Callable[[Path], str] | None = None,
    ) -> Ran:
        with self._bar("running", len(jobs)) as advance:
            named = named or partial(_below, self._out)
            return run_all(
                jobs, settings, folder, self._out, self._settings.processes, advance, named
            )

    def _label(self, folder: Path) -> RecognisedRun:
        """The classes that are recognised about the ego in each run; by the run's name."""
        # The model that knows the classes discovered in the recordings, where there is one.
        grown = self._out / loop_runs.MODEL
        model = grown if grown.is_dir() else self._settings.model
        made = loop_runs.catalogue(
            [folder / RUNS],
            folder / RECOGNISED,
            model,
            self._bar,
            processes=self._settings.processes,
        )
        recognised = RecognisedRun(failures=made.failures)
        for row in rows_of(folder / RECOGNISED):
            # Others have scenarios of their own, which say nothing about the system under test.
            if row["vehicle"] == "Ego":
                recognised.runs.setdefault(row["recording"], []).append(
                    LabelledScenario(row["class"], row["file"])
                )
        return recognised


def chosen(rows: Iterable[dict[str, Any]], most: int) -> list[dict[str, Any]]:
    """A number of rows of each class, spread evenly over the certainty of the model."""
    classes: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        classes.setdefault(row["class"], []).append(row)
    picked = []
    for title in sorted(classes):
        # By file where equally certain, for the same choice each time; rules alone have no
        # certainty.
        listed = sorted(classes[title], key=lambda row: (-(row["confidence"] or 0.0), row["file"]))
        # Both ends of the certainty are shown, and one row alone is the surest.
        count = min(most, len(listed))
        picked += [
            listed[round(index * (len(listed) - 1) / max(count - 1, 1))] for index in range(count)
        ]
    return picked


def _below(folder: Path, path: Path) -> str:
    """A file's path below a folder, by which it is one of its kind."""
    return path.relative_to(folder).as_posix()
