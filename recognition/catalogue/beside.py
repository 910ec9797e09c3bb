"""Work on recordings in several processes, or on a Ray cluster, with results in order."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from typing import NamedTuple, TypeVar

from runner.batch.pool import executor
from schemas.errors import ToolchainError

Task = TypeVar("Task")
Result = TypeVar("Result")


class Workers(NamedTuple):
    """Who works: so many processes of this machine, or a Ray cluster at an address (see `runner.batch.ray_pool`)."""

    jobs: int = 1
    ray: str | None = None


@contextmanager
def results(work: Callable[[Task], Result], tasks: Sequence[Task], workers: Workers) -> Iterator[Iterator[Result]]:
    """Around all that uses the result of each task, in their order; several processes begin at once.

    Args:
        work: does a task; a function of a module, or a `functools.partial` of one, as it goes to other processes.

    Raises:
        UsageError: Ray is not installed, or there is no such cluster.
        ToolchainError: a process died.
    """
    if workers.ray is not None:
        with closing(_on_ray(work, tasks, workers.ray, workers.jobs)) as found:
            yield found
    elif workers.jobs == 1 or not tasks:
        yield map(work, tasks)
    else:
        with executor(min(workers.jobs, len(tasks))) as pool:
            try:
                yield pool.map(work, tasks)
            except BrokenProcessPool:
                raise ToolchainError("a process died, perhaps because memory ran out; go on with fewer --jobs") from None
            finally:
                pool.shutdown(wait=True, cancel_futures=True)


def _on_ray(work: Callable[[Task], Result], tasks: Sequence[Task], address: str, jobs: int) -> Generator[Result, None, None]:
    from runner.batch.ray_pool import connect

    ray, ours = connect(address, jobs)
    try:
        remote = ray.remote(num_cpus=1)(_in_folder)
        for reference in [remote.remote(os.getcwd(), work, task) for task in tasks]:
            yield ray.get(reference)
    except ray.exceptions.RayError as error:
        raise ToolchainError(f"the Ray cluster can't go on: {error}") from None
    finally:
        if ours:
            ray.shutdown()


def _in_folder(folder: str, work: Callable[[Task], Result], task: Task) -> Result:
    """Do a task where its relative paths lead to the same files."""
    os.chdir(folder)
    return work(task)
