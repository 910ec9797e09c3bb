"""What the fuzzer takes for a defect, and inputs that failed once; `python -m benchmarks.fuzz` makes thousands."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from random import Random

import pytest

from tests.commands import Answer
from tests.fuzz import standard
from tests.fuzz.kinds import CASE, Input, Kind, own_kinds
from tests.fuzz.pool import Limits, Result, Runner

CORPUS = Path(__file__).with_name("corpus")
_SEED, _COUNT = 1, 48
_PLAYED = """
import json, sys
from pathlib import Path
from tests.security.test_fuzz import play
print(json.dumps(play(Path(sys.argv[1]))))
"""


def play(scratch: Path) -> tuple[list[Result], list[int]]:
    """Return results with defects, and all exit codes, of the inputs of the corpus and of a short round.

    An entry of the corpus is a folder with the files and `input.json` (kind, arguments, allowed exit codes).
    """
    import recognition.trfe.storage  # noqa: F401  # neither its time nor its memory is an input's

    runner, kinds, results = Runner(scratch, Limits()), own_kinds(), []
    for entry in sorted(CORPUS.iterdir()):
        about = json.loads((entry / "input.json").read_text(encoding="utf-8"))
        folder = scratch / f"input-{entry.name}"
        for part in ("cwd", "out"):
            (folder / part).mkdir(parents=True)
        shutil.copytree(entry / "case", folder / "case")
        result = runner.run(about["kind"], kinds[about["kind"]], Input(tuple(about["arguments"]), entry.name, ()), folder)
        results.append(result if result.code in about["codes"] else result._replace(defect=f"exit code {result.code}"))
    results += [runner.draw(kinds, _SEED, number, scratch / f"input{number}") for number in range(_COUNT)]
    return [result for result in results if result.defect], [result.code for result in results]


def test_what_ever_failed_fails_no_more_and_a_short_round_finds_nothing(tmp_path: Path) -> None:
    """The same inputs each time, of most kinds, in one process; the workflow `fuzz` takes others each night."""
    entries = len(list(CORPUS.iterdir()))
    assert entries >= 3
    done = subprocess.run(
        [sys.executable, "-c", _PLAYED, str(tmp_path)], capture_output=True, text=True, check=False, cwd=CORPUS.parents[2]
    )
    assert done.returncode == 0, done.stderr
    defects, codes = json.loads(done.stdout.splitlines()[-1])
    assert defects == []
    assert len(codes) == entries + _COUNT and {0, 1, 3} <= set(codes)


def test_defects_are_found(tmp_path: Path) -> None:
    """The judge sees what it is there for: each broken answer is a defect of its own kind."""

    def answers(answer: Answer, write: bool = False, grow: bool = False) -> Kind:
        def call(arguments: object) -> Answer:
            if write:
                Path("stray").write_text("x")
            if grow:
                assert len(bytearray(b"x") * 80_000_000)
            return answer

        return Kind(lambda folder, random, seeds: Input((CASE,), "", ()), call, frozenset({0, 3}), 1.0)

    judge = _judge(tmp_path)
    name = "input0/case/a.xosc: "
    assert judge(answers(Answer(0, "", ""))) == judge(answers(Answer(3, "", f"x: {name}bad\n"))) == ""
    assert "traceback" in judge(answers(Answer(3, "", f"{name}\nTraceback (most recent call last):\nX: y\n")))
    assert "internal error" in judge(answers(Answer(3, "", f"{name}internal error: X\n")))
    assert "exit code 5" in judge(answers(Answer(5, "", name)))
    assert "names no file" in judge(answers(Answer(3, "", "bad\n")))
    assert "console" in judge(answers(Answer(3, "", f"{name}\x1b[2J\n")))
    assert "CI services" in judge(answers(Answer(0, "::error::x\n", "")))
    assert "outside" in judge(answers(Answer(0, "", ""), write=True))
    assert "MiB" in judge(answers(Answer(0, "", ""), grow=True))


def _judge(scratch: Path):  # type: ignore[no-untyped-def]
    runner = object.__new__(Runner)
    runner._scratch, runner._limits, runner._written = scratch, Limits(memory=40.0), []
    (scratch / "tmp").mkdir()

    def defect(kind: Kind) -> str:
        folder = scratch / "input0"
        shutil.rmtree(folder, ignore_errors=True)
        for part in ("case", "cwd", "out"):
            (folder / part).mkdir(parents=True)
        return runner.run("kind", kind, Input((CASE,), "", ()), folder).defect

    return defect


def test_an_input_is_made_again_by_its_number(tmp_path: Path) -> None:
    for name, kind in own_kinds().items():
        if name in ("model", "replay"):  # they take time to make
            continue
        made = []
        for turn in ("a", "b"):
            (folder := tmp_path / turn / name.replace(" ", "_")).mkdir(parents=True)
            made.append(kind.make(folder, Random(f"7 {name}"), tmp_path / "seeds"))
        assert made[0] == made[1], name


@pytest.mark.parametrize("root", ["OpenSCENARIO", "OpenDRIVE"])
def test_the_schema_is_read(root: str) -> None:
    found = standard.standard(root)
    assert len(found.elements) > 250 and len(found.words) > 30
    assert root != "OpenSCENARIO" or found.elements["LanePosition"].attributes == {
        "laneId": "String", "layer": "LaneLayerType", "offset": "Double", "roadId": "String", "s": "Double"
    }  # fmt: skip
