"""Worker processes that are replaced when they die."""

from __future__ import annotations

import itertools
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool

from runner.batch.jobs import Job, Outcome
from schemas.errors import UsageError

try:
    import resource
except ImportError:  # not on Windows
    resource = None  # type: ignore[assignment]

_AHEAD = 8
"""Runs handed out for each process ahead of need: few, so that a space of any size is never enumerated."""

_Pending = tuple[Job, "Future[Outcome]"] | Outcome


class Pool:
    """Does jobs in several processes, each job once. A context manager; the processes last as long as it does.

    Args:
        processes: how many.
        work: does a job; to be pickled, so a function of a module or a `functools.partial` of one.
        died: the outcome of a job whose process died.
        max_memory: what each process may take, GiB; as much as there is where it is None.

    Raises:
        UsageError: this system does not limit the memory of a process.
    """

    def __init__(
        self, processes: int, work: Callable[[Job], Outcome], died: Callable[[Job], Outcome], max_memory: float | None = None
    ) -> None:
        if max_memory is not None and resource is None:
            raise UsageError("this system does not limit the memory of a process; leave --max-memory out")
        self._processes, self._work, self._died, self._max_memory = processes, work, died, max_memory
        self._pool = executor(processes, max_memory)

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes, after the jobs that are in work."""
        self._pool.shutdown(wait=True, cancel_futures=True)

    def execute(self, jobs: Iterator[Job | Outcome]) -> Iterator[Outcome]:
        """Outcomes in the order of the jobs; what is an outcome already passes through. For one caller at a time."""
        waiting: deque[_Pending] = deque()
        try:
            while True:
                for job in itertools.islice(jobs, self._processes * _AHEAD - len(waiting)):
                    waiting.append(job if isinstance(job, Outcome) else (job, self._submit(job)))
                if not waiting:
                    return
                first = waiting[0]
                if not isinstance(first, Outcome):
                    try:
                        first = first[1].result()
                    except BrokenProcessPool:
                        self._recover(waiting)
                        continue
                waiting.popleft()
                yield first
        finally:
            for pending in waiting:
                if not isinstance(pending, Outcome):
                    pending[1].cancel()

    def _submit(self, job: Job) -> Future[Outcome]:
        try:
            return self._pool.submit(self._work, job)
        except BrokenProcessPool as error:
            broken: Future[Outcome] = Future()
            broken.set_exception(error)
            return broken

    def _recover(self, waiting: deque[_Pending]) -> None:
        """Go on after the death of a process, which takes all unfinished jobs with it.

        The job to blame is among the first, those in work: each is repeated in a process of its own.
        """
        self._pool.shutdown(wait=True)
        self._pool = executor(self._processes, self._max_memory)
        suspects = self._processes
        for index, pending in enumerate(waiting):
            if isinstance(pending, Outcome) or pending[1].exception() is None:
                continue
            job = pending[0]
            waiting[index] = self._alone(job) if suspects > 0 else (job, self._submit(job))
            suspects -= 1

    def _alone(self, job: Job) -> Outcome:
        with executor(1, self._max_memory) as pool:
            try:
                return pool.submit(self._work, job).result()
            except BrokenProcessPool:
                return self._died(job)


def executor(processes: int, max_memory: float | None = None, *, anew: bool = False) -> ProcessPoolExecutor:
    """Processes that end quietly on Ctrl-C, and with the one that made them; each with so many GiB of memory at most.

    Started anew they are no copies of this process, whose libraries may have threads that copies lack.
    """
    context = multiprocessing.get_context("spawn") if anew else None
    return ProcessPoolExecutor(processes, context, initializer=_serve, initargs=(max_memory,))


def _serve(max_memory: float | None) -> None:
    """Make a worker end quietly on Ctrl-C, which reaches all processes of a terminal, and when its parent has ended."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if max_memory is not None:
        most = int(max_memory * 2**30)
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
