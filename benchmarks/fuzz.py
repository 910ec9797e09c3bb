"""Fuzz the commands and readers: files changed by what their formats allow, and a report of all
that must not happen.

    python -m benchmarks.fuzz [FOLDER...] [--count N] [--minutes M] [--seed S] [--jobs J]
        [--only KIND] [--keep DIR]

Inputs are made from the scenarios of the library, of the conformance tests or of the folders given,
and from small recordings, maps, models and results of runs. Number and seed decide an input:
`--first 17 --count 1` repeats one. A defect is a traceback or internal error, an exit code that no
file may lead to, an error without a file, text that a terminal or CI service would obey, more
processor time or memory than allowed, a file written outside of the output folder, and a green
answer for a scenario that the check refuses. With `--keep` the files of each input with a defect
are copied, for tests/security/corpus.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from queue import Queue

from tests.fuzz.pool import LARGEST, LONGEST, Limits, Result, run
from tests.mutation import sources


def main() -> None:
    """Run, print, and exit with 1 where something happened that must not."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("folders", nargs="*", type=Path, help="scenario files to begin with")
    arguments.add_argument("--count", type=int, default=1000, help="inputs")
    arguments.add_argument("--minutes", type=float, default=0.0, help="end after that time, too")
    arguments.add_argument(
        "--first", type=int, default=0, help="number of the first input, to repeat one"
    )
    arguments.add_argument("--seed", type=int, default=0)
    arguments.add_argument("--jobs", type=int, default=2, help="processes")
    arguments.add_argument(
        "--only",
        default="",
        help="beginning of the names of kinds: check, 'export carla', recordings, …",
    )
    arguments.add_argument(
        "--limit", type=float, default=LONGEST, help="processor time that an input may take, s"
    )
    arguments.add_argument(
        "--memory", type=float, default=LARGEST, help="memory that an input may take, MiB"
    )
    arguments.add_argument("--keep", type=Path, help="folder for the files of inputs with defects")
    arguments.add_argument("--verbose", action="store_true", help="print every input")
    options = arguments.parse_args()
    os.environ.update(
        dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    )  # servers fork: they start no threads
    start = time.monotonic()
    results = _run(options)
    print(f"{len(results)} inputs, seed {options.seed}, in {time.monotonic() - start:.0f} s")
    raise SystemExit(_report(results))


def _run(options: argparse.Namespace) -> list[Result]:
    queue: Queue[Result | None] = Queue()
    end = time.monotonic() + 60.0 * options.minutes if options.minutes else float("inf")
    found = sources(options.folders) if options.folders else None

    def follow(share: range, folder: Path) -> None:
        limits = Limits(options.limit, options.memory)
        for result in run(found, options.seed, share, folder, options.only, limits, options.keep):
            queue.put(result)
            if time.monotonic() > end:
                break
        queue.put(None)

    results, open_jobs = list[Result](), options.jobs
    memory = "/dev/shm" if Path("/dev/shm").is_dir() else None  # inputs are many small files
    with tempfile.TemporaryDirectory(dir=memory, ignore_cleanup_errors=True) as scratch:
        for job in range(options.jobs):
            folder = Path(scratch) / str(job)
            folder.mkdir()
            numbers = range(options.first, options.first + options.count)[job :: options.jobs]
            threading.Thread(target=follow, args=(numbers, folder), daemon=True).start()
        while open_jobs:
            result = queue.get()
            if result is None:
                open_jobs -= 1
                continue
            results.append(result)
            if options.verbose or result.defect:
                _show(result)
            if len(results) % 1000 == 0:
                print(
                    f"… {len(results)} inputs, "
                    f"{sum(bool(each.defect) for each in results)} defects",
                    flush=True,
                )
    return sorted(results)


def _show(result: Result) -> None:
    print(f"{result.number} {result.kind} {result.source} [{'; '.join(result.changes)[:300]}]")
    print(f"    {result.code}: {result.defect or 'as it should be'}", flush=True)
    if result.message:
        print(f"    {result.message[-200:]!a}", flush=True)


def _report(results: Sequence[Result]) -> int:
    defects = Counter(result.kind for result in results if result.defect)
    codes: dict[str, Counter[int]] = {}
    for result in results:
        codes.setdefault(result.kind, Counter())[result.code] += 1
    print(f"{'kind':24}{'inputs':>8}{'defects':>9}{'processor':>12}   exit codes")
    for kind, counts in sorted(codes.items()):
        seconds = sum(result.seconds for result in results if result.kind == kind)
        answers = ", ".join(f"{code}: {count}" for code, count in sorted(counts.items()))
        print(
            f"{kind or '(died or hung)':24}{counts.total():8}{defects[kind]:9}"
            f"{seconds:10.0f} s   {answers}"
        )
    print(f"{len(results)} inputs, {defects.total()} defects")
    slowest, largest = max(results, key=lambda r: r.seconds), max(results, key=lambda r: r.growth)
    print(
        f"slowest: {slowest.seconds:.1f} s, {slowest.number} {slowest.kind} {slowest.source} "
        f"{'; '.join(slowest.changes)[:200]}"
    )
    print(
        f"largest: {largest.growth:.0f} MiB, {largest.number} {largest.kind} {largest.source} "
        f"{'; '.join(largest.changes)[:200]}"
    )
    return 1 if defects else 0


if __name__ == "__main__":
    main()
