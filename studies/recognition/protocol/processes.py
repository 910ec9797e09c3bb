"""Seeds of an evaluation beside each other, each in a process of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_EXCEPTION, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import groupby
from pathlib import Path

from runner.batch.pool import executor
from schemas.common.errors import UsageError
from studies.recognition.protocol.evaluation import Evaluation, ProtocolSettings
from studies.recognition.protocol.store import Key, Store

_GLANCE = 1.0
"""Seconds from one look at what is there to the next."""


def run_beside(
    path: Path, out: Path, settings: ProtocolSettings, pending: Sequence[Key], processes: int
) -> Iterator[int]:
    """Make results of an evaluation; say again and again how many of them are there.

    Args:
        path, out, settings: of the evaluation, see `Evaluation`.
        pending: the results, seed by seed.
        processes: seeds that are worked on at a time. Each process computes with one thread, so
            that results are the same for any number; two processes of one thread also get half as
            much again done as one of two.

    Raises:
        UsageError: a process died.
    """
    store = Store(out)
    with executor(processes) as pool:
        running = {
            pool.submit(_run, path, out, settings, list(keys))
            for _, keys in groupby(pending, lambda key: key.seed)
        }
        try:
            while running:
                done, running = wait(running, _GLANCE, FIRST_EXCEPTION)
                for one in done:
                    one.result()
                yield sum(map(store.has, pending))
        except BrokenProcessPool:
            raise UsageError(
                "a process of the evaluation died, perhaps because memory ran out; go on with fewer --jobs"
            ) from None
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _run(path: Path, out: Path, settings: ProtocolSettings, pending: Sequence[Key]) -> None:
    import torch
    from threadpoolctl import threadpool_limits

    torch.set_num_threads(1)
    with threadpool_limits(1):
        for _ in Evaluation(path, out, settings).run(pending):
            pass
