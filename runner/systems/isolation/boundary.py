"""Systems under test of the user behind a boundary: processes of their own groups, asked by
messages.

Whatever a class does there (exit, crash, hang, fork, print, close streams) is an error of that
system in that run. A process serves one run after the other, each with a new instance, so that its
start and the import of the class are paid once; one that has died, or was ended, is replaced at the
next run. Results are the same as in this process.
"""

from __future__ import annotations

import atexit
import json
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from typing import Any

from runner.systems.arrays import Answers, ArraySystem, BatchObservation, BatchParticipants
from runner.systems.base import (
    Control,
    Observation,
    Participant,
    Pose,
    SystemFailure,
    SystemUnderTestError,
    Value,
    WorldDriven,
)
from runner.systems.isolation.frames import FrameConnection, PeerGone, PeerSilent
from runner.systems.isolation.messages import (
    BUILD,
    BUILD_MANY,
    CLOSE,
    DESCRIBE,
    ERROR,
    FAILURE,
    RESET,
    ArrayWriter,
    ObservationWriter,
    declared_json,
    read_answer,
    read_answers,
)
from schemas.common.array_types import IntArray
from schemas.common.errors import InvalidFile, ToolchainError, Unsupported, UsageError
from schemas.common.storage import Stamp, stamp

_BOOT = (
    "import json, sys; sys.path[:] = json.loads(sys.argv.pop(1)); handle, parent = sys.argv[1:3]; "
    "sys.argv[:] = sys.argv[3:]; from runner.systems.isolation.child import serve; "
    "serve(handle, parent)"
)
"""Program of the process; its arguments are the path of imports, the socket, this process and the
name of the system"""
_LOOK = 1.0
"""Time (s) between looks whether a process that does not answer still runs"""
_LEAVING = 2.0
"""Time (s) that a process has to end by itself when it is no longer needed"""
_STARTING = 60.0
"""Least time (s) for the import of a class and for its constructor, which may load a model"""
_MOST_IDLE = 2
_LONGEST = 1 << 24
"""Bytes of an answer"""
_ERRORS: dict[str, type[ToolchainError]] = {
    kind.__name__: kind for kind in (InvalidFile, Unsupported, UsageError)
}
_IS_POSIX = os.name == "posix"


