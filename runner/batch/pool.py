"""Work in other processes, on this machine or on a Ray cluster: all ways that the toolchain has.

- `Pool`, `RayPool`: jobs without an end, each with its outcome; workers that die are replaced.
- `results`: a list of tasks, and their results in order.
- `executor`, `dismiss`: the processes of both, also for modules that keep some of their own.

Every machine of the cluster needs this package (and the systems under test) installed, and the
scenarios and the output folder under the same paths, on file systems that they share. Ray is an
extra: it is imported only here.
"""

from __future__ import annotations

import gc
import itertools
import logging
import multiprocessing
import os
import signal
import socket
import sys
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, chdir, closing, contextmanager, suppress
from functools import partial
from multiprocessing.process import BaseProcess
from typing import Any, NamedTuple, TypeVar

from runner.batch.jobs import Job, Outcome
from schemas.common.errors import ToolchainError, UsageError
from schemas.common.packages import optional
from schemas.common.policy import CommandPolicy, current, in_force

Task = TypeVar("Task")
Result = TypeVar("Result")
_AHEAD = 8
"""Runs handed out for each process ahead of need: few, so that a space of any
size is never enumerated.
"""

_ENDING = 3.0
"""Time (s) that running jobs have to end when no more outcomes are wanted"""

_Pending = tuple[Job, "Future[Outcome]"] | Outcome


