"""Policy of a command on reading, loading and resources: one per process, inherited by child
processes.

Files of strangers refer to other files, ask for plug-ins, and may take any time and memory.
`CommandPolicy` states what they get. The places that read, load or work ask it:
`schemas.common.storage.read_bytes` and the readers of recordings before a file is opened, what
resolves references and looks for roads and catalogues, what loads plug-ins, and what works on one
file or run after the other (`limited`). Commands set it from their options, see
`schemas.common.terminal.command_line.protected`.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory

from schemas.common.errors import InvalidFile, Unsupported, UsageError, describe

try:
    import resource
except ImportError:  # not on Windows
    resource = None  # type: ignore[assignment]

_GRACE = 2.0
"""Time (s) that work has to end by itself when its time is over"""
_SOURCE = Path(__file__).resolve().parents[2]
"""The folder that holds the toolchain's packages"""


class LimitReached(Unsupported):
    """Work on a file that takes more than it may."""


@dataclass(frozen=True)
class CommandPolicy:
    """Policy on the files a command may read, the code it may load and the resources it may use.

    Attributes:
        named: folders and files that the user named, resolved: a file stands for the working folder
            where it lies in that, for its own folder otherwise. Empty where there is no command
            (Python).
        own: what may be read besides: the toolchain's own files and caches, and the folders that
            are written into.
        untrusted: files come from anyone. Nothing outside `named` and `own` is read, no plug-in is
            loaded.
        max_memory: memory that each process may take, GiB.
        max_seconds: time that the work on a file, or a run, may take.
        max_runs: runs, or parameter sets, that one file may stand for.
        max_bytes: largest file that is read whole; no more than `schemas.common.storage.MAX_BYTES`
            in any case.
    """

    named: tuple[Path, ...] = ()
    own: tuple[Path, ...] = ()
    untrusted: bool = False
    max_memory: float | None = None
    max_seconds: float | None = None
    max_runs: int | None = None
    max_bytes: int | None = None

    def holds(self, path: str | PathLike[str]) -> bool:
        """Whether a file or folder lies where the user said, symbolic links followed; so does all
        where nothing was named."""
        try:
            real = Path(os.path.realpath(path))
        except (OSError, ValueError):
            return False  # no such name can be
        return not self.named or any(real.is_relative_to(root) for root in (*self.named, *self.own))

    def allows(self, path: str | PathLike[str]) -> bool:
        """Whether a file or folder may be looked at."""
        return not self.untrusted or self.holds(path)

    def admit(self, path: str | PathLike[str]) -> None:
        """Refuse a file or folder that may not be looked at.

        Raises:
            InvalidFile: --untrusted, and it lies elsewhere.
        """
        if not self.allows(path):
            raise InvalidFile(f"this {self.outside}, which --untrusted refuses", path=path)

    @property
    def outside(self) -> str:
        """Message for a file outside the allowed folder."""
        return f"lies outside of {' and '.join(map(str, self.named))}"

    def admit_code(self, what: str) -> None:
        """Refuse to load a plug-in.

        Raises:
            UsageError: --untrusted.
        """
        if self.untrusted:
            raise UsageError(f"{what}: --untrusted loads no code but the toolchain's own")

    def admit_runs(self, count: int, path: str | PathLike[str]) -> None:
        """Refuse a file that stands for too many runs.

        Raises:
            LimitReached: it stands for more than `max_runs`.
        """
        if self.max_runs is not None and count > self.max_runs:
            message = (
                f"this file stands for {count:,} runs, --max-runs allows {self.max_runs:,}; "
                "--only and --sample choose some"
            )
            raise LimitReached(message, path=path)

    @property
    def bounded(self) -> bool:
        """Whether work has limits that may end its process."""
        return self.max_memory is not None or self.max_seconds is not None


UNTRUSTED = CommandPolicy(
    untrusted=True, max_memory=4.0, max_seconds=300.0, max_runs=1000, max_bytes=64 * 1024 * 1024
)
"""The limits of --untrusted, where no others are given."""

_current = CommandPolicy()


def current() -> CommandPolicy:
    """The policy in force."""
    return _current


@contextmanager
def in_force(policy: CommandPolicy) -> Iterator[None]:
    """Context manager that puts a policy in force, in forked processes too; others are given it.

    Raises:
        UsageError: this system can't keep its limits.
    """
    global _current
    if policy.bounded and (resource is None or not hasattr(signal, "setitimer")):
        raise UsageError(
            "this system does not limit the memory and time of a process; leave --max-memory and "
            "--max-seconds out"
        )
    before, _current = _current, policy
    try:
        with _memory(policy.max_memory):
            yield
    finally:
        _current = before


@contextmanager
def scratch(prefix: str) -> Iterator[Path]:
    """Context manager of a temporary folder that every policy lets be read; it is deleted in the
    end."""
    global _current
    with TemporaryDirectory(prefix=prefix) as folder:
        before = _current
        _current = replace(before, own=(*before.own, Path(os.path.realpath(folder))))
        try:
            yield Path(folder)
        finally:
            _current = before


@contextmanager
def _memory(gib: float | None) -> Iterator[None]:
    if gib is None:
        yield
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = int(gib * 2**30)
    resource.setrlimit(
        resource.RLIMIT_DATA, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard)
    )
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))