class _SystemProcess:
    """The process of a system.

    Args:
        name: of the system, as the user gives it.

    Raises:
        UsageError: no process can be started.
    """

    def __init__(self, name: str) -> None:
        if not sys.executable:
            raise UsageError(
                "this Python can't be started as another process; --sut-in-process runs "
                "the class in this one"
            )
        own, other = socket.socketpair()
        group: dict[str, Any] = {"process_group": 0, "pass_fds": [other.fileno()]}
        if not _IS_POSIX:
            os.set_handle_inheritable(other.fileno(), True)  # type: ignore[attr-defined]
            flag = subprocess.CREATE_NEW_PROCESS_GROUP  # type: ignore[attr-defined]
            group = {"creationflags": flag, "close_fds": False}
        arguments = [json.dumps(sys.path), str(other.fileno()), str(os.getpid()), name]
        # The child alone may hold its end: otherwise its death would not close the connection.
        with other:
            try:
                self._process = subprocess.Popen(
                    # The path of imports is handed over as it is here: `-P` puts no folder before
                    # it.
                    [sys.executable, "-P", "-c", _BOOT, *arguments],
                    # The input of the command is not for a class of the user.
                    stdin=subprocess.DEVNULL,
                    stdout=_error_output(),
                    **group,
                )
            except OSError as error:
                own.close()
                reason = error.strerror or error
                raise UsageError(
                    f"no process can be started for the system under test {name!r}: {reason}"
                ) from None
        self._connection = FrameConnection(own, None, "the system under test", _LONGEST)

        self.facts: dict[str, Any] = {}
        """Answers about classes, by their names with parameters"""
        self._files: dict[str, Stamp] = {}

    def keep(self, files: list[str]) -> None:
        """Take note of the files of the user that the process has imported."""
        for file in files:
            self._files.setdefault(file, stamp(file))

    @property
    def is_current(self) -> bool:
        """Whether these files are as they were."""
        return all(stamp(file) == known for file, known in self._files.items())

    def ask(self, message: bytes, limit: float) -> bytes:
        """Send a message, and return its answer.

        Args:
            limit: time (s) for the answer.

        Raises:
            SystemFailure: the process ends, does not answer in time, or answers that the system
                failed.
            ToolchainError: there is no such class, or it has no such parameter.
        """
        connection = self._connection
        connection.limit = limit
        try:
            connection.send(message)
            answer = self._answer(limit)
        except PeerSilent:
            self.end(at_once=True)
            raise SystemFailure(
                f"no answer within {limit:g} s (--sut-timeout); its process was ended"
            ) from None
        except PeerGone:
            raise SystemFailure(self._ending()) from None
        except (
            BaseException
        ):  # an interruption, or the end of a run's time: the answer to come is nobody's
            self.end(at_once=True)
            raise
        if answer[:1] == FAILURE:
            told = json.loads(answer[1:])
            if told["fatal"]:
                self.end(at_once=True)
            failure = SystemFailure(told["told"])
            failure.add_note(told["trace"])
            raise failure
        if answer[:1] == ERROR:
            kind, text, path = json.loads(answer[1:])
            # By name, since classes do not pass: other kinds are errors of usage.
            raise _ERRORS.get(kind, UsageError)(text, path=path)
        return answer

    def _answer(self, limit: float) -> bytes:
        """Wait for the answer; notice the death of the process even if copies of it hold the
        connection open."""
        end = time.monotonic() + limit
        while True:
            left = end - time.monotonic()
            try:
                return self._connection.receive(min(_LOOK, left))
            except PeerSilent:
                if left <= _LOOK:
                    raise
                if self._has_ended():
                    raise PeerGone("") from None

    @property
    def is_usable(self) -> bool:
        """Whether the process still runs."""
        return self._process.returncode is None and not self._has_ended()

    def _has_ended(self) -> bool:
        """Whether the process has ended; it is not reaped, so that its number still names its
        group."""
        if not _IS_POSIX:
            return self._process.poll() is not None
        with suppress(ChildProcessError):
            return (
                os.waitid(os.P_PID, self._process.pid, os.WEXITED | os.WNOWAIT | os.WNOHANG)
                is not None
            )
        return True

    def end(self, at_once: bool = False) -> int | None:
        """End the process with its children; return its exit code, negative for a signal.

        Args:
            at_once: leave it no time to end by itself.
        """
        if self._process.returncode is not None:
            return self._process.returncode
        # A closed connection tells the child that it is no longer needed.
        self._connection.close()
        until = time.monotonic() + (0.0 if at_once else _LEAVING)
        while not self._has_ended() and time.monotonic() < until:
            time.sleep(0.005)
        ended = self._has_ended()
        # The whole group: a class may have started processes of its own.
        with suppress(OSError):
            if _IS_POSIX:
                os.killpg(self._process.pid, signal.SIGKILL)
            elif not ended:
                self._process.kill()
        code = self._process.wait()
        return code if ended else None

    def _ending(self) -> str:
        """Sentence on the end of a process that has closed the connection."""
        code = self.end()
        if code is None:
            return "its process has closed its files, and with them the way to answer"
        if code >= 0:
            return f"its process ended with code {code} before it had answered"
        try:
            name = signal.Signals(-code).name
        except ValueError:
            name = f"signal {-code}"
        killed = ", as a system does that runs out of memory" if name == "SIGKILL" else ""
        return f"its process was ended by {name}{killed}"

    def abandon(self) -> None:
        """Release a process of the parent that this process was forked from."""
        self._connection.close()
        self._process.returncode = 0  # it is not waited for here


def _error_output() -> int:
    """Standard error, where it is open."""
    try:
        os.fstat(2)
    except OSError:
        return subprocess.DEVNULL
    return 2


# idle processes ----------------------------------------------------------------------------------

_Key = tuple[str, str, tuple[str, ...]]
_idle: list[tuple[_Key, _SystemProcess]] = []


def _key(name: str) -> _Key:
    """Name, and everything that decides its code."""
    return name, os.getcwd(), tuple(sys.path)


def _take(name: str) -> _SystemProcess:
    """An idle process of that system, or a new one."""
    key = _key(name)
    for place, (known, process) in enumerate(_idle):
        if known == key:
            del _idle[place]
            # A process that imported other versions of the files would play old code.
            if process.is_usable and process.is_current:
                return process
            process.end()
            break
    return _SystemProcess(name)


def _give_back(name: str, process: _SystemProcess) -> None:
    if not process.is_usable:
        process.end()
        return
    _idle.append((_key(name), process))
    while len(_idle) > _MOST_IDLE:
        _idle.pop(0)[1].end()


def release() -> None:
    """End all processes that no run uses."""
    while _idle:
        _idle.pop()[1].end()


def _abandon() -> None:
    while _idle:
        _idle.pop()[1].abandon()


atexit.register(release)
# A forked copy shares the sockets: its messages would mix with those of its parent.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_abandon)


# systems -----------------------------------------------------------------------------------------


def facts(name: str, text: str, limit: float) -> Any:
    """Facts about a class, which is imported in its process: the fields of
    `runner.systems.ClassOrigin`.

    Args:
        name: the class, as `module:Class`. text: the same with its parameters.
        limit: time (s) for the answer; `_STARTING` at least.

    Raises:
        UsageError: it can't be imported, or has no such parameter.
    """
    process = _take(name)
    try:
        if text not in process.facts:
            request = DESCRIBE + json.dumps({"system": text}).encode()
            process.facts[text], files = json.loads(process.ask(request, max(limit, _STARTING)))
            process.keep(files)
    except SystemFailure as error:
        raise UsageError(f"the system under test {name!r} can't be imported: {error}") from error
    finally:
        _give_back(name, process)
    return process.facts[text]


