"""Runs of mutants in a process that may die, hang, or write where it should not, and what came of them.

A mutant takes the path of `xosc-run`: `jobs_of` and `execute` with an output folder. Its folder is laid out as

    case/   the mutant and what it refers to        out/   where its results may go
    cwd/    the working directory, to stay empty

and beside it tmp/, to be empty after each run, and cache/, the cache of road networks.
"""

from __future__ import annotations

import importlib
import multiprocessing
import os
import resource
import shutil
import sys
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from schemas.errors import one_line
from tests.mutation import Source, write_mutant

LONGEST = 10.0
"""Seconds of processor time that no run may take."""
_WAITED = 60.0
"""Seconds after which a run hangs: on a machine that does other work, too."""
DIED, HUNG = "the process died", "hang"
_JOBS_OF_A_DISTRIBUTION = 2
_SIMULATED = 3.0
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT


class Result(NamedTuple):
    """What came of a mutant.

    Attributes:
        number: of the mutant; with seed and sources it can be made again.
        source: the file it was made from.
        world: in which it ran.
        changes: made to the source.
        code: exit code, the gravest of its runs; 5 where the process died or hung.
        message: error, one line that begins with a file, the mutant's own as case/….
        trace: traceback of it.
        seconds: of processor time, those of what it starts included, that all its runs take.
        stray: files written outside the output folder and the cache.
        growth: of the process's peak memory (MiB).
    """

    number: int
    source: Path
    world: str
    changes: tuple[str, ...]
    code: int
    message: str
    trace: str
    seconds: float
    stray: tuple[str, ...] = ()
    growth: float = 0.0

    @property
    def is_defect(self) -> bool:
        """Whether it shows a defect of the toolchain: what a file holds never is one."""
        nameless = bool(self.message) and not self.message.startswith(("case/", "/"))
        return self.code in (2, 5) or nameless or bool(self.stray) or "\n" in self.message or self.seconds >= LONGEST


def run_mutants(sources: Sequence[Source], seed: int, numbers: Sequence[int], scratch: Path) -> Iterator[Result]:
    """Run mutants one after the other in a process that is replaced when it dies or hangs."""
    context = multiprocessing.get_context("spawn")
    waiting = list(numbers)
    while waiting:
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs, sources, seed, waiting, scratch), daemon=True)
        process.start()
        theirs.close()
        if not ours.poll(60.0):  # the process has started
            raise RuntimeError("the process for mutants does not start")
        ours.recv()
        while waiting:
            result = _receive(ours, sources, seed, waiting[0])
            waiting.pop(0)
            yield result
            if result.message in (DIED, HUNG):
                break
        process.kill()
        process.join()
        ours.close()


def _receive(connection: Any, sources: Sequence[Source], seed: int, number: int) -> Result:
    try:
        if connection.poll(_WAITED):
            return Result(*connection.recv())
        message = HUNG
    except EOFError:
        message = DIED
    return Result(number, _source(sources, seed, number).path, _world(number), (), 5, message, "", _WAITED)


def _serve(connection: Any, sources: Sequence[Source], seed: int, numbers: Sequence[int], scratch: Path) -> None:
    os.environ["XOSC_CACHE_DIR"] = str(scratch / "cache")
    os.environ["TMPDIR"] = str(scratch / "tmp")
    shutil.rmtree(scratch / "tmp", ignore_errors=True)  # what a process left that was killed
    (scratch / "tmp").mkdir()
    with open(os.devnull, "w") as nothing:  # netconvert and SUMO may print, which is not looked at here
        for stream in (1, 2):
            os.dup2(nothing.fileno(), stream)
    written: list[str] = []
    sys.addaudithook(lambda event, args: written.append(os.fsdecode(args[0])) if _is_writing(event, args) else None)
    for module in (
        "runner.interpreter.execution",
        "runner.worlds.sumo_simulation",
        "runner.outputs.trajectories",
        "pyarrow.parquet",
        "pyproj",
        "scipy.special",
    ):
        importlib.import_module(module)  # neither its time nor its memory is a mutant's
    connection.send("ready")
    for number in numbers:
        connection.send(tuple(_run(sources, seed, number, scratch, written)))


