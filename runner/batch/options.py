"""Options of batches of runs besides the settings of a run, and options that commands share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Context

from runner.judging.measures.measure import EVENTS, NEW_FAILURE, UNITS
from runner.judging.settings import RunSettings
from schemas.common.errors import ToolchainError, UsageError
from schemas.common.policy import current
from schemas.common.terminal.options import WRITTEN, completed, option, option_of, writable_folder

if TYPE_CHECKING:
    from xosc.distributions.space import Selection


def _assessments() -> tuple[str, list[tuple[str, str]]]:
    from runner.judging.assessment.profiles import profiles

    return "Protocols of --assess", list(profiles().items())


def complete_parameter(context: Context, incomplete: str) -> list[str]:
    """Parameters of the scenarios named before, as NAME=VALUE with their defaults, that begin as
    typed."""
    from schemas.common.terminal.files import expand
    from xosc.listing import listing

    try:
        listed = listing(map(str, expand(context.args))).scenarios if context.args else []
    except ToolchainError:
        return []
    pairs = {f"{one.name}={one.value}": None for scenario in listed for one in scenario.parameters}
    return [pair for pair in pairs if pair.startswith(incomplete)]


MANY = 200
"""Parameter sets from which on they are played in arrays where nothing needs each run"""


@dataclass(frozen=True)
class BatchOptions:
    """Options of a batch, besides the settings of its runs.

    Raises:
        UsageError: some exclude each other, or need one that is absent.
    """

    param: Mapping[str, str] = option(
        {},
        "Value of a global parameter (repeatable).",
        "--param",
        "-p",
        metavar="NAME=VALUE",
        autocompletion=complete_parameter,
    )
    only: str | None = option(
        None,
        "These parameter sets of variation files only, as 3,7-9, from 0.",
        metavar="NUMBERS",
    )
    sample: int | None = option(
        None, "N parameter sets of each variation file, drawn by --seed.", min=1, metavar="N"
    )
    repeat: int | None = option(
        None, "Run everything N times, with seeds that count up from --seed.", min=1, metavar="N"
    )
    maxfail: int | None = option(
        None, "Stop after N runs that fail or end with an error.", min=1, metavar="N"
    )
    fail_if: tuple[str, ...] = option(
        (),
        "Fail runs by a measure, as min_ttc<1 (see docs/reference/measures.md), or by "
        f"{', '.join((*EVENTS, NEW_FAILURE))} (repeatable).",
        "--fail-if",
        metavar="LIMIT",
        autocompletion=completed(lambda: (*UNITS, *EVENTS, NEW_FAILURE)),
        shared=True,
    )
    out: Path | None = option(
        None,
        "Folder for each run's trajectories, log and result.",
        metavar="DIR",
        callback=writable_folder,
    )
    osi: Path | None = option(
        None,
        "Write one run's ground truth as an OSI trace: FILE.osi or FILE.mcap.",
        files=WRITTEN,
        metavar="FILE",
    )
    plot: bool = option(False, "Add a picture of each run to --out.", "--plot")
    replay: bool = option(
        False,
        "Write an HTML page that plays each run, to --out with a report, else here.",
        "--replay",
    )
    against: Path | None = option(
        None,
        "Folder of an earlier batch to compare with, as new-failure needs it.",
        metavar="BATCH",
    )
    assess: str | None = option(
        None,
        "Write the runs as the table of a test protocol to --out: assessment.html and .csv.",
        section=_assessments,
        metavar="PROTOCOL",
        autocompletion=completed(lambda: [name for name, _ in _assessments()[1]]),
    )
    gui: bool = option(False, "Play each run in SUMO's own window.", "--gui")
    resume: bool = option(False, "Go on with the batch that --out holds.", "--resume")
    overwrite: bool = option(
        False, "Replace what an earlier call has written to --out.", "--overwrite"
    )
    junit: Path | None = option(None, "Write a JUnit report.", files=WRITTEN, metavar="FILE")
    junit_inconclusive: str = option(
        "skipped",
        "What an inconclusive run is in the JUnit report.",
        type=Literal["skipped", "error"],
        shared=True,
    )
    allow_inconclusive: bool = option(
        False,
        "Exit as if runs that did not test what their file describes had passed.",
        "--allow-inconclusive",
        shared=True,
    )
    jobs: int = option(1, "Number of processes.", "--jobs", "-j", min=1, metavar="N", shared=True)
    in_arrays: bool | None = option(
        None,
        "Play parameter sets in arrays, kinematically, where all elements can; record failures "
        "and nearest misses only. "
        "By default from 200 sets on in the kinematic world.",
        "--batch/--no-batch",
    )
    ray: str | None = option(
        None,
        "Run on this Ray cluster; 'local' starts one of --jobs processes on this machine.",
        metavar="ADDRESS",
        shared=True,
    )
    dry_run: bool = option(False, "Load, compile and begin everything, run nothing.", "--dry-run")
    verbose: bool = option(False, "Print tracebacks of errors.", "--verbose", "-v")
    quiet: bool = option(
        False, "Print failures, inconclusive runs and errors only.", "--quiet", "-q"
    )

    @property
    def limits(self) -> tuple[str, ...]:
        """Limits of `fail_if`, without blanks around."""
        return tuple(limit.strip() for limit in self.fail_if)

    def plays_in_arrays(self, world: str, sets: Callable[[], int]) -> bool:
        """Whether parameter sets are played in arrays: where asked for, or where these are many and
        nothing needs each run.

        Args:
            world: of the runs; arrays are kinematic.
            sets: gives the number of sets.
        """
        if self.in_arrays is not None:
            return self.in_arrays
        each_run = (self.resume, self.plot, self.replay, self.osi, self.gui, self.ray, self.assess)
        return world == "kinematic" and not any(each_run) and sets() >= MANY

    def __post_init__(self) -> None:
        if self.out is None and (self.resume or self.plot):
            raise UsageError("--resume and --plot need the --out folder of the results")
        if self.assess is not None:
            self._check_assessment(self.assess)
        if self.resume and (self.osi is not None or self.gui):
            option, instead = (
                ("--gui", "xosc-replay shows them")
                if self.gui
                else ("--osi", "xosc-export --to osi writes their traces")
            )
            raise UsageError(
                f"{option} is of runs that are played, and --resume leaves out "
                f"finished ones: {instead}"
            )
        if self.overwrite and (self.out is None or self.resume or self.dry_run):
            raise UsageError(
                "--overwrite replaces the batch of --out by one that is run: without "
                "--resume and --dry-run"
            )
        if self.in_arrays and self.dry_run:
            raise UsageError("--batch plays parameter sets, and --dry-run plays nothing")
        if self.maxfail is not None and self.dry_run:
            raise UsageError("--maxfail stops runs, and --dry-run has none")
        self._check_comparison()
        self._check_reports()

    def _check_reports(self) -> None:
        """Refuse a report or trace in the place of a file of the batch's own."""
        for path in (self.junit, self.osi):
            if path is None or self.out is None:
                continue
            from runner.batch.journal import BATCH_FILES
            from runner.batch.outputs.folder import RUN_FILES

            below = self.out.resolve() in path.resolve().parents
            if below and path.name in BATCH_FILES | RUN_FILES:
                raise UsageError("the batch writes this file itself: name another", path=path)

    def _check_assessment(self, name: str) -> None:
        """Refuse an unknown protocol, and an assessment of runs that are not kept."""
        from runner.judging.assessment.profiles import profile

        profile(name)
        if self.out is None or self.dry_run:
            raise UsageError(
                "--assess reads the results of runs: it needs --out DIR"
                + " and no --dry-run" * self.dry_run
            )

    def _check_comparison(self) -> None:
        """Refuse --against with --dry-run or for a replaced batch, and new failures without
        --against."""
        if self.against is None:
            if NEW_FAILURE in self.limits:
                raise UsageError(
                    f"--fail-if {NEW_FAILURE} needs the earlier batch: --against BATCH"
                )
            return
        if NEW_FAILURE in self.limits and current().untrusted:
            from runner.batch.journal import SEAL_KEY, seal_key

            if seal_key() is None:
                reason = (
                    "--untrusted does not believe a stored batch, which may hide new failures, "
                    f"without {SEAL_KEY}"
                )
                raise UsageError(reason, path=self.against)
        if self.dry_run:
            raise UsageError("--against compares runs, and --dry-run has none")
        if self.overwrite and self.out is not None and self.against.resolve() == self.out.resolve():
            raise UsageError(
                "--against names the folder that --overwrite replaces", path=self.against
            )


Param = Annotated[list[str] | None, option_of(BatchOptions, "param")]
Only = Annotated[str | None, option_of(BatchOptions, "only")]
Sample = Annotated[int | None, option_of(BatchOptions, "sample")]
FailIf = Annotated[list[str] | None, option_of(BatchOptions, "fail_if")]
Sut = Annotated[str, option_of(RunSettings, "sut")]
Timestep = Annotated[float, option_of(RunSettings, "timestep")]


def selection_of(
    only: str | None, sample: int | None, seed: int, files: Sequence[Path]
) -> Selection:
    """The parameter sets of files that the options choose.

    Raises:
        UsageError: the options exclude each other, or the numbers are none, or no file has
            parameter sets.
    """
    from xosc.distributions.space import Selection, spans

    selection = Selection(spans(only) if only is not None else (), sample, seed)
    if selection.only and not any(map(_may_vary, files)):
        raise UsageError(
            "--only names parameter sets of variation files, and there is none among the files"
        )
    return selection


def _may_vary(file: Path) -> bool:
    """Whether a file is a distribution; one that can't be read is refused in its turn, with its own
    reason."""
    from xosc.document import load

    try:
        return load(file).kind == "distribution"
    except ToolchainError:
        return True
