"""Runs fuzzed inputs in a process with limits, which may die, hang, or write where it should not, and says what came of them.

Each input has a folder that is laid out as

    case/   the input's files                       out/   where results may be written
    cwd/    the working directory, to stay empty

and beside it are tmp/, to be empty after each input, cache/ (road networks) and seeds/ (what inputs are made from).
"""

from __future__ import annotations

import importlib
import multiprocessing
import os
import re
import resource
import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from tests.commands import Answer
from tests.fuzz.kinds import CASE, OUT, Input, Kind, kinds, own_kinds
from tests.mutation import Source

LONGEST = 10.0
"""Seconds of processor time that no input may take"""
LARGEST = 768.0
"""MiB by which no input may make the process grow"""
_ADDRESSES = 4 * 2**30
"""Bytes of addresses that a process may take on top of those that it begins with"""
_WAITED = 300.0
"""Seconds after which an input hangs: on a machine that does other work, too"""
DIED, HUNG = "the process died", "hang"
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT
_COMMAND = re.compile(r"^\s*::|##\[|##vso\[", re.MULTILINE)
"""What CI services take for their own commands"""
_VERDICTS = (0, 1, 6)
"""Exit codes of runs with a verdict, which a table tells by the run's name; the others are of errors, which name a file"""
_RULE = re.compile(r"\[asam\.net:[\w.:-]+\]")


class Result(NamedTuple):
    """What came of an input.

    Attributes:
        number: of the input; with seed and sources it can be made again.
        kind: its kind.
        source: what it was made from.
        changes: made to that.
        code: exit code.
        defect: what must not have happened; "" where all is as it should be.
        message: the end of standard error.
        seconds: of processor time, those of what it starts included.
        growth: of memory (MiB), at its peak.
    """

    number: int
    kind: str
    source: str
    changes: tuple[str, ...]
    code: int
    defect: str
    message: str
    seconds: float
    growth: float


class Limits(NamedTuple):
    """What an input may take: processor time (s) and memory (MiB)."""

    seconds: float = LONGEST
    memory: float = LARGEST


def run(
    sources: Sequence[Source] | None,
    seed: int,
    numbers: Sequence[int],
    scratch: Path,
    only: str = "",
    limits: Limits = Limits(),  # noqa: B008
    keep: Path | None = None,
) -> Iterator[Result]:
    """Run inputs one after the other in a process that is replaced when it dies or hangs.

    Args:
        sources: scenarios that inputs are made from; None for those of this repository.
        numbers: of the inputs; seed and number decide all of one.
        only: beginning of the names of the kinds that are drawn.
        keep: folder for copies of inputs with defects.
    """
    context = multiprocessing.get_context("spawn")
    waiting = list(numbers)
    while waiting:
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs, sources, seed, waiting, scratch, only, limits, keep), daemon=True)
        process.start()
        theirs.close()
        if not ours.poll(180.0):  # the process has started
            raise RuntimeError("the process for inputs does not start")
        ours.recv()
        while waiting:
            result = _receive(ours, waiting[0])
            waiting.pop(0)
            yield result
            if result.defect in (DIED, HUNG):
                if keep is not None:
                    _keep(keep, scratch / f"input{result.number}", f"{result.defect.split()[-1]}-{seed}-{result.number}")
                break
        process.kill()
        process.join()
        ours.close()


def _receive(connection: Any, number: int) -> Result:
    try:
        if connection.poll(_WAITED):
            return Result(*connection.recv())
        defect = HUNG
    except (EOFError, ConnectionResetError):
        defect = DIED
    return Result(number, "", "", (), 5, defect, "", _WAITED, 0.0)