def _is_writing(event: str, args: tuple[Any, ...]) -> bool:
    return event == "open" and isinstance(args[0], str | bytes) and bool((args[2] or 0) & _WRITING)


def _source(sources: Sequence[Source], seed: int, number: int) -> Source:
    return Random(f"source {seed} {number}").choice(sources)


def _world(number: int) -> str:
    return "kinematic" if number % 2 else "sumo"


def _run(sources: Sequence[Source], seed: int, number: int, scratch: Path, written: list[str]) -> Result:
    source, folder = _source(sources, seed, number), scratch / f"mutant{number}"
    for part in ("case", "cwd", "out"):
        (folder / part).mkdir(parents=True)
    os.chdir(folder / "cwd")
    mutant = write_mutant(source, folder / "case", Random(f"mutant {seed} {number}"))
    before, files, start = _peak(), _files(folder), _processor_time()
    written.clear()
    code, message, trace = _execute(mutant.path, _world(number), folder / "out")
    seconds = _processor_time() - start
    allowed = (str(folder / "out"), str(scratch / "cache"), str(scratch / "tmp"), os.devnull)
    outside = {path for path in {*written, *map(str, _files(folder) - files)} if not path.startswith(allowed)}
    stray = tuple(sorted(outside | set(map(str, _files(scratch / "tmp")))))
    os.chdir(scratch)
    shutil.rmtree(folder)
    message = message.replace(f"{folder}/", "")
    return Result(number, source.path, _world(number), mutant.changes, code, message, trace, seconds, stray, _peak() - before)


def _processor_time() -> float:
    return sum(os.times()[:4])


def _execute(path: Path, world: str, out: Path) -> tuple[int, str, str]:
    """Exit code, message and traceback of the gravest outcome, as the command line has them."""
    from runner.batch.batch import execute
    from runner.batch.jobs import Outcome, jobs_of
    from runner.settings import RunSettings

    options = RunSettings(timestep=0.05, max_time=_SIMULATED, world=world)
    jobs = islice(jobs_of([path], {}, True), _JOBS_OF_A_DISTRIBUTION)
    outcomes = [job if isinstance(job, Outcome) else execute(job, options, out) for job in jobs]
    if not outcomes:  # a distribution without a run
        return 0, "", ""
    worst = max(outcomes, key=lambda outcome: outcome.exit_code)
    told = any(remark.endswith("]") for outcome in outcomes for remark in outcome.remarks)  # with the rule that is broken
    if worst.exit_code < 2 and not told and (fault := _fault(path)):
        return 5, f"{path}: it ran without a remark, but is invalid: {fault}", ""
    if worst.exit_code < 2 and not all(map(_is_finite, out.glob("*/trajectories.parquet"))):
        return 5, "the trajectories hold numbers that are not finite", ""
    return worst.exit_code, worst.message if worst.state == "error" else "", worst.trace


def _fault(path: Path) -> str:
    """The first thing that makes a file invalid; "" for a valid one."""
    from schemas import check

    return next((one_line(str(problem)) for problem in check(path) if problem.level == "error"), "")


def _is_finite(table: Path) -> bool:
    """Whether all poses and speeds of a run are finite numbers."""
    import numpy as np
    import pyarrow.parquet as parquet

    columns = parquet.read_table(table, columns=["x", "y", "z", "h", "pitch", "roll", "speed", "acceleration"])
    return all(bool(np.isfinite(column.to_numpy()).all()) for column in columns.columns)


def _files(folder: Path) -> set[Path]:
    return {path for path in folder.rglob("*") if path.is_file()}


def _peak() -> float:
    """Peak memory of this process, MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
