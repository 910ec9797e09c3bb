"""Runs fuzzed inputs in a process with limits, which may die, hang, or write where it should not,
and says what came of them.

Each input has a folder that is laid out as

    case/   the input's files                       out/   where results may be written
    cwd/    the working directory, to stay empty

and beside it are tmp/, to be empty after each input, cache/ (road networks) and seeds/ (what inputs
are made from).
"""

from __future__ import annotations

import gc
import importlib
import json
import multiprocessing
import os
import pkgutil
import re
import resource
import select
import shutil
import signal
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, BinaryIO, NamedTuple, NoReturn

import typer.main

from tests.commands import Answer
from tests.fuzz.kinds import CASE, OUT, Input, Kind, kinds, own_kinds, warm_up
from tests.mutation import Source

LONGEST = 10.0
"""Seconds of processor time that no input may take"""
LARGEST = 768.0
"""MiB by which no input may make the process grow"""
_ADDRESSES = 4 * 2**30
"""Bytes of addresses that a process may take on top of those that it begins with"""
_WAITED = 300.0
"""Seconds after which an input hangs: on a machine that does other work, too"""
_KILLED = 3.0
"""Limits of processor time after which an input's process is killed"""
_LARGEST_FILE = 2**30
"""Bytes of a file that an input may write"""
_GROUP = 100
"""Inputs that a child runs"""
DIED, HUNG = "the process died", "hang"
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT
_COMMAND = re.compile(r"^\s*::|##\[|##vso\[", re.MULTILINE)
"""What CI services take for their own commands"""
_VERDICTS = (0, 1, 6)
"""Exit codes of runs with a verdict, which a table tells by the run's name; the others are of
errors, which name a file
"""
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
    """Run inputs one after the other, in children of a server that has imported all; see `_serve`.

    Args:
        sources: scenarios that inputs are made from; None for those of this repository.
        numbers: of the inputs; seed and number decide all of one.
        only: beginning of the names of the kinds that are drawn.
        keep: folder for copies of inputs with defects.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(
        target=_serve,
        args=(theirs, sources, seed, numbers, scratch, only, limits, keep),
        daemon=True,
    )
    process.start()
    theirs.close()
    try:
        for _ in numbers:
            yield Result(*ours.recv())
    except EOFError:
        raise RuntimeError("the server of inputs has died") from None
    finally:
        process.kill()
        process.join()
        ours.close()


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
    """Import and read all that inputs share, then run them in forked children,
    `_GROUP` by `_GROUP`.

    The server itself runs no input and starts no simulator. An input with a defect is run again in
    a child of its own: its answer there counts, and a defect that it has only after other inputs is
    reported as such.
    """
    silence()
    sys.dont_write_bytecode = True
    server = Server(
        Runner(scratch, limits), kinds(sources) if sources else own_kinds(), seed, only, keep
    )
    done = 0
    while done < len(numbers):
        doubted = []
        for result in server.group(numbers[done : done + _GROUP]):
            done += 1
            if result.defect:
                doubted.append(result)
            else:
                connection.send(tuple(result))
        for result in doubted:  # when no other child uses the temporary folder
            connection.send(tuple(server.confirmed(result)))
    connection.close()


class Server:
    """Runs inputs in forked children of this process.

    Each child has a session of its own, all of which is killed at its end, and a limit of processor
    time for each input.
    """

    def __init__(
        self,
        runner: Runner,
        found: Mapping[str, Kind],
        seed: int,
        only: str = "",
        keep: Path | None = None,
        warm: bool = True,
    ) -> None:
        self._runner, self._seed, self._keep = runner, seed, keep
        self._chosen = {name: kind for name, kind in found.items() if name.startswith(only)}
        if warm:
            _import_all()
            warm_up(runner.folder(0))
        gc.collect()
        gc.freeze()  # else each child's first collection would copy all pages

    def group(self, numbers: Sequence[int]) -> Iterator[Result]:
        """Results of inputs that are run by one child, up to the first that ends it."""
        reading, writing = os.pipe()
        child = os.fork()
        if not child:
            os.close(reading)
            self._child(numbers, writing)
        os.close(writing)
        with open(reading, "rb") as answers:
            for number in numbers:
                result = _answer(answers)
                if result is None:
                    yield self._ended(number, _stop(child))
                    return
                yield result
        _stop(child)

    def confirmed(self, result: Result) -> Result:
        """The result of an input with a defect in a child of its own; files are kept."""
        (alone,) = self.group([result.number])
        folder = self._runner.folder(result.number)
        if self._keep is not None:
            _keep(
                self._keep,
                folder,
                f"{(alone.kind or 'died').replace(' ', '_')}-{self._seed}-{result.number}",
            )
        shutil.rmtree(folder, ignore_errors=True)
        if alone.defect:
            return alone
        return result._replace(defect=f"only after other inputs: {result.defect}")

    def _child(self, numbers: Sequence[int], writing: int) -> NoReturn:
        try:
            os.setsid()
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            resource.setrlimit(resource.RLIMIT_FSIZE, (_LARGEST_FILE, _LARGEST_FILE))
            for number in numbers:
                allowed = int(_processor_time() + _KILLED * self._runner.limits.seconds) + 1
                resource.setrlimit(resource.RLIMIT_CPU, (allowed, resource.RLIM_INFINITY))
                folder = self._runner.folder(number)
                result = self._runner.draw(self._chosen, self._seed, number, folder)
                if not result.defect:
                    shutil.rmtree(folder, ignore_errors=True)
                data = json.dumps(result).encode()
                os.write(writing, len(data).to_bytes(8, "big") + data)
        finally:
            os._exit(0)  # whatever happens, a child does not go on as the server

    def _ended(self, number: int, status: int) -> Result:
        """The result of an input whose child has ended without one, by a signal
        that its status tells.
        """
        signalled = os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0
        hung = signalled in (signal.SIGXCPU, signal.SIGKILL)
        self._runner.clear()
        return Result(
            number,
            "",
            "",
            (),
            5,
            HUNG if hung else f"{DIED} ({signalled or status})",
            "",
            _WAITED,
            0.0,
        )


def _answer(answers: BinaryIO) -> Result | None:
    """The next result that a child sends; None where it has ended, or sends
    nothing for `_WAITED`.
    """
    if not select.select([answers], [], [], _WAITED)[0]:
        return None
    size = int.from_bytes(answers.read(8), "big")
    if not size:
        return None
    values = json.loads(answers.read(size))
    return Result(*values)._replace(changes=tuple(values[3]))


def _stop(child: int) -> int:
    """End a child's whole session; its status."""
    ended, status = os.waitpid(child, os.WNOHANG)
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    return status if ended else os.waitpid(child, 0)[1]