class Ended(KeyboardInterrupt):
    """A signal asks the command to end.

    Args:
        number: of the signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


_signal = 0


def end_by(number: int) -> None:
    """Note that a signal asks the command to end; 0 for none."""
    global _signal
    _signal = number


def poll() -> None:
    """End the command if a signal has asked for it, and a library kept the exception for itself.

    Raises:
        Ended: one has.
    """
    if _signal:
        raise Ended(_signal)


class _TimeOver(BaseException):
    """Ends work; no `except Exception` on the way takes it for an error of its own."""


@contextmanager
def limited() -> Iterator[None]:
    """Context manager around the work on one file, or one run: it ends when its time is over, or
    memory has run out. Can decorate a function.

    Inside another one, the time of that one counts. A library that does not come back to Python for
    that long takes its process along, where that is a worker's.

    Raises:
        LimitReached: it took too long, or too much memory.
        Ended: a signal has asked the command to end.
    """
    poll()
    try:
        with _timed(_current.max_seconds):
            yield
    except MemoryError as error:
        raise LimitReached(describe(error)[0]) from None


@contextmanager
def _timed(seconds: float | None) -> Iterator[None]:
    # Signal handlers belong to the main thread; a running timer is that of an outer `limited`.
    if (
        seconds is None
        or threading.current_thread() is not threading.main_thread()
        or signal.getitimer(signal.ITIMER_REAL)[0]
    ):
        yield
        return
    before = signal.signal(signal.SIGALRM, _end)
    is_worker = multiprocessing.parent_process() is not None
    try:
        try:
            signal.setitimer(signal.ITIMER_REAL, seconds, _GRACE)
            # SIGPROF has no handler: the kernel ends a worker whose library never returns here.
            # Its timer counts the processor time of all threads, hence the factor.
            if is_worker:
                signal.setitimer(signal.ITIMER_PROF, (seconds + _GRACE) * (os.cpu_count() or 1))
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            signal.signal(signal.SIGALRM, before)
    except _TimeOver:
        raise LimitReached(f"this takes longer than the {seconds:g} s of --max-seconds") from None


def _end(*_: object) -> None:
    raise _TimeOver


# what the user named ---------------------------------------------------------------------------


def of_command(
    inputs: Iterable[str | PathLike[str]],
    outputs: Iterable[str | PathLike[str]],
    own: Iterable[Path],
    limits: CommandPolicy,
) -> CommandPolicy:
    """The policy of a command line.

    Args:
        inputs, outputs: the files and folders that it names, there or not.
        own: what may be read besides.
        limits: the rest of the policy.

    Raises:
        UsageError: --untrusted, and a symbolic link leads out of the folder that holds it, or
            Python imports from there.
    """
    sources, targets = [Path(path) for path in inputs], [Path(path) for path in outputs]
    if limits.untrusted:
        for path in (*sources, *targets):
            _refuse_links(path)
        for path in targets:
            _refuse_links_in(path)
    named = tuple(dict.fromkeys(map(_root, sources)))
    policy = replace(
        limits, named=named, own=tuple(Path(os.path.realpath(path)) for path in (*own, *targets))
    )
    if limits.untrusted:
        _refuse_imports(named)
    return policy


def _root(path: Path) -> Path:
    """Folder of a named file or folder."""
    real, working = Path(os.path.realpath(path)), Path(os.path.realpath(os.curdir))
    if real.is_dir():
        return real
    return working if real.is_relative_to(working) else real.parent


def _refuse_links(path: Path) -> None:
    """Refuse a path inside the working folder that leads out of it by a link."""
    working = Path(os.path.realpath(os.curdir))
    # By the text of the path alone: realpath would follow the link that is looked for.
    name = Path(os.path.normpath(working / path))
    if name.is_relative_to(working) and not Path(os.path.realpath(name)).is_relative_to(working):
        raise UsageError(
            "a symbolic link leads out of the working folder, which --untrusted refuses", path=path
        )


def _refuse_links_in(folder: Path) -> None:
    """Refuse symbolic links in an output folder: files written through them would leave it."""
    for place, folders, files in os.walk(folder):
        for name in (*folders, *files):
            if os.path.islink(os.path.join(place, name)):
                message = (
                    "this is a symbolic link in an output folder, which --untrusted refuses: give "
                    "a new folder"
                )
                raise UsageError(message, path=os.path.join(place, name))
    if os.path.islink(folder):
        raise UsageError("this output is a symbolic link, which --untrusted refuses", path=folder)


def _refuse_imports(named: Iterable[Path]) -> None:
    """Refuse named folders that Python itself imports from (`python -m`, PYTHONPATH)."""
    installed = [Path(os.path.realpath(prefix)) for prefix in (sys.prefix, sys.base_prefix)]
    for entry in sys.path:
        real = Path(os.path.realpath(entry or os.curdir))
        ours = (
            real == _SOURCE
            or any(real.is_relative_to(folder) for folder in installed)
            or not real.is_dir()
        )
        if not ours and any(real.is_relative_to(root) for root in named):
            message = (
                "Python imports from this folder (python -m, PYTHONPATH, pip install -e), which "
                "--untrusted refuses: type the command, or install without -e"
            )
            raise UsageError(message, path=real)