def _serve(
    connection: Any,
    sources: Sequence[Source] | None,
    seed: int,
    numbers: Sequence[int],
    scratch: Path,
    only: str,
    limits: Limits,
    keep: Path | None,
) -> None:
    runner = Runner(scratch, limits)
    silence()
    chosen = {name: kind for name, kind in (kinds(sources) if sources else own_kinds()).items() if name.startswith(only)}
    connection.send("ready")
    for number in numbers:
        folder = scratch / f"input{number}"
        result = runner.draw(chosen, seed, number, folder)
        if result.defect and keep is not None:
            _keep(keep, folder, f"{result.kind.replace(' ', '_')}-{seed}-{number}")
        shutil.rmtree(folder, ignore_errors=True)
        connection.send(tuple(result))


def _keep(keep: Path, folder: Path, name: str) -> None:
    with suppress(OSError, shutil.Error):
        shutil.copytree(folder, keep / name, symlinks=True, dirs_exist_ok=True)


def silence() -> None:
    """Send what libraries and other programs print nowhere; commands print to streams of their own here."""
    with open(os.devnull, "w") as nothing:
        for stream in (1, 2):
            os.dup2(nothing.fileno(), stream)


class Runner:
    """Runs inputs in this process, with limits, and looks at all that they leave."""

    def __init__(self, scratch: Path, limits: Limits, addresses: int | None = _ADDRESSES) -> None:
        self._scratch, self._limits, self._written = scratch, limits, list[str]()
        os.environ["XOSC_CACHE_DIR"], os.environ["TMPDIR"] = str(scratch / "cache"), str(scratch / "tmp")
        os.environ["MPLCONFIGDIR"] = str(scratch / "cache")  # Matplotlib lists the machine's fonts there once
        shutil.rmtree(scratch / "tmp", ignore_errors=True)  # what a process left that was killed
        for name in ("tmp", "seeds"):
            (scratch / name).mkdir(exist_ok=True, parents=True)
        sys.addaudithook(lambda event, args: self._written.append(os.fsdecode(args[0])) if _is_writing(event, args) else None)
        for module in (
            "runner.interpreter.execution",
            "runner.outputs.tables",
            "pyarrow.parquet",
            "pyproj",
            "scipy.special",
        ):
            importlib.import_module(module)  # neither its time nor its memory is an input's
        if addresses is not None:
            used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            resource.setrlimit(resource.RLIMIT_AS, (used + addresses, resource.RLIM_INFINITY))

    def draw(self, chosen: Mapping[str, Kind], seed: int, number: int, folder: Path) -> Result:
        """Make the input with that number, of a kind that is drawn, in a folder, and run it."""
        random = Random(f"{seed} {number}")
        name = random.choices(list(chosen), [kind.weight for kind in chosen.values()])[0]
        try:
            made = self.make(chosen[name], folder, random)
        except Exception as error:  # of the fuzzer's own
            return Result(number, name, "", (), 5, f"it could not be made: {error!r}", "", 0.0, 0.0)
        return self.run(name, chosen[name], made, folder, number)

    def make(self, kind: Kind, folder: Path, random: Random) -> Input:
        """Write an input into a new folder."""
        shutil.rmtree(folder, ignore_errors=True)
        for part in ("case", "cwd", "out"):
            (folder / part).mkdir(parents=True)
        return kind.make(folder / "case", random, self._scratch / "seeds")

    def run(self, name: str, kind: Kind, made: Input, folder: Path, number: int = 0) -> Result:
        """Run an input that is in its folder, and judge it."""
        arguments = [each.replace(CASE, str(folder / "case")).replace(OUT, str(folder / "out")) for each in made.arguments]
        home = os.getcwd()
        os.chdir(folder / "cwd")
        files, start, before = _files(folder), _processor_time(), _reset_peak()
        self._written.clear()
        try:
            answer = kind.call(arguments)
        finally:
            os.chdir(home)
        seconds, growth = _processor_time() - start, _peak() - before
        defect = "; ".join(self._defects(kind, answer, folder, files, seconds, growth))
        if not all(map(_is_finite, (folder / "out").glob("**/trajectories.parquet"))):
            defect = "; ".join(filter(None, (defect, "trajectories with numbers that are not finite")))
        if not defect and kind.checked is not None and answer.code in (0, 1):
            defect = _green(arguments, answer, kind.checked)
        message = answer.err.strip()[-1500:].replace(f"{folder}/", "")
        return Result(number, name, made.source, made.changes, answer.code, defect, message, seconds, growth)

    def _defects(
        self, kind: Kind, answer: Answer, folder: Path, files: set[Path], seconds: float, growth: float
    ) -> Iterator[str]:
        if "Traceback (most recent call last)" in answer.err:
            yield f"traceback: {answer.err.strip().splitlines()[-1][:160]}"
        elif "internal error" in answer.err + answer.out:
            yield "internal error"
        if answer.code not in kind.codes and not (answer.code == 2 and "this stands for no" in answer.err):  # a folder
            yield f"exit code {answer.code}"
        if answer.code not in _VERDICTS and f"{folder.name}/" not in answer.err:
            yield "an error that names no file of the input"
        odd = next((c for c in answer.out + answer.err if not (c.isprintable() or c == "\n")), None)
        if odd is not None and not (answer.out.startswith(("<", "{", "name,")) and odd not in answer.err):
            yield f"the character {odd!r} on the console"
        if _COMMAND.search(answer.out + "\n" + answer.err):
            yield "a line that CI services take for a command"
        if seconds >= self._limits.seconds:
            yield f"{seconds:.0f} s of processor time"
        if growth >= self._limits.memory or "more memory than there is" in answer.err:
            yield f"{growth:.0f} MiB of memory"
        allowed = tuple(map(str, (folder / "out", folder / "case", self._scratch / "cache", self._scratch / "tmp", os.devnull)))
        written = {path for path in {*self._written, *map(str, _files(folder) - files)} if "/__pycache__/" not in path}
        outside = {path for path in written if not path.startswith(allowed)}  # modules are compiled when they are first imported
        left = _files(self._scratch / "tmp")
        if outside or left:
            yield f"files written outside of the output folder: {', '.join(sorted({*outside, *map(str, left)}))}"
        for each in left:
            each.unlink(missing_ok=True)


