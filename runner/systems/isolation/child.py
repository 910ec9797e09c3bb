"""The process of a system under test: it builds the class, and answers the messages of runs until
their side closes.

Standard output leads to standard error, so that what a class prints mixes with no result.
`sys.argv` holds the name alone. When the process that started it has ended, it ends too, with all
that it has started.
"""

from __future__ import annotations

import gc
import json
import os
import signal
import socket
import sys
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import xodr
from runner.systems import (
    ClassOrigin,
    System,
    class_origin,
    files_of_user,
    load_system,
    system_name,
)
from runner.systems.array_systems import open_arrays
from runner.systems.arrays import ArraySystem
from runner.systems.base import WorldDriven, parameters_of, plain
from runner.systems.isolation.frames import FrameConnection, PeerGone
from runner.systems.isolation.messages import (
    BEGIN_MANY,
    BUILD,
    BUILD_MANY,
    CLOSE,
    DESCRIBE,
    DONE,
    ERROR,
    FAILURE,
    RESET,
    STEP,
    STEP_MANY,
    ArrayReader,
    ObservationReader,
    participant_of,
    write_answer,
    write_answers,
)
from schemas.common.errors import ToolchainError, blame
from xodr.graph.network import RoadNetwork

_WATCH = 1.0
"""Time (s) between looks whether the process that started this one still runs"""
_LONGEST = 1 << 31
"""Bytes of a message from the run"""
_TOLD = 10_000
"""Characters of an error, and the last ones of its traceback, that are sent"""


def serve(handle: int | str, parent: int | str) -> None:
    """Answer messages until the other side closes.

    Args:
        handle: number of the socket that was inherited.
        parent: number of the process that started this one; it may have ended since.
    """
    _watch(int(parent))
    connection = FrameConnection(socket.socket(fileno=int(handle)), None, "the run", _LONGEST)
    server, process = _SystemServer(), os.getpid()
    while True:
        with suppress(Exception):
            sys.stdout.flush()
        try:
            request = connection.receive()
        except PeerGone:
            return
        answer = server.answer(request)
        try:
            connection.send(answer)
        except (
            OSError,
            PeerGone,
        ):  # the other side is gone, or the system has closed the connection
            os._exit(1)
        if os.getpid() != process:
            os._exit(1)  # a copy that the system has forked


def _watch(parent: int) -> None:
    """End this process, and its group, soon after the one that started it."""
    if os.name == "posix":

        def look() -> None:
            # An orphan has another parent.
            while os.getppid() == parent:
                time.sleep(_WATCH)
            # The closed connection mostly ends it first: this is for one that hangs.
            time.sleep(_WATCH)
            os.killpg(0, signal.SIGKILL)

        threading.Thread(target=look, daemon=True).start()


class _SystemServer:
    """Holds the system of one run at a time."""

    def __init__(self) -> None:
        self._process = os.getpid()
        self._system: System | None = None
        self._reader = ObservationReader(_RoadsOnDemand)
        self._arrays: ArraySystem | None = None
        self._array_reader = ArrayReader(_RoadsOnDemand)
        self._actions: dict[bytes, Callable[[Any], Any]] = {
            DESCRIBE: self._describe,
            BUILD: self._build,
            BUILD_MANY: self._build_many,
            RESET: self._reset,
            CLOSE: self._close,
        }

    def answer(self, request: bytes) -> bytes:
        """Answer to a message; an exception of the class becomes one."""
        kind = request[:1]
        try:
            if kind == STEP:
                found = write_answer(plain(self._system.control(*self._reader.read(request))))  # type: ignore[union-attr]
            elif kind == STEP_MANY:
                found = write_answers(self._arrays.control(*self._array_reader.step(request)))  # type: ignore[union-attr]
            elif kind == BEGIN_MANY:
                self._arrays.reset(*self._array_reader.begin(request))  # type: ignore[union-attr]
                found = DONE + b"}"
            else:
                found = json.dumps(self._actions[kind](json.loads(request[1:] or b"{}"))).encode()
        # Errors before a run are the user's, in a run those of the system.
        except ToolchainError as error:
            if kind in (DESCRIBE, BUILD, BUILD_MANY):
                found = (
                    ERROR + json.dumps([type(error).__name__, error.message, error.path]).encode()
                )
            else:
                found = self._failure(error, str(error))
        except BaseException as error:
            module = type(self._system).__module__ if self._system is not None else ""
            told = blame(error, module)
            if isinstance(error, MemoryError):
                told += ": this takes more memory than there is, or than the process may have"
            found = self._failure(error, told)
        # Two processes would answer over one socket.
        if os.getpid() != self._process:
            told = "a copy of its process, which it has forked, does not end: os._exit() ends one"
            found = self._failure(RuntimeError(told), told)
        return found

    def _failure(self, error: BaseException, told: str) -> bytes:
        is_fatal = (
            not isinstance(error, Exception)
            or isinstance(error, MemoryError)
            or os.getpid() != self._process
        )
        trace = "".join(traceback.format_exception(error))
        return (
            FAILURE
            + json.dumps(
                {"told": told[:_TOLD], "fatal": is_fatal, "trace": trace[-_TOLD:]}
            ).encode()
        )

    def _build(self, request: dict[str, Any]) -> dict[str, Any]:
        self._system, self._arrays = None, None
        # what the system of the last run holds, as memory of a device, is free before the next one
        # is built
        gc.collect()
        self._system = system = load_system(request["system"])
        return {
            "name": system_name(system),
            "world_driven": isinstance(system, WorldDriven),
            "files": files_of_user(),
        }

    def _describe(self, request: dict[str, Any]) -> tuple[ClassOrigin, list[str]]:
        origin, files = class_origin(request["system"]), files_of_user()
        return origin._replace(imports=tuple(files)), files

    def _build_many(self, request: dict[str, Any]) -> dict[str, Any]:
        self._system, self._arrays = None, None
        gc.collect()
        self._arrays = open_arrays(request["system"], in_process=True)
        self._array_reader = ArrayReader(_RoadsOnDemand)
        return {"together": self._arrays.together, "files": files_of_user()}  # type: ignore[union-attr]

    def _reset(self, request: dict[str, Any]) -> dict[str, Any]:
        self._reader = ObservationReader(_RoadsOnDemand)
        assert self._system is not None
        self._system.reset(participant_of(request["ego"]), request["timestep"], request["seed"])
        return parameters_of(self._system)

    def _close(self, request: dict[str, Any]) -> dict[str, Any]:
        if self._arrays is not None:
            arrays, self._arrays = self._arrays, None
            arrays.close()
            return {}
        end = getattr(self._system, "close", None)
        if end is not None:
            end()
        return parameters_of(self._system)


class _RoadsOnDemand(RoadNetwork):
    """Road network of a file; read at the first use of an attribute."""

    # Without the fields of `RoadNetwork`: they come with the file.
    def __init__(self, path: str, file: str) -> None:
        self.__dict__.update(_where=(path, file))

    def __getattr__(self, name: str) -> Any:
        # Copies and pickles ask for special methods: these must not read the file.
        if name.startswith("__"):
            raise AttributeError(name)
        path, file = self.__dict__["_where"]
        self.__dict__.update(vars(xodr.load(file)), path=Path(path))
        return getattr(self, name)