def _import_all() -> None:
    """Import all product modules, and let typer build each command once: neither
    time nor memory of that is an input's.
    """
    typer.main.get_command = cache(typer.main.get_command)
    for package in ("schemas", "xosc", "xodr", "runner", "recognition"):
        for module in pkgutil.walk_packages(
            importlib.import_module(package).__path__, f"{package}."
        ):
            if not module.name.endswith("__main__"):
                with suppress(ImportError):  # of an extra
                    importlib.import_module(module.name)


def _keep(keep: Path, folder: Path, name: str) -> None:
    with suppress(OSError, shutil.Error):
        shutil.copytree(folder, keep / name, symlinks=True, dirs_exist_ok=True)


def silence() -> None:
    """Send what libraries and other programs print nowhere; commands print to
    streams of their own here.
    """
    with open(os.devnull, "w") as nothing:
        for stream in (1, 2):
            os.dup2(nothing.fileno(), stream)


class Runner:
    """Runs inputs in this process, with limits, and looks at all that they leave."""

    def __init__(self, scratch: Path, limits: Limits, addresses: int | None = _ADDRESSES) -> None:
        self.limits, self._scratch, self._written = limits, scratch, list[str]()
        os.environ["XOSC_CACHE_DIR"], os.environ["TMPDIR"] = (
            str(scratch / "cache"),
            str(scratch / "tmp"),
        )
        os.environ["MPLCONFIGDIR"] = str(
            scratch / "cache"
        )  # Matplotlib lists the machine's fonts there once
        (scratch / "seeds").mkdir(exist_ok=True, parents=True)
        self.clear()
        sys.addaudithook(
            lambda event, args: (
                self._written.append(os.fsdecode(args[0])) if _is_writing(event, args) else None
            )
        )
        for module in (
            "runner.judging.execution",
            "runner.batch.outputs.tables",
            "pyarrow.parquet",
            "pyproj",
            "scipy.special",
        ):
            importlib.import_module(module)  # neither its time nor its memory is an input's
        if addresses is not None:
            used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            resource.setrlimit(resource.RLIMIT_AS, (used + addresses, resource.RLIM_INFINITY))

    def folder(self, number: int) -> Path:
        """Folder of the input with that number."""
        return self._scratch / f"input{number}"

    def clear(self) -> None:
        """Remove temporary files that a process left that was killed."""
        shutil.rmtree(self._scratch / "tmp", ignore_errors=True)
        (self._scratch / "tmp").mkdir()

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
        arguments = [
            each.replace(CASE, str(folder / "case")).replace(OUT, str(folder / "out"))
            for each in made.arguments
        ]
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
            defect = "; ".join(
                filter(None, (defect, "trajectories with numbers that are not finite"))
            )
        if not defect and kind.checked is not None and answer.code in (0, 1):
            defect = _green(arguments, answer, kind.checked)
        message = answer.err.strip()[-1500:].replace(f"{folder}/", "")
        return Result(
            number, name, made.source, made.changes, answer.code, defect, message, seconds, growth
        )

    def _defects(
        self,
        kind: Kind,
        answer: Answer,
        folder: Path,
        files: set[Path],
        seconds: float,
        growth: float,
    ) -> Iterator[str]:
        if "Traceback (most recent call last)" in answer.err:
            yield f"traceback: {answer.err.strip().splitlines()[-1][:160]}"
        elif "internal error" in answer.err + answer.out:
            yield "internal error"
        if answer.code not in kind.codes and not (
            answer.code == 2 and "this stands for no" in answer.err
        ):  # a folder
            yield f"exit code {answer.code}"
        if answer.code not in _VERDICTS and f"{folder.name}/" not in answer.err:
            yield "an error that names no file of the input"
        printed = answer.out + answer.err
        odd = (
            None
            if printed.replace("\n", " ").isprintable()
            else next(c for c in printed if not (c.isprintable() or c == "\n"))
        )
        if odd is not None and not (
            answer.out.startswith(("<", "{", "name,")) and odd not in answer.err
        ):
            yield f"the character {odd!r} on the console"
        if _COMMAND.search(answer.out + "\n" + answer.err):
            yield "a line that CI services take for a command"
        if seconds >= self.limits.seconds:
            yield f"{seconds:.0f} s of processor time"
        if growth >= self.limits.memory or "more memory than there is" in answer.err:
            yield f"{growth:.0f} MiB of memory"
        allowed = tuple(
            map(
                str,
                (
                    folder / "out",
                    folder / "case",
                    self._scratch / "cache",
                    self._scratch / "tmp",
                    os.devnull,
                ),
            )
        )
        written = {
            path
            for path in {*self._written, *map(str, _files(folder) - files)}
            if "/__pycache__/" not in path
        }
        outside = {
            path for path in written if not path.startswith(allowed)
        }  # modules are compiled when they are first imported
        left = _files(self._scratch / "tmp")
        if outside or left:
            yield (
                "files written outside of the output folder: "
                f"{', '.join(sorted({*outside, *map(str, left)}))}"
            )
        for each in left:
            each.unlink(missing_ok=True)