def _green(arguments: Sequence[str], answer: Answer, rules: str) -> str:
    """The first of these rules that a file breaks, of which nothing was said though it was run or exported; "" without one."""
    from schemas import check

    file = next((each for each in arguments if each.endswith(".xosc")), None)
    if file is None or _RULE.search(answer.out + answer.err) or "remark" in answer.out:
        return ""
    errors = (problem for problem in check(file) if problem.level == "error" and problem.rule.endswith(rules))
    untold = (problem for problem in errors if f"{Path(file).name}:{problem.line}: " not in answer.out + answer.err)
    broken = (problem for problem in untold if ":naming." not in problem.rule)  # a name with `::` is run like any other
    fault = next(map(str, broken), "")
    return f"green without a word, though invalid: {fault.rpartition('/')[2][:200]}" if fault else ""


def _is_finite(table: Path) -> bool:
    """Whether all poses and speeds of a run are finite numbers."""
    import numpy as np
    import pyarrow.parquet as parquet

    columns = parquet.read_table(table, columns=["x", "y", "z", "h", "pitch", "roll", "speed", "acceleration"])
    return all(bool(np.isfinite(column.to_numpy()).all()) for column in columns.columns)


def _is_writing(event: str, args: tuple[Any, ...]) -> bool:
    return event == "open" and isinstance(args[0], str | bytes) and bool((args[2] or 0) & _WRITING)


def _processor_time() -> float:
    return sum(os.times()[:4])


def _files(folder: Path) -> set[Path]:
    return {path for path in folder.rglob("*") if path.is_file()}


def _reset_peak() -> float:
    """Begin to measure the peak of memory anew; memory that the process has now, MiB."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
    return _status("VmRSS")


def _peak() -> float:
    """The peak of memory since `_reset_peak`, MiB."""
    return _status("VmHWM")


def _status(name: str) -> float:
    line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith(f"{name}:"))
    return int(line.split()[1]) / 1024
