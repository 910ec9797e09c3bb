"""Rate of scenario mutants that pass though nothing can pass them (tests/oracles/mutants.py).

    python -m benchmarks.mutants [--count 1000] [--seed 0] [--version CHECKOUT] [--keep DIR]

Mutants are played by xosc-run of a checkout, by default of this one. Each mutant with exit code 0
is printed with its mutations and options, and copied to `--keep`. Exit code 1 if there is one.
"""

from __future__ import annotations

import tempfile
from argparse import ArgumentParser
from collections import Counter
from pathlib import Path
from shutil import copytree

from benchmarks.corpora_diff import ROOT, call_each
from tests.oracles.mutants import MUTATIONS, mutants

WRONG = (0, 5, -9, "timeout")
"""Exit codes that no mutant may have: passed, internal error, killed, hang"""


def main() -> None:
    """Entry point."""
    parser = ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--version", type=Path, default=ROOT)
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="mutants_") as scratch:
        drawn = list(mutants(options.seed, options.count, Path(scratch)))
        calls = [(str(mutant.path), *mutant.options) for mutant in drawn]
        answers = call_each(options.version.resolve(), calls, Path(scratch) / "player", 60.0)
        codes = Counter(str(answer.code) for answer in answers)
        counts: Counter[str] = Counter()
        for mutant, answer in zip(drawn, answers, strict=True):
            if answer.code not in WRONG:
                continue
            counts.update(mutant.mutations)
            folder = mutant.path.parent
            print(f"{answer.code}: {mutant.path.name} {' + '.join(mutant.mutations)}")
            print(f"    xosc-run {folder.name}/{mutant.path.name} {' '.join(mutant.options)}")
            print(f"    {answer.text.strip()[-300:]}")
            if options.keep:
                copytree(folder, options.keep / folder.name, dirs_exist_ok=True)
    for name in MUTATIONS:
        if counts[name]:
            print(f"{name}: {counts[name]}")
    green = codes["0"]
    ordered = ", ".join(f"{code}: {number}" for code, number in sorted(codes.items()))
    print(f"{len(drawn)} mutants, seed {options.seed}: exit codes {ordered}; {green} green")
    raise SystemExit(1 if counts else 0)


if __name__ == "__main__":
    main()