class Pool:
    """Does jobs in several processes, each job once. A context manager; the
    processes last as long as it does.

    Args:
        processes: how many.
        work: does a job; to be pickled, so a function of a module or a `functools.partial` of one.
        died: the outcome of a job whose process died, given that and the signal (where known) that
            has ended it.
        done: called here with every outcome as soon as it is there, whatever its place in the
            order.
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
        """Outcomes in the order of the jobs; what is an outcome already passes
        through. For one caller at a time.
        """
        waiting: deque[_Pending] = deque()
        try:
            while True:
                # Only as many as are waited for are taken: `jobs` may have no end.
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
        places = {
            pending[1]: place
            for place, pending in enumerate(waiting)
            if not isinstance(pending, Outcome)
        }
        faults: list[BaseException] = []
        for future in wait(places, return_when=FIRST_COMPLETED).done:
            fault = future.exception()
            # Outcomes first: those that are there count, whatever has failed beside them.
            if fault is None:
                waiting[places[future]] = self._ended(future.result())
            else:
                faults.append(fault)
        # An error of the work itself, as a full disk, is the batch's and not one of its process.
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
        """Cancel pending jobs, and wait a little for running ones: their results count.

        The executor's own thread cancels: it fails with a traceback where another one does and the
        processes have died, as by Ctrl-C.
        """
        if not futures:
            return
        # The pool stays usable: another `execute` may follow.
        ended, self._pool = self._pool, executor(self._processes)
        dismiss(ended)
        with suppress(OSError):  # which is what it ends for
            for future in futures:
                if not future.cancelled() and future.exception() is None:
                    self._ended(future.result())

    def _submit(self, job: Job) -> Future[Outcome]:
        try:
            return self._pool.submit(self._work, job)
        except BrokenProcessPool as error:
            # A pool that broke between two jobs fails as its running jobs do: `_recover` is for
            # all.
            broken: Future[Outcome] = Future()
            broken.set_exception(error)
            return broken

    def _recover(self, waiting: deque[_Pending]) -> None:
        """Continue after the death of a process; all unfinished jobs are lost with it.

        The job to blame is among the first, those in work: each is repeated in a process of its
        own.
        """
        self._pool.shutdown(wait=True)
        self._pool = executor(self._processes)
        # The executor names no culprit; at most so many jobs were in work, the first ones.
        suspects = self._processes
        for index, pending in enumerate(waiting):
            if isinstance(pending, Outcome) or pending[1].exception() is None:
                continue
            job = pending[0]
            waiting[index] = self._alone(job) if suspects > 0 else (job, self._submit(job))
            suspects -= 1

    def _alone(self, job: Job) -> Outcome:
        # A process of its own shows how it ends: a shared pool names no culprit.
        with executor(1) as pool:
            try:
                future = pool.submit(self._work, job)
                (process,) = (
                    pool._processes or {}
                ).values()  # which the executor forgets, and with it how the process ended
                return self._ended(future.result())
            except BrokenProcessPool:
                process.join()
                code = process.exitcode or 0  # negative: minus the signal that ended it
                return self._ended(self._died(job, -code if code < 0 else None))


class Workers(NamedTuple):
    """Workers: a number of processes on this machine, or a Ray cluster at an address."""

    jobs: int = 1
    ray: str | None = None


@contextmanager
def results(
    work: Callable[[Task], Result], tasks: Sequence[Task], workers: Workers
) -> Iterator[Iterator[Result]]:
    """Context manager that yields the result of each task, in their order; several processes begin
    at once.

    Args:
        work: does a task; a function of a module, or a `functools.partial` of one, as it goes to
            other processes.

    Raises:
        UsageError: Ray is not installed, or there is no such cluster.
        ToolchainError: a process died.
    """
    if workers.ray is not None:
        # Closed even if the caller stops early, so that the cluster is left.
        with closing(_on_ray(work, tasks, workers.ray, workers.jobs)) as found:
            yield found
    elif workers.jobs == 1 or not tasks:
        yield map(work, tasks)
    else:
        # A process without a task would only cost its imports.
        pool = executor(min(workers.jobs, len(tasks)))
        try:
            yield pool.map(work, tasks)
        # A worker killed by the kernel leaves no message of its own; memory is the usual reason.
        except BrokenProcessPool:
            raise ToolchainError(
                "a process died, perhaps because memory ran out; go on with fewer --jobs"
            ) from None
        finally:
            dismiss(pool)


def _on_ray(
    work: Callable[[Task], Result], tasks: Sequence[Task], address: str, jobs: int
) -> Generator[Result, None, None]:
    ray, ours = connect(address, jobs)
    try:
        # One processor each: the cluster decides how many run at a time.
        remote = ray.remote(num_cpus=1)(_work)
        # All are submitted before the first result is waited for; results come in the order of
        # tasks, so that outputs have the same bytes for any number of workers.
        for reference in [remote.remote(work, os.getcwd(), current(), task) for task in tasks]:
            yield ray.get(reference)
    except ray.exceptions.RayError as error:
        raise ToolchainError(f"the Ray cluster can't go on: {error}") from None
    finally:
        if ours:
            ray.shutdown()


def dismiss(pool: ProcessPoolExecutor) -> None:
    """End processes, with a few seconds for jobs that are in work; the others are cancelled."""
    # Before the shutdown, which forgets them.
    workers = [*(pool._processes or {}).values()]
    ended = threading.Event()

    def terminate() -> None:
        for end in (BaseProcess.terminate, BaseProcess.kill):  # one that begins may miss the first
            # Running jobs may end by themselves; a hanging one must not hold the command.
            if ended.wait(_ENDING):
                return
            for worker in workers:
                with suppress(OSError):
                    end(worker)

    threading.Thread(target=terminate, daemon=True).start()
    try:
        pool.shutdown(wait=True, cancel_futures=True)
    finally:
        ended.set()


def executor(processes: int, *, anew: bool = False) -> ProcessPoolExecutor:
    """Processes that end quietly on Ctrl-C, and with the one that made them;
    each under the policy that is in force here.

    Started anew they are no copies of this process, whose libraries may have threads that copies
    lack; processes of their own are started as those of this one are.
    """
    context = multiprocessing.get_context("spawn") if anew else None
    start = multiprocessing.get_start_method()
    return ProcessPoolExecutor(
        processes, context, initializer=begin_worker, initargs=(current(), start)
    )


def begin_worker(policy: CommandPolicy, start: str) -> None:
    """Make a worker end quietly on Ctrl-C and after its parent; Ctrl-C reaches all processes of a
    terminal.

    Its own start method is not inherited: "spawn" leaves named semaphores where a worker is killed.
    """
    # What the parent left to its collector may hold locks of threads that a fork has not: Ray's
    # connection would wait for one for ever.
    gc.freeze()
    multiprocessing.set_start_method(start, force=True)
    # A fork inherits the parent's handlers, which save the batch; workers have nothing to save.
    for number in (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
        signal.signal(number, signal.SIG_DFL)
    ExitStack().enter_context(in_force(policy))  # to the end of the process
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    # No clean-up: the parent was killed, and what it left is repaired by --resume.
    parent.join()
    os._exit(1)


LOCAL = "local"
_AHEAD_ON_CLUSTER = 2
"""Runs handed out for each processor of the cluster"""
_REPEATS = 2
"""Number of repetitions of a run whose process or machine has died"""
_LEAVING = 60.0
"""Time (s) for running jobs to end after cancellation"""
_LISTENING = 5.0
"""Time (s) that a cluster has to answer"""
_STORE = 100_000_000
"""Shared memory of a cluster of our own, bytes; outcomes are small"""


class RayPool:
    """Does jobs as tasks of a Ray cluster, each job once, again where its
    process died. A context manager.

    A program that is connected to a cluster already goes on with that.

    Args:
        address: of a cluster (`HOST:PORT`, `ray://…`, `auto`), or `local` for one of our own on
            this machine.
        processes: how many jobs at a time `local` does; elsewhere the cluster's processors decide.
        work: does a job, in a worker; an OSError of it is raised here.
        died: the outcome of a job whose process died every time.
        done: called here with every outcome that work returns, as soon as it is there.

    Raises:
        UsageError: Ray is not installed, or there is no such cluster.
        ToolchainError: one of our own does not start.
    """

    def __init__(
        self,
        address: str,
        processes: int,
        work: Callable[[Job], Outcome],
        died: Callable[[Job, int | None], Outcome],
        done: Callable[[Outcome], None] | None = None,
    ) -> None:
        self._died, self._done = died, done
        self._ray, self._ours = connect(address, processes)
        self._task = self._ray.remote(num_cpus=1, max_retries=_REPEATS)(_work).options(
            name="xosc-run"
        )
        # Put once: as an argument the settings would go with every task.
        self._shared = self._ray.put(work)
        # Two for each processor: the next one waits there while a result travels.
        self._most = _AHEAD_ON_CLUSTER * max(1, int(self._ray.cluster_resources().get("CPU", 1)))

    def __enter__(self) -> RayPool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the cluster; one of our own ends."""
        if self._ours:
            self._ray.shutdown()

    def execute(self, jobs: Iterator[Job | Outcome]) -> Iterator[Outcome]:
        """Outcomes in the order of the jobs; what is an outcome already passes through."""
        order: deque[Any] = deque()  # outcomes, and references to those that are awaited
        awaited: dict[Any, Job] = {}
        arrived: dict[Any, Outcome] = {}
        try:
            while True:
                for job in itertools.islice(jobs, self._most - len(order)):
                    order.append(job if isinstance(job, Outcome) else self._submit(job, awaited))
                if not order:
                    return
                if not isinstance(order[0], Outcome) and order[0] not in arrived:
                    ready, _ = self._ray.wait(list(awaited), num_returns=1)
                    for reference in ready:
                        arrived[reference] = self._outcome(reference, awaited.pop(reference))
                    continue
                first = order.popleft()
                yield first if isinstance(first, Outcome) else arrived.pop(first)
        finally:
            if awaited:
                self._abandon(awaited)

    def _submit(self, job: Job, awaited: dict[Any, Job]) -> Any:
        reference = self._task.remote(self._shared, os.getcwd(), current(), job)
        awaited[reference] = job
        return reference

    def _outcome(self, reference: Any, job: Job) -> Outcome:
        errors = self._ray.exceptions
        try:
            outcome: Outcome = self._ray.get(reference)
        except OSError as error:  # of the work, in a wrapping of Ray's
            raise getattr(error, "cause", error) from None
        except (errors.WorkerCrashedError, errors.NodeDiedError, errors.OutOfMemoryError):
            outcome = self._died(job, None)
        except errors.RayError as error:
            raise ToolchainError(f"the Ray cluster can't go on: {error}") from None
        if self._done is not None:
            self._done(outcome)
        return outcome

    def _abandon(self, awaited: dict[Any, Job]) -> None:
        """Keep finished outcomes, and cancel waiting and running jobs."""
        wait = partial(self._ray.wait, num_returns=len(awaited))
        finished, others = wait(list(awaited), timeout=0)
        for reference in others:
            self._ray.cancel(reference)
        with suppress(ToolchainError, OSError):  # the cluster is what we leave it for
            for reference in finished:
                self._outcome(reference, awaited[reference])
        wait(list(awaited), timeout=_LEAVING)


