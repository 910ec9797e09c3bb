"""Running scenarios with replays, and what became of each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

from generation.loop.stages.findings import Ran, Run
from runner.batch.batch import run_batch
from runner.batch.jobs import Job, Outcome
from runner.replay.player import keep_replay
from runner.replay.report import report, write_report
from runner.settings import RunSettings
from schemas.commands.wording import many
from schemas.errors import ToolchainError
from xosc.distributions import ParameterSpace


def run_all(
    jobs: Iterable[Job | Outcome],
    settings: RunSettings,
    folder: Path,
    out: Path,
    processes: int,
    progress: Callable[[int], None],
    named: Callable[[Path], str],
) -> Ran:
    """Run jobs into a folder, with a replay page of each run and a report of all; goes on where it was interrupted.

    Args:
        settings: how they are run.
        folder: for the results, below `out`.
        out: output folder of the loop.
        named: what a file is called in the result, no two the same.

    Returns:
        What `runner.replay.report` gives for each run.
    """
    outcomes = run_batch(jobs, settings, out=folder, processes=processes, resume=True, also=[partial(keep_replay, out=folder)])
    files = {}
    for outcome in outcomes:
        files[outcome.job.name] = outcome.job.source
        progress(1)
    write_report(folder)
    place = folder.relative_to(out).as_posix()
    found = Ran()
    for run in report(folder)["runs"]:
        replay = f"{place}/{run['replay']}#t={run['moment']}" if run["replay"] else None
        copied = {name: run[name] for name in ("name", "state", "status", "message", "end", "measures")}
        found.files.setdefault(named(files[run["name"]]), []).append(Run(**copied, replay=replay))
    return replace(found, failures=dict(_failures(found)))


def _failures(found: Ran) -> Iterator[tuple[str, str]]:
    """The files with runs that ended with an error, and what the first of these says."""
    for name, runs in found.files.items():
        messages = [run.message for run in runs if run.state == "error"]
        if messages:
            more = f" (and {many(len(messages) - 1, 'more run')} with errors)" if len(messages) > 1 else ""
            yield name, messages[0] + more


def sampled(paths: Iterable[Path], most: int, named: Callable[[Path], str]) -> dict[str, int]:
    """How many parameter sets those variation files have that have more than `most`; those that can't be read have none.

    Args:
        named: what a file is called in the result, as for `run_all`.
    """
    found = {}
    for path in paths:
        with suppress(ToolchainError):
            found[named(path)] = ParameterSpace(path).size
    return {name: size for name, size in found.items() if size > most}
