"""Number of recorded runs of esmini that this runner repeats: the table of docs/parity.md, a line
per set.

    python benchmarks/parity.py REFERENCE CORPORA... [--set alks] [--differ]

REFERENCE holds NAME.runs.csv (run, file, permutation, end, end_time; files relative to one of the
CORPORA) and NAME.parquet (run, time, entity, x, y) of each set. Runs are those of
`tests/test_parity.py`, all of them: a fixed step of 0.01 s, nothing but what the scenario scripts,
constraint groups not enforced. A run is equal when all entities are within 0.25 m of where the
reference has it at every sample, and the ends are at most 0.25 s apart; the end of a run that was
cut is not judged.
"""

from __future__ import annotations

import csv
import math
from argparse import ArgumentParser
from collections import Counter
from itertools import islice
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

import runner
import xosc
from runner.judging.settings import RunSettings
from schemas.common.errors import ToolchainError

METRES, SECONDS = 0.25, 0.25
SETTINGS = RunSettings(timestep=0.01, sut="none", enforce_constraints=False)
LONGER = 20.0
"""s that a run may go on after the reference has ended."""


def answer(row: dict[str, str], recorded: pa.Table, corpora: list[Path]) -> tuple[str, float]:
    """Whether a run is `equal`, `differs` or has `failed`, and the greatest distance (m)."""
    path, parameters = (
        next(
            (each / row["file"] for each in corpora if (each / row["file"]).exists()),
            Path(row["file"]),
        ),
        {},
    )
    cut, end = row["end"] != "end", float(row["end_time"])
    try:
        if row["permutation"]:
            path, parameters = next(
                islice(
                    xosc.variations(path, enforce_constraints=False), int(row["permutation"]), None
                )
            )
        result = runner.run(
            path, SETTINGS, parameters=parameters, max_time=end if cut else end + LONGER
        )
    except ToolchainError as error:
        print(f"    {error}")
        return "failed", math.inf
    furthest = max(
        _furthest(recorded, result, name) for name in pc.unique(recorded["entity"]).to_pylist()
    )
    in_time = cut or abs(result.end_time - end) <= SECONDS
    return ("equal" if furthest <= METRES and in_time else "differs"), furthest


def _furthest(recorded: pa.Table, result: runner.RunResult, name: str) -> float:
    """The greatest distance (m) of a participant from its place in the reference, as long as both
    are there."""
    there = recorded.filter(pc.equal(recorded["entity"], name))
    if name not in result.recording.tracks:
        return math.inf
    track, times = result.recording.tracks[name].columns, there["time"].to_numpy()
    both = (times >= track["time"][0] - 1e-6) & (times <= track["time"][-1] + 1e-6)
    x, y = (
        np.interp(times, track["time"], track[axis]) - there[axis].to_numpy() for axis in ("x", "y")
    )
    return float(np.hypot(x, y)[both].max()) if both.any() else math.inf


def main() -> None:
    """Entry point."""
    parser = ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("reference", type=Path)
    parser.add_argument("corpora", type=Path, nargs="+")
    parser.add_argument(
        "--set", action="append", dest="sets", help="repeatable; all sets of the folder without it"
    )
    parser.add_argument("--differ", action="store_true", help="name the runs that differ")
    arguments = parser.parse_args()
    sets = arguments.sets or sorted(
        path.name.removesuffix(".runs.csv") for path in arguments.reference.glob("*.runs.csv")
    )
    for name in sets:
        table, count = pq.read_table(arguments.reference / f"{name}.parquet"), Counter[str]()
        with (arguments.reference / f"{name}.runs.csv").open(newline="") as lines:
            rows = [row for row in csv.DictReader(lines) if row["end_time"]]
        for row in rows:
            state, distance = answer(
                row, table.filter(pc.equal(table["run"], int(row["run"]))), arguments.corpora
            )
            count[state] += 1
            if arguments.differ and state == "differs":
                print(f"    {distance:.3g} m: {row['file']} {row['permutation']}")
        print(
            f"{name:20}{len(rows):4} runs, {count['equal']:4} equal, {count['differs']:3} differ, "
            f"{count['failed']:3} failed"
        )


if __name__ == "__main__":
    main()