def _work(work: Callable[[Task], Result], folder: str, policy: CommandPolicy, task: Task) -> Result:
    """Do a task in its own folder and under its own policy."""
    os.chdir(folder)
    with in_force(policy):
        return work(task)


def connect(address: str, processes: int) -> tuple[Any, bool]:
    """The module ray, connected to a cluster, and whether that is our own doing.

    Args:
        address, processes: as of `RayPool`.

    Raises:
        UsageError, ToolchainError: as by `RayPool`.
    """
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # it would tell its makers
    ray = optional("ray")
    if ray.is_initialized():
        return ray, False
    own: dict[str, Any] = (
        {"num_cpus": processes, "object_store_memory": _STORE} if address == LOCAL else {}
    )
    try:
        # Before Ray, which tries for minutes.
        _reach(address)
        with chdir(sys.prefix):  # Ray lets its workers import from the folder that it is started in
            ray.init(
                address=address,
                include_dashboard=False,
                log_to_driver=False,
                logging_level=logging.ERROR,
                **own,
            )
    except Exception as error:  # Ray raises whatever there is
        reason = " ".join(str(error).split())[:200]
        if own:
            raise ToolchainError(f"Ray does not start on this machine: {reason}") from None
        raise UsageError(f"there is no Ray cluster at {address!r}: {reason}") from None
    return ray, True


def _reach(address: str) -> None:
    """Check that a server listens at an address; Ray itself would try for minutes."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if host and port.isdecimal():
        socket.create_connection((host, int(port)), _LISTENING).close()
