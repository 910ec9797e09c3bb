"""Worker processes that are replaced when they die."""

from __future__ import annotations

import itertools
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, suppress

from runner.batch.jobs import Job, Outcome
from schemas.common.policy import Policy, current, in_force

_AHEAD = 8
"""Runs handed out for each process ahead of need: few, so that a space of any size is never enumerated."""

_Pending = tuple[Job, "Future[Outcome]"] | Outcome


class Pool:
    """Does jobs in several processes, each job once. A context manager; the processes last as long as it does.

    Args:
        processes: how many.
        work: does a job; to be pickled, so a function of a module or a `functools.partial` of one.
        died: the outcome of a job whose process died, given that and the signal (where known) that has ended it.
        done: called here with every outcome as soon as it is there, whatever its place in the order.
    """

    def __init__(
        self,
        processes: int,
        work: Callable[[Job], Outcome],
        died: Callable[[Job, int | None], Outcome],
        done: Callable[[Outcome], None] | None = None,
    ) -> None:
        self._processes, self._work, self._died, self._done = processes, work, died, done
        self._pool = executor(processes)

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
                if isinstance(first, Outcome):
                    waiting.popleft()
                    yield first
                else:
                    self._collect(waiting)
        finally:
            self._conclude([pending[1] for pending in waiting if not isinstance(pending, Outcome)])

    def _collect(self, waiting: deque[_Pending]) -> None:
        """Wait until a job is done, and put outcomes in the place of all that are."""
        places = {pending[1]: place for place, pending in enumerate(waiting) if not isinstance(pending, Outcome)}
        faults: list[BaseException] = []
        for future in wait(places, return_when=FIRST_COMPLETED).done:
            fault = future.exception()
            if fault is None:
                waiting[places[future]] = self._ended(future.result())
            else:
                faults.append(fault)
        broken = [fault for fault in faults if isinstance(fault, BrokenProcessPool)]
        if len(broken) < len(faults):
            raise next(fault for fault in faults if fault not in broken)
        if broken:
            self._recover(waiting)

    def _ended(self, outcome: Outcome) -> Outcome:
        if self._done is not None:
            self._done(outcome)
        return outcome

    def _conclude(self, futures: list[Future[Outcome]]) -> None:
        """Cancel pending jobs, and wait for running ones: their results count."""
        wait([future for future in futures if not future.cancel()])
        with suppress(OSError):  # which is what it ends for
            for future in futures:
                if not future.cancelled() and future.exception() is None:
                    self._ended(future.result())

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
        self._pool = executor(self._processes)
        suspects = self._processes
        for index, pending in enumerate(waiting):
            if isinstance(pending, Outcome) or pending[1].exception() is None:
                continue
            job = pending[0]
            waiting[index] = self._alone(job) if suspects > 0 else (job, self._submit(job))
            suspects -= 1

    def _alone(self, job: Job) -> Outcome:
        with executor(1) as pool:
            try:
                future = pool.submit(self._work, job)
                (process,) = (pool._processes or {}).values()  # which the executor forgets, and with it how the process ended
                return self._ended(future.result())
            except BrokenProcessPool:
                process.join()
                code = process.exitcode or 0  # negative: minus the signal that ended it
                return self._ended(self._died(job, -code if code < 0 else None))


def executor(processes: int, *, anew: bool = False) -> ProcessPoolExecutor:
    """Processes that end quietly on Ctrl-C, and with the one that made them; each under the policy that is in force here.

    Started anew they are no copies of this process, whose libraries may have threads that copies lack.
    """
    context = multiprocessing.get_context("spawn") if anew else None
    return ProcessPoolExecutor(processes, context, initializer=_serve, initargs=(current(),))


def _serve(policy: Policy) -> None:
    """Make a worker end quietly on Ctrl-C, which reaches all processes of a terminal, and when its parent has ended."""
    for number in (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
        signal.signal(number, signal.SIG_DFL)
    ExitStack().enter_context(in_force(policy))  # to the end of the process
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
