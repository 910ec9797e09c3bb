"""Play a folder of foreign files with two versions; list each changed verdict, remark and place.

    python -m benchmarks.corpora_diff OLD NEW FOLDER... [--sut NAME] [--world NAME] [--json FILE]

OLD and NEW are git revisions of this repository, or folders with a checkout. Both versions run in
this Python environment, from their own folders. Files are the scenarios and variation files below
the folders, those of equal content once, in alphabetical order. Of a variation file `--sample`
parameter sets are drawn. Runs of both versions are matched by their parameters.

The table has one line for each change:

    exit      exit code of the file, with the error where there is one
    verdict   of a run, with its reasons
    remark    that only the old (-) or only the new version (+) has
    place     largest distance (m) of an entity, with its time; entities that only one version has
    end       end time (s) of a run

`--json` writes the same as data, with every run. Exit code: 0 equal, 1 changed, 2 wrong usage.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from lxml import etree

ROOT = Path(__file__).parents[1]
PLAYER = Path(__file__).with_name("player.py")
KINDS = ("exit", "verdict", "remark", "place", "end")
SAME_TIME = 1e-6
"""Seconds by which equal times may differ"""


@dataclass(frozen=True)
class Run:
    """Result of one run: its folder, verdict, reasons, remarks and end time (s)."""

    folder: Path
    verdict: str
    reasons: tuple[str, ...]
    remarks: tuple[str, ...]
    end: float


@dataclass(frozen=True)
class Answer:
    """Exit code of a call (`timeout` where it was killed) and the printed text."""

    code: int | str
    text: str


@dataclass(frozen=True)
class Played:
    """Result of a version for a file: exit code, printed text and runs by their parameters."""

    code: int | str
    text: str
    runs: Mapping[str, Run]


@dataclass(frozen=True, order=True)
class Change:
    """A difference between both versions: of a file, one of its runs, of a kind, in words."""

    file: str
    run: str
    kind: str
    text: str
    metres: float = field(default=0.0, compare=False)


# files and versions ------------------------------------------------------------------------------


def scenarios(folders: Sequence[Path]) -> list[Path]:
    """Return scenarios and variation files below folders, equal ones once, without catalogues."""
    contents: set[bytes] = set()
    chosen: list[Path] = []
    for folder in folders:
        for path in [folder] if folder.is_file() else sorted(folder.rglob("*.xosc")):
            if not path.is_file():
                continue
            content = path.read_bytes()
            if content not in contents and not _is_catalogue(content):
                chosen.append(path.resolve())
            contents.add(content)
    return chosen


def _is_catalogue(content: bytes) -> bool:
    """Whether a file is a catalogue; a file that is no XML is played, to compare its error."""
    try:
        return etree.fromstring(content).find("Catalog") is not None
    except etree.XMLSyntaxError:
        return False


def checkout(version: str, scratch: Path, stack: ExitStack) -> Path:
    """Return the folder of a version: itself, or a worktree of a revision until the stack ends."""
    folder = Path(version)
    if (folder / "runner").is_dir():
        return folder.resolve()
    git = ["git", "-C", str(ROOT)]
    made = [*git, "worktree", "add", "--quiet", "--detach", str(scratch), version]
    answer = subprocess.run(made, capture_output=True, text=True)
    if answer.returncode:
        raise SystemExit(f"{version}: neither a checkout nor a revision: {answer.stderr.strip()}")
    removed = [*git, "worktree", "remove", "--force", str(scratch)]
    stack.callback(lambda: subprocess.run(removed, check=False))
    return scratch


# playing -----------------------------------------------------------------------------------------


def play(
    version: Path, files: Sequence[Path], out: Path, options: Sequence[str], seconds: float
) -> dict[Path, Played]:
    """Play files with a version, in one process, and read what it wrote.

    Args:
        version: folder of a checkout.
        files: scenarios and variation files.
        out: new folder for results.
        options: of xosc-run.
        seconds: wall-clock limit for each file.
    """
    folders = {path: out / str(number) for number, path in enumerate(files)}
    calls = [(str(path), "--out", str(folder), *options) for path, folder in folders.items()]
    places = (str(version), str(out))
    answers = call_each(version, calls, out, seconds)
    return {
        path: Played(answer.code, _without(answer.text, places), read_runs(folders[path], places))
        for path, answer in zip(files, answers, strict=True)
    }


def call_each(
    version: Path, calls: Sequence[Sequence[str]], scratch: Path, seconds: float
) -> list[Answer]:
    """Call xosc-run of a version for each list of arguments, in forks of one process.

    Args:
        version: folder of a checkout.
        calls: arguments of each call.
        scratch: new folder, the working folder of the process.
        seconds: wall-clock limit for each call.

    Raises:
        SystemExit: the process ended early.
    """
    scratch.mkdir(parents=True)
    order = scratch / "order.json"
    order.write_text(json.dumps({"calls": [*calls], "seconds": seconds}))
    environment = {
        **os.environ,
        "PYTHONPATH": str(version),
        "PYTHONDONTWRITEBYTECODE": "1",
        "XOSC_CACHE_DIR": str(scratch / "cache"),  # roads of another version are not reused
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    command = [sys.executable, "-P", str(PLAYER), str(order)]
    told = subprocess.run(command, env=environment, cwd=scratch, stdout=subprocess.PIPE, text=True)
    if told.returncode:
        raise SystemExit(f"{version}: the player ended with exit code {told.returncode}")
    return [Answer(**json.loads(line)) for line in told.stdout.splitlines()]


def _without(text: str, places: Sequence[str]) -> str:
    """Return a text without the folders of a version, which differ always."""
    for place in places:
        text = text.replace(f"{place}/", "").replace(place, "")
    return text


def read_runs(folder: Path, places: Sequence[str] = ()) -> dict[str, Run]:
    """Return the runs below a folder of results, by their parameters and a counter."""
    runs: dict[str, Run] = {}
    counted: Counter[str] = Counter()
    for path in sorted(folder.rglob("result.json")):
        told = json.loads(path.read_text(encoding="utf-8"))
        name = json.dumps(told.get("parameters", {}), sort_keys=True)
        counted[name] += 1
        key = name if counted[name] == 1 else f"{name} ({counted[name]})"
        runs[key] = Run(
            path.parent,
            str(told.get("verdict", told.get("status"))),
            tuple(_without(text, places) for text in told.get("reasons", ())),
            tuple(_without(text, places) for text in told.get("remarks", ())),
            float(told.get("end_time") or 0.0),
        )
    return runs


# comparing ---------------------------------------------------------------------------------------


def changes(file: str, old: Played, new: Played, tolerance: float) -> Iterator[Change]:
    """Yield every difference of a file between two versions.

    Args:
        file: its name in the answer.
        old: what the old version made of it.
        new: what the new version made of it.
        tolerance: distance (m) above which a place counts as changed.
    """
    if old.code != new.code:
        text = f"{old.code} → {new.code}: {_last_line(old)} → {_last_line(new)}"
        yield Change(file, "", "exit", text)
    elif old.code not in (0, 1, 6) and _last_line(old) != _last_line(new):
        yield Change(file, "", "exit", f"{old.code}: {_last_line(old)} → {_last_line(new)}")
    for name in sorted({*old.runs, *new.runs}):
        before, after = old.runs.get(name), new.runs.get(name)
        if before is None or after is None:
            text = (
                f"{before.verdict if before else 'no run'} → {after.verdict if after else 'no run'}"
            )
            yield Change(file, name, "verdict", text)
            continue
        yield from _run_changes(file, name, before, after, tolerance)


def _last_line(played: Played) -> str:
    """Return the last line of an error, "" for runs with a verdict."""
    lines = played.text.strip().splitlines()
    return lines[-1][:300] if lines and played.code not in (0, 1, 6) else ""


def _run_changes(file: str, name: str, old: Run, new: Run, tolerance: float) -> Iterator[Change]:
    if (old.verdict, old.reasons) != (new.verdict, new.reasons):
        text = f"{old.verdict} → {new.verdict}: {'; '.join(old.reasons)} → {'; '.join(new.reasons)}"
        yield Change(file, name, "verdict", text)
    for sign, own, other in (("-", old, new), ("+", new, old)):
        for remark in own.remarks:
            if remark not in other.remarks:
                yield Change(file, name, "remark", f"{sign} {remark}")
    if abs(old.end - new.end) > SAME_TIME:
        yield Change(file, name, "end", f"{old.end:.2f} s → {new.end:.2f} s")
    yield from _place_changes(file, name, old, new, tolerance)


def _place_changes(file: str, name: str, old: Run, new: Run, tolerance: float) -> Iterator[Change]:
    before, after = tracks(old.folder), tracks(new.folder)
    for entity in sorted(before.keys() ^ after.keys()):
        text = f"{entity}: only in the {'old' if entity in before else 'new'} version"
        yield Change(file, name, "place", text, np.inf)
    for entity in sorted(before.keys() & after.keys()):
        first, second = before[entity], after[entity]
        common, at_old, at_new = np.intersect1d(first[:, 0], second[:, 0], return_indices=True)
        if not len(common):
            yield Change(file, name, "place", f"{entity}: at no common time", np.inf)
            continue
        distances = np.linalg.norm(first[at_old, 1:4] - second[at_new, 1:4], axis=1)
        largest = int(np.argmax(np.nan_to_num(distances, nan=np.inf)))
        if not distances[largest] <= tolerance:
            text = f"{entity}: {distances[largest]:.3f} m at {common[largest]:.2f} s"
            yield Change(file, name, "place", text, float(distances[largest]))


def tracks(folder: Path) -> dict[str, np.ndarray]:
    """Return the trajectories of a run: entity → rows of time (s, to 1 µs), x, y, z (m)."""
    path = folder / "trajectories.parquet"
    if not path.is_file():
        return {}
    table = pq.read_table(path, columns=["time", "entity", "x", "y", "z"])
    entities = np.asarray(table["entity"].to_pylist(), dtype=object)
    columns = [table[name].to_numpy().astype(float) for name in ("time", "x", "y", "z")]
    rows = np.column_stack([np.round(columns[0], 6), *columns[1:]])
    return {str(name): rows[entities == name] for name in sorted(set(entities))}


# command -----------------------------------------------------------------------------------------


def main() -> None:
    """Play, compare, print."""
    options = _options()
    files = scenarios(options.folders)
    if not files:
        raise SystemExit("no scenario below the folders")
    run_options = ["--quiet", "--sut", options.sut, "--world", options.world]
    run_options += ["--max-time", str(options.max_time), "--timestep", str(options.timestep)]
    run_options += ["--sample", str(options.sample)] if options.sample else []
    run_options += [f"--road-path={path}" for path in options.road_path]
    run_options += [f"--catalog-path={path}" for path in options.catalog_path]
    with ExitStack() as stack:
        scratch = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="corpora_diff_")))
        versions = [
            checkout(version, scratch / f"tree{n}", stack)
            for n, version in enumerate((options.old, options.new))
        ]
        played = _play_both(versions, files, scratch, run_options, options)
        found: list[Change] = []
        for path in files:
            found += changes(_short(path), *(each[path] for each in played), options.tolerance)
        found.sort(key=lambda change: (KINDS.index(change.kind), change))
        _print(found, len(files), played)
        if options.json:
            _write(options.json, found, files, played)
        if options.keep:
            shutil.copytree(scratch / "runs", options.keep, dirs_exist_ok=True)
    raise SystemExit(1 if found else 0)


def _options() -> Namespace:
    parser = ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("old", help="revision or checkout")
    parser.add_argument("new", help="revision or checkout")
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--sut", default="none")
    parser.add_argument("--world", default="kinematic")
    parser.add_argument("--timestep", type=float, default=0.1, metavar="S")
    parser.add_argument("--max-time", type=float, default=30.0, metavar="S", help="simulated")
    parser.add_argument("--sample", type=int, default=2, help="sets of a variation file; 0: all")
    parser.add_argument("--seconds", type=float, default=60.0, help="wall-clock limit for a file")
    parser.add_argument("--road-path", action="append", default=[], metavar="DIR", type=_absolute)
    parser.add_argument(
        "--catalog-path", action="append", default=[], metavar="DIR", type=_absolute
    )
    parser.add_argument("--tolerance", type=float, default=0.001, metavar="M", help="of places")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="for the results of both versions")
    return parser.parse_args()


def _absolute(path: str) -> str:
    return str(Path(path).resolve())


def _short(path: Path) -> str:
    return os.path.relpath(path)


def _play_both(
    versions: Sequence[Path],
    files: Sequence[Path],
    scratch: Path,
    run_options: Sequence[str],
    options: Namespace,
) -> list[dict[Path, Played]]:
    """Play every file with both versions; parts of the list run beside each other."""
    parts = max(1, options.jobs)
    with ThreadPoolExecutor(parts) as pool:
        waiting = [
            [
                pool.submit(
                    play,
                    version,
                    files[part::parts],
                    scratch / "runs" / f"{side}{part}",
                    run_options,
                    options.seconds,
                )
                for part in range(parts)
            ]
            for side, version in zip(("old", "new"), versions, strict=True)
        ]
        return [
            {path: told for part in side for path, told in part.result().items()}
            for side in waiting
        ]


def _print(found: Sequence[Change], files: int, played: Sequence[Mapping[Path, Played]]) -> None:
    for change in found:
        run = f" {change.run}" if change.run not in ("", "{}") else ""
        print(f"{change.kind:8} {change.file}{run}: {change.text}")
    kinds = Counter(change.kind for change in found)
    changed = len({change.file for change in found})
    counts = ", ".join(f"{kinds[kind]} {kind}" for kind in KINDS)
    print(f"{files} files, {changed} changed: {counts}")
    for name, side in zip(("old", "new"), played, strict=True):
        verdicts = Counter(run.verdict for each in side.values() for run in each.runs.values())
        codes = Counter(str(each.code) for each in side.values())
        runs = ", ".join(f"{number} {verdict}" for verdict, number in sorted(verdicts.items()))
        exits = ", ".join(f"{code}: {number}" for code, number in sorted(codes.items()))
        print(f"{name}: runs: {runs}; files by exit code: {exits}")


def _write(
    path: Path,
    found: Sequence[Change],
    files: Sequence[Path],
    played: Sequence[Mapping[Path, Played]],
) -> None:
    def side(told: Played) -> dict[str, object]:
        runs = {
            name: {"verdict": run.verdict, "reasons": run.reasons, "end_time": run.end}
            for name, run in told.runs.items()
        }
        return {"exit_code": told.code, "error": _last_line(told), "runs": runs}

    changed = [
        {**asdict(change), "metres": change.metres if np.isfinite(change.metres) else None}
        for change in found
    ]
    data = {
        "changes": changed,
        "files": {
            _short(file): {
                name: side(each[file]) for name, each in zip(("old", "new"), played, strict=True)
            }
            for file in files
        },
    }
    path.write_text(json.dumps(data, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
