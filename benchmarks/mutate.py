"""Run mutated scenario files as the command line would, and count how they end.

    python benchmarks/mutate.py [FOLDER...] [--count N] [--seed S] [--jobs N] [--verbose]

The files are those of the library, of the conformance tests, and of any folder given. Every second mutant runs in SUMO, the
others in the kinematic world. Printed are counts by exit code, and everything that must not happen: internal errors
(exit code 5), errors that blame the call (2) though only the file is bad or that name no file, hangs, results that are not
finite, invalid files that run without a remark, and files written outside the output folder.
"""

from __future__ import annotations

import argparse
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from queue import Queue

from tests.guarded import LONGEST, Result, run_mutants
from tests.mutation import OWN_SCENARIOS, Source, sources

_MEANING = {0: "passed", 1: "verdict is a failure", 2: "wrong usage", 3: "invalid file", 4: "not supported", 5: "internal error"}


def main() -> None:
    """Run, print, and exit with 1 where something happened that must not."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("folders", nargs="*", type=Path, help="more scenario files")
    arguments.add_argument("--count", type=int, default=1000)
    arguments.add_argument("--first", type=int, default=0, help="number of the first mutant, to repeat one")
    arguments.add_argument("--seed", type=int, default=0)
    arguments.add_argument("--jobs", type=int, default=2, help="processes")
    arguments.add_argument("--verbose", action="store_true", help="print every mutant and the tracebacks")
    options = arguments.parse_args()
    found = sources(options.folders or OWN_SCENARIOS)
    start = time.monotonic()
    results = _run(found, options.seed, range(options.first, options.first + options.count), options.jobs, options.verbose)
    print(f"{len(results)} mutants of {len(found)} files, seed {options.seed}, in {time.monotonic() - start:.0f} s")
    raise SystemExit(_report(results, options.jobs))


def _run(found: Sequence[Source], seed: int, numbers: range, jobs: int, verbose: bool) -> list[Result]:
    queue: Queue[Result | None] = Queue()

    def follow(share: range, folder: Path) -> None:
        for result in run_mutants(found, seed, share, folder):
            queue.put(result)
        queue.put(None)

    results, open_jobs = [], jobs
    with tempfile.TemporaryDirectory() as scratch:
        for job in range(jobs):
            folder = Path(scratch) / str(job)
            folder.mkdir()
            threading.Thread(target=follow, args=(numbers[job::jobs], folder), daemon=True).start()
        while open_jobs:
            result = queue.get()
            if result is None:
                open_jobs -= 1
                continue
            results.append(result)
            if verbose or result.is_defect:
                _show(result, verbose)
    return sorted(results)


def _show(result: Result, verbose: bool) -> None:
    print(f"{result.number} {result.source.name} {result.world} [{'; '.join(result.changes)}]")
    print(f"    {result.code}: {result.message[:300]}", *result.stray, flush=True)
    if verbose and result.code == 5:
        print(result.trace)


def _report(results: Sequence[Result], jobs: int) -> int:
    for code, count in sorted(Counter(result.code for result in results).items()):
        print(f"{count:>8}  {code} {_MEANING[code]}")
    defects = [result for result in results if result.is_defect]
    slow = f"over {LONGEST:g} s of processor time"
    print(f"{len(defects):>8}  defects: internal errors, wrong exit codes, errors without a file, {slow}, stray files")
    slowest, largest = max(results, key=lambda r: r.seconds), max(results, key=lambda r: r.growth)
    print(f"slowest {slowest.seconds:.1f} s: {slowest.number} {slowest.source.name} {'; '.join(slowest.changes)}")
    print(f"peak memory grew most, by {largest.growth:.0f} MiB, in {largest.number} {largest.source.name}")
    print(f"peak memory of a process grew by {sum(result.growth for result in results) / jobs:.0f} MiB over all its mutants")
    return 1 if defects else 0


if __name__ == "__main__":
    main()
