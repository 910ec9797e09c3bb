"""Walks: files that a reader opens to follow a flow from its command to its result.

    python tests/test_walks.py [NAME]

prints them. A flow is a command and its stations, the functions that do its steps. It is executed,
and the walk is the files on the call stack when a station is called first, all stations together:
files with a frame between the command and a step, which hold the flow's own order. Files that a
step calls (what it is made of) are not counted, nor those of `schemas.common`, which all flows use
alike, nor imports.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import reduce
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from types import CodeType, FrameType
from typing import Any, NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
PACKAGES = ("schemas", "xosc", "xodr", "runner", "recognition", "generation")
BELOW_ALL = "schemas/common/"


class Walk(NamedTuple):
    """A flow to follow.

    Attributes:
        most: files as measured; to be lowered where a walk gets shorter.
        arguments: of the command, given a folder with the inputs of the flow.
        stations: functions that do its steps, as `module:name`.
    """

    most: int
    arguments: Callable[[Path], tuple[str, ...]]
    stations: tuple[str, ...]


def _recording(folder: Path) -> tuple[str, ...]:
    from tests.recognition.motorway import write_motorway

    write_motorway(folder / "recordings")
    out = ("--out", str(folder / "out"), "--labels", "rules")
    return ("xosc-recognize", str(folder / "recordings"), *out)


def _search(folder: Path) -> tuple[str, ...]:
    quick = ("--method", "draws", "--budget", "15", "--density", "gaussian", "--jobs", "1")
    out = ("--out", str(folder / "out"), "--sut", "none", "--world", "kinematic")
    return ("xosc-generate", "cut_in_highway", *quick, *out)


# Targets: 15, 12, 15, 10 and 7 files.
WALKS = {
    "path to verdict": Walk(
        15,
        lambda _: ("xosc-run", "simple_cut_in", "--world", "kinematic", "--max-time", "1"),
        (
            "xosc.document:load",
            "xosc.resolve:resolve",
            "runner.engine.compile.road_network:load_roads",
            "runner.engine.compile.compiler:compile_scenario",
            "runner.engine.actions.speed:SpeedAction.from_xml",
            "runner.engine.storyboard.storyboard:Storyboard.evaluate",
            "runner.engine.actions.speed:SpeedAction.start",
            "runner.engine.motion.on_roads:LaneMotion.advance",
            "runner.systems.drivers:SystemDriver.decide",
            "runner.judging.verdict:judge",
            "runner.batch.outputs.terminal:OutcomeTable.show",
        ),
    ),
    "CSV to catalogue": Walk(
        12,
        _recording,
        (
            "recognition.recordings.source:open",
            "recognition.recordings.formats.highd:_read",
            "recognition.scenes:site_of",
            "recognition.scenes:place",
            "recognition.labels:label",
            "recognition.catalogue.detect:joined",
            "recognition.catalogue.detect:of_findings",
            "recognition.scenes.cut:SceneCutter.cut",
            "recognition.labels.maneuvers.events:Maneuvers.of",
            "recognition.catalogue.writing.replay:scenario",
            "recognition.catalogue.writing.storyboard:scenario",
            "recognition.catalogue.writing.write:write_catalog",
        ),
    ),
    "a search": Walk(
        14,
        _search,
        (
            "generation.space.space:Space.of",
            "generation.space.recorded:of_recordings",
            "generation.space.density.prior:fitted",
            "generation.search.methods.cover:draws",
            "generation.search.problem:Calls.__call__",
            "generation.search.problem:Memory.__call__",
            "generation.search.outcomes:Evaluator.__call__",
            "runner.judging.execution:run",
            "runner.judging.measures.criticality:of_recording",
            "generation.search.problem:Reward.__call__",
            "generation.search.outcomes:matrix",
            "generation.search.outcomes:choose",
            "generation.search.variations:Writer.cases",
            "generation.report.report:write_report",
        ),
    ),
    "a variation in arrays": Walk(
        10,
        lambda _: (
            "xosc-run",
            "simple_cut_in_variation",
            "--batch",
            "--world",
            "kinematic",
            "--sut",
            "none",
            "--only",
            "0",
            "--max-time",
            "6",
        ),
        (
            "runner.batch.arrays:structures",
            "xosc.resolve:resolve",
            "runner.engine.compile.compiler:compile_scenario",
            "runner.batch.arrays:play",
            "runner.engine.storyboard.array_run:ArraySimulation.play",
            "runner.engine.storyboard.array_elements:ArrayActionElement.start",
            "runner.judging.evidence.array_judge:ArrayJudge.outcomes",
            "runner.judging.execution:run",
            "runner.batch.outputs.terminal:OutcomeTable.show",
        ),
    ),
    "a road to SUMO": Walk(
        7,
        lambda folder: (
            "xosc-road",
            "convert",
            str(ROOT / "xodr" / "library" / "highway_straight.xodr"),
            "--out",
            str(folder / "out.net.xml"),
        ),
        (
            "xodr.reader.document:_load",
            "xodr.formats.sumo_net.plain:plain_network",
            "xodr.formats.sumo_net.net:centre_line",
            "xodr.formats.sumo_net.building:netconvert",
        ),
    ),
}


class _Stacks:
    """Files on the stack when each station is called first, in this process or one forked by it."""

    def __init__(self, stations: Mapping[CodeType, str], log: Path) -> None:
        self._log = log
        self._wanted = {id(code): (code, name) for code, name in stations.items()}

    def __call__(self, frame: FrameType | None, event: str, _argument: object) -> None:
        """A function is called."""
        if event != "call" or frame is None or id(frame.f_code) not in self._wanted:
            return
        _, name = self._wanted.pop(id(frame.f_code))
        files = []
        while frame is not None:
            path = frame.f_code.co_filename.removeprefix(f"{ROOT}/")
            if path.startswith(PACKAGES) and not path.startswith(BELOW_ALL):
                files.append(path)
            frame = frame.f_back
        with self._log.open("a") as log:
            log.write(json.dumps([name, list(dict.fromkeys(reversed(files)))]) + "\n")

    def found(self) -> dict[str, list[str]]:
        """Files by station; of several processes the first."""
        calls = [json.loads(line) for line in self._log.read_text().splitlines()]
        return dict(reversed(calls))


def _code(station: str) -> CodeType:
    module, _, name = station.partition(":")
    found: Any = reduce(getattr, name.split("."), import_module(module))
    if hasattr(found, "cache_clear"):
        found.cache_clear()  # a test before may have read the same file
    found = getattr(found, "__wrapped__", found)
    code: CodeType = getattr(found, "__func__", found).__code__
    return code


def followed(walk: Walk, do: Callable[..., object], folder: Path) -> dict[str, list[str]]:
    """Execute a flow; the files on the stack by station."""
    stacks = _Stacks({_code(name): name for name in walk.stations}, folder / "calls.jsonl")
    arguments = walk.arguments(folder)
    os.environ["XOSC_CACHE_DIR"] = str(folder / "cache")  # nothing is there already
    sys.setprofile(stacks)
    try:
        do(*arguments)
    finally:
        sys.setprofile(None)
    return stacks.found()


def files_of(stacks: Mapping[str, list[str]]) -> list[str]:
    """Files of a walk."""
    return sorted({file for files in stacks.values() for file in files})


SLOW = ("CSV to catalogue", "a search")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else []) for name in WALKS]
)
def test_a_walk_gets_no_longer(
    name: str, command: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    walk = WALKS[name]
    monkeypatch.setenv("XOSC_CACHE_DIR", str(tmp_path))  # set back in the end
    stacks = followed(walk, command, tmp_path)
    assert set(walk.stations) - stacks.keys() == set(), "the flow passes no such station any more"
    assert len(files_of(stacks)) == walk.most, "lower the number where the walk is shorter"


def main() -> None:
    """Print all walks, or one."""
    from tests.commands import main as command

    def do(name: str, *arguments: str) -> None:
        sys.argv = [name, *arguments]
        with suppress(SystemExit):
            command(name)()

    for name in sys.argv[1:] or list(WALKS):
        with TemporaryDirectory() as folder:
            stacks = followed(WALKS[name], do, Path(folder))
        print(f"\n{name}: {len(files_of(stacks))} files")
        for station in WALKS[name].stations:
            print(f"  {station:60} {'' if station in stacks else 'not passed'}")
            for file in stacks.get(station, ()):
                print(f"      {file}")
        print("\n".join(files_of(stacks)))


if __name__ == "__main__":
    main()