class _Isolated:
    """Stand-in for a system in another process."""

    def __init__(self, name: str, process: _SystemProcess, limit: float, shown: str) -> None:
        self.remote_name = shown
        """`module:Class` of the instance"""
        self.remote_parameters: dict[str, Value] = {}
        self._system, self._process, self._limit = name, process, limit
        self._writer = ObservationWriter()
        self._open, self._failed = True, False

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Begin a run."""
        # The child reads each run anew: what stays has to be sent again.
        self._writer = ObservationWriter()
        self._request(RESET, {"ego": declared_json(ego), "timestep": timestep, "seed": seed})

    def close(self) -> None:
        """End the run; its process is kept for the next one."""
        if not self._open:
            return
        self._open = False
        has_failed = self._failed
        try:
            # A process that has failed may still run: its class is closed, and what that says is
            # dropped.
            if not has_failed or self._process.is_usable:
                self._request(CLOSE, {})
        except SystemFailure:
            if not has_failed:  # else the run has ended by an earlier failure already
                raise
        finally:
            _give_back(self._system, self._process)

    def _request(self, kind: bytes, values: dict[str, Any]) -> None:
        self.remote_parameters = json.loads(self._ask(kind + json.dumps(values).encode()))

    def _ask(self, message: bytes) -> bytes:
        try:
            return self._process.ask(message, self._limit)
        except BaseException:
            self._failed = True
            raise


class IsolatedSystem(_Isolated):
    """A system under test in another process."""

    def control(self, observation: Observation, dt: float) -> Control | Pose:
        """The answer of the system."""
        return read_answer(self._ask(self._writer.write(observation, dt)))


class IsolatedDriver(_Isolated, WorldDriven):
    """A class of the user by which the world's own driver drives the ego."""


class IsolatedArrays(ArraySystem):
    """A class of the user in another process, in many runs at once.

    Args:
        together: whether it has a `control_batch`; if not, each of its instances has the time limit
            for its answer.
    """

    def __init__(self, name: str, process: _SystemProcess, limit: float, together: bool) -> None:
        self.together = together
        self._system, self._process, self._limit = name, process, limit
        self._writer = ArrayWriter()
        self._open = True

    def reset(self, egos: BatchParticipants, timestep: float, seeds: IntArray) -> None:
        """Begin the runs."""
        self._writer = ArrayWriter()
        self._ask(self._writer.begin(egos, timestep, seeds), len(seeds))

    def control(self, observations: BatchObservation, dt: float) -> Answers:
        """The answers of the system."""
        message = self._writer.step(observations, dt)
        return read_answers(self._ask(message, len(observations.run)))

    def _ask(self, message: bytes, runs: int) -> bytes:
        try:
            return self._process.ask(message, self._limit * (1 if self.together else max(runs, 1)))
        except SystemFailure as error:
            raise SystemUnderTestError(
                f"the system under test {self._system} failed in arrays: {error}"
            ) from error

    def close(self) -> None:
        """End the runs; the process is kept."""
        if not self._open:
            return
        self._open = False
        try:
            if self._process.is_usable:
                self._ask(CLOSE + b"{}", 1)
        finally:
            _give_back(self._system, self._process)


def isolated_arrays(name: str, text: str, limit: float) -> IsolatedArrays:
    """A class of the user for many runs at once, in a process of its own.

    Args:
        name, text, limit: as of `isolated`.

    Raises:
        UsageError: it can't be imported or built.
        Unsupported: it can't drive many runs at once.
    """
    process = _take(name)
    try:
        request = BUILD_MANY + json.dumps({"system": text}).encode()
        answer = json.loads(process.ask(request, max(limit, _STARTING)))
    except BaseException as error:
        _give_back(name, process)
        if isinstance(error, SystemFailure):
            raise UsageError(f"the system under test {name!r} can't be built: {error}") from error
        raise
    process.keep(answer["files"])
    return IsolatedArrays(name, process, limit, answer["together"])


def isolated(name: str, text: str, limit: float) -> IsolatedSystem | IsolatedDriver:
    """A new instance of a class of the user, in a process of its own.

    Args:
        name, text, limit: as of `facts`; the limit holds for each answer.

    Raises:
        UsageError: it can't be imported or built.
    """
    process = _take(name)
    try:
        answer = json.loads(
            process.ask(BUILD + json.dumps({"system": text}).encode(), max(limit, _STARTING))
        )
    except SystemFailure as error:
        _give_back(name, process)
        raise UsageError(f"the system under test {name!r} can't be built: {error}") from error
    except BaseException:
        _give_back(name, process)
        raise
    process.keep(answer["files"])
    kind = IsolatedDriver if answer["world_driven"] else IsolatedSystem
    return kind(name, process, limit, answer["name"])
