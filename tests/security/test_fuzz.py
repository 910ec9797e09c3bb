"""What the fuzzer takes for a defect, and inputs that failed once; `python -m benchmarks.fuzz`
makes thousands.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest

from tests.commands import Answer
from tests.fuzz import standard
from tests.fuzz.kinds import CASE, Input, Kind, own_kinds
from tests.fuzz.pool import DIED, HUNG, Limits, Result, Runner, Server

CORPUS = Path(__file__).with_name("corpus")
_SEED, _COUNT = 1, 24
_PLAYED = """
import json, sys
from pathlib import Path
from tests.security.test_fuzz import play, serve
served = serve(Path(sys.argv[1]))
print(json.dumps([*play(Path(sys.argv[1])), *served]))
"""


def serve(scratch: Path) -> tuple[list[Result], list[str]]:
    """Return results of some inputs of the round in a forked child, and defects
    of inputs that end or spoil their process.
    """
    runner, spoilt = Runner(scratch, Limits()), list[int]()
    results = list(Server(runner, own_kinds(), _SEED, warm=False).group(range(0, _COUNT, 4)))

    def spin() -> Answer:
        while True:
            pass

    def spoil() -> Answer:
        spoilt.append(1)
        return Answer(0 if len(spoilt) == 1 else 5, "", f"{CASE}: input/")

    def kind(act: Callable[[], Answer]) -> dict[str, Kind]:
        return {"odd": Kind(lambda *_: Input((), "", ()), lambda _: act(), frozenset({0}), 1.0)}

    runner.limits, defects = Limits(seconds=0.1), []
    for act in (os.abort, spin, spoil):
        server = Server(runner, kind(act), _SEED, warm=False)
        found = list(server.group(range(2)))
        defects.append(found[-1].defect)
    return results, [*defects, server.confirmed(found[-1]).defect]


def play(scratch: Path) -> tuple[list[Result], list[Result]]:
    """Return results of the inputs of the corpus and of a short round.

    An entry of the corpus is a folder with the files and `input.json` (kind, arguments, allowed
    exit codes).
    """
    import recognition.trfe.storage  # noqa: F401  # neither its time nor its memory is an input's

    runner, kinds, results = Runner(scratch, Limits()), own_kinds(), []
    for entry in sorted(CORPUS.iterdir()):
        about = json.loads((entry / "input.json").read_text(encoding="utf-8"))
        folder = scratch / f"input-{entry.name}"
        for part in ("cwd", "out"):
            (folder / part).mkdir(parents=True)
        shutil.copytree(entry / "case", folder / "case")
        result = runner.run(
            about["kind"],
            kinds[about["kind"]],
            Input(tuple(about["arguments"]), entry.name, ()),
            folder,
        )
        results.append(
            result
            if result.code in about["codes"]
            else result._replace(defect=f"exit code {result.code}")
        )
    return results, [
        runner.draw(kinds, _SEED, number, scratch / f"input{number}") for number in range(_COUNT)
    ]


Played = tuple[list[Result], list[Result], list[Result], list[str]]


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Played:
    """Results of the corpus, of a short round, and of some of its inputs in a
    forked child; defects of odd inputs.
    """
    done = subprocess.run(
        [sys.executable, "-c", _PLAYED, str(tmp_path_factory.mktemp("fuzz"))],
        capture_output=True, text=True, check=False, cwd=CORPUS.parents[2],
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    *results, odd = json.loads(done.stdout.splitlines()[-1])
    corpus, round_, forked = ([Result(*each) for each in some] for some in results)
    return corpus, round_, forked, odd


@pytest.mark.slow
def test_what_ever_failed_fails_no_more_and_a_short_round_finds_nothing(played: Played) -> None:
    """The same inputs each time, of most kinds, in one process; the workflow
    `fuzz` takes others each night.
    """
    corpus, round_, _, _ = played
    assert len(corpus) == len(list(CORPUS.iterdir())) >= 3 and len(round_) == _COUNT
    assert [each for each in corpus + round_ if each.defect] == []
    assert {0, 1, 3} <= {each.code for each in round_}


@pytest.mark.slow
def test_an_input_has_the_same_answer_in_a_forked_child(played: Played) -> None:
    _, round_, forked, _ = played
    told = [
        (each.number, each.kind, each.source, each.changes, each.code, each.defect, each.message)
        for each in forked
    ]
    assert told == [
        (each.number, each.kind, each.source, each.changes, each.code, each.defect, each.message)
        for each in round_[::4]
    ]


@pytest.mark.slow
def test_an_input_that_ends_or_spoils_its_process_is_told_by_that(played: Played) -> None:
    died, hung, after, alone = played[3]
    assert died == f"{DIED} ({int(signal.SIGABRT)})" and hung == HUNG
    assert "exit code 5" in after and alone == f"only after other inputs: {after}"


def test_defects_are_found(tmp_path: Path) -> None:
    """The judge sees what it is there for: each broken answer is a defect of its own kind."""

    def answers(answer: Answer, write: bool = False, grow: bool = False) -> Kind:
        def call(arguments: object) -> Answer:
            if write:
                Path("stray").write_text("x")
            if grow:
                assert len(bytearray(b"x") * 80_000_000)
            return answer

        return Kind(
            lambda folder, random, seeds: Input((CASE,), "", ()), call, frozenset({0, 3}), 1.0
        )

    judge = _judge(tmp_path)
    name = "input0/case/a.xosc: "
    assert (
        judge(answers(Answer(0, "", ""))) == judge(answers(Answer(3, "", f"x: {name}bad\n"))) == ""
    )
    assert "traceback" in judge(
        answers(Answer(3, "", f"{name}\nTraceback (most recent call last):\nX: y\n"))
    )
    assert "internal error" in judge(answers(Answer(3, "", f"{name}internal error: X\n")))
    assert "exit code 5" in judge(answers(Answer(5, "", name)))
    assert "names no file" in judge(answers(Answer(3, "", "bad\n")))
    assert "console" in judge(answers(Answer(3, "", f"{name}\x1b[2J\n")))
    assert "CI services" in judge(answers(Answer(0, "::error::x\n", "")))
    assert "outside" in judge(answers(Answer(0, "", ""), write=True))
    assert "MiB" in judge(answers(Answer(0, "", ""), grow=True))


def _judge(scratch: Path):  # type: ignore[no-untyped-def]
    runner = object.__new__(Runner)
    runner._scratch, runner.limits, runner._written = scratch, Limits(memory=40.0), []
    (scratch / "tmp").mkdir()

    def defect(kind: Kind) -> str:
        folder = scratch / "input0"
        shutil.rmtree(folder, ignore_errors=True)
        for part in ("case", "cwd", "out"):
            (folder / part).mkdir(parents=True)
        return runner.run("kind", kind, Input((CASE,), "", ()), folder).defect

    return defect


@pytest.mark.slow
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
        "laneId": "String", "layer": "LaneLayerType", "offset": "Double", "roadId": "String",
        "s": "Double"
    }  # fmt: skip
