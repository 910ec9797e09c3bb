"""Processor time of public scenarios on this runner and on esmini, in one run on one machine.

    python -m benchmarks.players FOLDER... --esmini BINARY [--repeat N] [--timestep S]
        [--max-time S]

Every scenario below the folders is played whole by both, each in a process of its own, in turn:
kinematic, nothing but what the scenario scripts, the same fixed step, no output. The least
processor time of each counts. A step is what is left of it without loading, by the steps done;
loading is a run of one step here, and one with steps of an hour there. Files that a player refuses
or does not end are listed with the reason and left out. `--world sumo` plays ours on SUMO.
"""

from __future__ import annotations

import csv
import resource
import subprocess
import sys
import tempfile
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import runner
import xosc
from schemas.common.errors import ToolchainError

ENDS = (0, 1, 6)
"""Exit codes of `xosc-run` for a run that has ended"""
HOUR = 3600.0
LIMIT = 120.0
"""Wall-clock seconds for a process"""


class Costs(NamedTuple):
    """Processor times (s) of a file on one player: of the whole process, and of loading; and the
    steps between."""

    whole: float
    loading: float
    steps: int

    @property
    def step(self) -> float:
        """Processor time of a step, µs."""
        return max(self.whole - self.loading, 0.0) / self.steps * 1e6


class NotPlayed(Exception):
    """A player did not play a file to its end."""


def spent(command: Sequence[str], codes: Sequence[int] = (0,)) -> float:
    """Processor time (s) of a process.

    Raises:
        NotPlayed: it is still running after the limit, or ends with another exit code.
    """
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        try:
            done = subprocess.run(
                command, cwd=folder, capture_output=True, text=True, timeout=LIMIT, check=False,
                errors="replace",
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            raise NotPlayed(f"not ended after {LIMIT:g} s") from None
    if done.returncode not in codes:
        lines = [*done.stdout.splitlines(), *done.stderr.splitlines()]
        raise NotPlayed(f"exit code {done.returncode}: {lines[-1] if lines else ''}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


class Ours:
    """`xosc-run`."""

    name = "xosc-run"

    def __init__(self, path: Path, options: Namespace) -> None:
        self._path, self._options = path, options
        settings = {"sut": "none", "world": options.world, "max_time": options.max_time}
        try:
            result = runner.run(path, timestep=options.timestep, **settings)
        except ToolchainError as error:
            raise NotPlayed(str(error)) from None
        self.steps = round(result.end_time / options.timestep)

    def play(self) -> float:
        """Processor time (s) of a whole run."""
        return self._run(self._options.max_time)

    def load(self) -> float:
        """The same of a run of one step."""
        return self._run(self._options.timestep)

    def _run(self, until: float) -> float:
        command = [sys.executable, "-m", "runner.xosc_run", "--quiet", "--sut", "none"]
        command += ["--world", self._options.world, "--timestep", str(self._options.timestep)]
        return spent([*command, "--max-time", str(until), str(self._path)], ENDS)


class Esmini:
    """esmini, without a window."""

    name = "esmini"

    def __init__(self, path: Path, options: Namespace) -> None:
        self._command = [str(options.esmini), "--osc", str(path), "--headless", "--disable_log"]
        self._command += ["--disable_stdout"]
        self._timestep = options.timestep
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder) / "log.csv"
            spent([*self._steps(self._timestep), "--csv_logger", str(log)])
            self.steps = steps_of(log)

    def _steps(self, timestep: float) -> list[str]:
        return [*self._command, "--fixed_timestep", str(timestep)]

    def play(self) -> float:
        """Processor time (s) of a whole run."""
        return spent(self._steps(self._timestep))

    def load(self) -> float:
        """The same in steps of an hour."""
        return spent(self._steps(HOUR))


def steps_of(log: Path) -> int:
    """Steps of a run of esmini: rows of its CSV log that begin with a number, without the one of
    the beginning."""
    with log.open(encoding="utf-8", errors="replace", newline="") as file:
        rows = sum(row[:1] != [] and row[0].strip().isdigit() for row in csv.reader(file))
    if rows < 2:
        raise NotPlayed("no step")
    return rows - 1


def costs(players: Sequence[Ours | Esmini], repeat: int) -> list[Costs]:
    """Least costs of each of some players, which play in turn."""
    rounds = [[(each.play(), each.load()) for each in players] for _ in range(repeat)]
    return [
        Costs(*map(min, zip(*(turn[index] for turn in rounds), strict=True)), each.steps)
        for index, each in enumerate(players)
    ]


def scenarios(folders: Sequence[Path]) -> Iterator[Path]:
    """Scenario files of folders, or files themselves, in alphabetical order."""
    for folder in folders:
        for path in sorted(folder.rglob("*.xosc")) if folder.is_dir() else [folder]:
            try:
                if xosc.load(path).kind == "scenario":
                    yield path.absolute()
            except ToolchainError:
                continue


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each file, the sums, and what was left out."""
    parser = ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--esmini", required=True, type=Path, help="its binary")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--timestep", type=float, default=0.01, help="s")
    parser.add_argument("--max-time", type=float, default=300.0, help="s, of ours")
    parser.add_argument("--world", default="kinematic")
    options = parser.parse_args(arguments)
    options.esmini = options.esmini.absolute()
    played, left = [], []
    print(f"{'file':50} {'steps':>13} {'whole, s':>13} {'a step, µs':>15}  ratio")
    for path in scenarios(options.folders):
        try:
            ours, theirs = costs([Ours(path, options), Esmini(path, options)], options.repeat)
        except NotPlayed as reason:
            left.append(f"{path.name}: {reason}")
            continue
        played.append((ours, theirs))
        print(_line(path.stem, ours, theirs), flush=True)
    if played:
        total = [
            Costs(*(sum(each) for each in zip(*costs_of, strict=True)))
            for costs_of in zip(*played, strict=True)
        ]
        print(_line(f"{len(played)} files", *total))
    print(f"left out: {len(left)}", *left, sep="\n    ")


def _line(name: str, ours: Costs, theirs: Costs) -> str:
    ratio = ours.step / theirs.step if theirs.step else float("nan")
    return (
        f"{name[:50]:50} {ours.steps:6} {theirs.steps:6} {ours.whole:6.2f} {theirs.whole:6.2f}"
        f" {ours.step:7.1f} {theirs.step:7.1f} {ratio:6.2f}"
    )


if __name__ == "__main__":
    main()
