"""Searches of several targets at a time, each in a process of its own."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path
from typing import Self

from generation.loop.settings import LoopSettings
from generation.loop.stages.findings import Searched
from generation.loop.tasks.searching import search
from generation.loop.tasks.targets import Target
from runner.batch.pool import executor
from schemas.errors import ToolchainError
from xodr.array_types import FloatArray


class Searchers:
    """Processes that search. A context manager; they last as long as it does.

    A target is searched by the same process in each round: it remembers the densities that it has fitted.

    Args:
        out: output folder of the loop.
        settings: of the loop; `processes` says how many there are.
    """

    def __init__(self, out: Path, settings: LoopSettings) -> None:
        self._out, self._count, self._settings = out, settings.processes, replace(settings, processes=1)
        self._processes: list[ProcessPoolExecutor] = []
        self._numbers: dict[str, int] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes:
            process.shutdown(wait=True, cancel_futures=True)

    def begin(self, target: Target, number: int, known: FloatArray | None) -> Callable[[], Searched]:
        """Begin to search, see `search`; what waits for the result.

        That raises ToolchainError where the process has died.
        """
        if not self._processes:
            self._processes = [executor(1, anew=True) for _ in range(self._count)]
        process = self._processes[self._numbers.setdefault(target.name, len(self._numbers) % self._count)]
        found = process.submit(_searched, target, number, self._out, self._settings, known)
        return lambda: _result(found)


def _searched(target: Target, number: int, out: Path, settings: LoopSettings, known: FloatArray | None) -> Searched:
    return search(target, number, out, settings, known, lambda _: None)


def _result(search: Future[Searched]) -> Searched:
    try:
        return search.result()
    except BrokenProcessPool:
        raise ToolchainError("a process died, perhaps because memory ran out; go on with --jobs 1") from None