def _green(arguments: Sequence[str], answer: Answer, rules: str) -> str:
    """The first of these rules that a file breaks, of which nothing was said though it was run or
    exported; "" without one.
    """
    from schemas import check

    file = next((each for each in arguments if each.endswith(".xosc")), None)
    if file is None or _RULE.search(answer.out + answer.err) or "remark" in answer.out:
        return ""
    errors = (
        problem
        for problem in check(file)
        if problem.level == "error" and problem.rule.endswith(rules)
    )
    untold = (
        problem
        for problem in errors
        if f"{Path(file).name}:{problem.line}: " not in answer.out + answer.err
    )
    broken = (
        problem for problem in untold if ":naming." not in problem.rule
    )  # a name with `::` is run like any other
    fault = next(map(str, broken), "")
    return (
        f"green without a word, though invalid: {fault.rpartition('/')[2][:200]}" if fault else ""
    )


def _is_finite(table: Path) -> bool:
    """Whether all poses and speeds of a run are finite numbers."""
    import numpy as np
    import pyarrow.parquet as parquet

    columns = parquet.read_table(
        table, columns=["x", "y", "z", "h", "pitch", "roll", "speed", "acceleration"]
    )
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
    line = next(
        line
        for line in Path("/proc/self/status").read_text().splitlines()
        if line.startswith(f"{name}:")
    )
    return int(line.split()[1]) / 1024
