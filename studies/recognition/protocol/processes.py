"""Seeds of an evaluation beside each other, each in a process of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
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
        processes: that work at a time. Each computes with one thread, so that results are the same
            for any number; two processes of one thread also get half as much again done as one of
            two. Where there are more of them than seeds, rounds, kinds and methods are made beside
            each other too, once the features of all rounds of a seed are there.

    Raises:
        UsageError: a process died.
    """
    store = Store(out)
    if not pending:
        return
    seeds = [list(keys) for _, keys in groupby(pending, lambda key: key.seed)]
    with executor(processes) as pool:
        running, parts = set(), [] if processes <= len(seeds) else seeds
        for keys in seeds:
            work = partial(_prepare, keys[0].seed) if parts else partial(_run, pending=keys)
            running.add(pool.submit(work, path, out, settings))
        try:
            while running:
                done, running = wait(running, _GLANCE, FIRST_COMPLETED)
                for one in done:
                    prepared = one.result()
                    for keys in _parts(pending, prepared):
                        running.add(pool.submit(_run, path, out, settings, pending=keys))
                yield sum(map(store.has, pending))
        except BrokenProcessPool:
            raise UsageError(
                "a process of the evaluation died, perhaps because memory ran out; go on with "
                "fewer --jobs"
            ) from None
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


_ALONE = ("chain", "open-world")
"""Kinds whose methods share little: a chain is one of all rounds, and in an open
world each has models of its own
"""


def _parts(pending: Sequence[Key], seed: int | None) -> list[list[Key]]:
    """Results of a seed, in parts: the longest first, and an open world when δ, which all its
    methods share, is chosen.
    """
    found: dict[Key, list[Key]] = {}
    for key in pending:
        if key.seed == seed:
            of = key._replace(round=1) if key.kind == "chain" else key
            found.setdefault(of if key.kind in _ALONE else of._replace(method=""), []).append(key)
    kinds = ("chain", "clustering", "open-set", "sensitivity", "probe", "open-world")
    return sorted(found.values(), key=lambda keys: (kinds.index(keys[0].kind), -keys[0].round))


def _prepare(seed: int, path: Path, out: Path, settings: ProtocolSettings) -> int:
    """Make the features of all rounds of a seed; the seed."""
    with _one_thread():
        evaluation = Evaluation(path, out, settings)
        for one in evaluation.rounds(seed):
            evaluation.trial(seed, one.number)
    return seed


def _run(path: Path, out: Path, settings: ProtocolSettings, pending: Sequence[Key]) -> None:
    with _one_thread():
        for _ in Evaluation(path, out, settings).run(pending):
            pass


@contextmanager
def _one_thread() -> Iterator[None]:
    import torch
    from threadpoolctl import threadpool_limits

    torch.set_num_threads(1)
    with threadpool_limits(1):
        yield
