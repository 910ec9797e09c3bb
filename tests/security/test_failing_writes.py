"""Every command that writes, on a disk whose operations fail one after the other.

Each call is done once undisturbed. Then an operation fails: the command ends with exit code 2 and
one line that says why, and no file has half of its content under its final name. The same call
again must leave the bytes of the undisturbed one. The first test fails operations by their number,
the second limits the size of files, which libraries that write by themselves meet as well.
"""

from __future__ import annotations

import os
import resource
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from recognition.trfe.encoder.config import PRESETS, Preset, TokenArchitecture, TrainingSchedule
from recognition.trfe.storage import load
from schemas.common.storage import DRAFT
from tests.commands import SCRIPTS, Answer, Command
from tests.disk import Disk, Failure, files, watched
from tests.recognition.trfe.training.test_command import windows
from tests.runner.files import scenario

QUICK = ("--world", "kinematic", "--sut", "none")
RUN = ["xosc-run", "in/scenario.xosc", *QUICK, "--out", "out", "--resume"]
SEARCH = ("--method", "draws", "--budget", "2")
CALLS: dict[str, list[str]] = {
    "run": [*RUN, "--junit", "out/junit.xml", "--replay"],
    "run, with pictures": [*RUN, "--plot"],
    "run, OSI": ["xosc-run", "in/scenario.xosc", *QUICK, "--osi", "out/run.osi"],
    "run, MCAP": ["xosc-run", "in/scenario.xosc", *QUICK, "--osi", "out/run.mcap"],
    "check": ["xosc-check", "in/scenario.xosc", "--format", "sarif", "--output", "out/check.sarif"],
    **{f"export to {to}": ["xosc-export", "in/scenario.xosc", "--to", to, "--out",
        "out"] for to in ("1.0", "carla", "esmini")},
    **{
        f"export to {to}": ["xosc-export", "in/scenario.xosc", "--to", to, "--out", "out", *QUICK]
        for to in ("openlabel", "parquet", "osi", "commonroad", "sumo")
    },
    "replay": ["xosc-replay", "in/results/scenario", "--out", "out/replay.html"],
    "replay as a picture": ["xosc-replay", "in/results/scenario", "--out", "out/replay.png"],
    "replay as an animation": ["xosc-replay", "in/results/scenario", "--out", "out/replay.gif"],
    "replay of a recording": ["xosc-recognize", "replay", "in/results", "--out", "out/replay.xosc"],
    "catalogue": ["xosc-recognize", "in/results", "--labels", "rules", "--out", "out"],
    "list": ["xosc-list", "in/library", "--format", "json", "--output", "out/list.json"],
    "list of a catalogue, copied": ["xosc-list", "in/catalogue", "--copy-to", "out"],
    "convert": ["xosc-road", "convert", "in/road.xodr", "--out", "out/road.geojson"],
    "triage": ["xosc-check", "in/library", "--triage", "--format", "html", "--output",
        "out/triage.html"],
    "run, assessed": [*RUN, "--assess", "euro-ncap-2023"],
    "report of a batch": ["xosc-replay", "out/results"],
    "history of batches": ["xosc-replay", "in/results", "out/results", "--out", "out/history.html"],
    "replay of a trace": ["xosc-replay", "in/trace.osi", "--out", "out/replay.html"],
    "train": ["xosc-recognize", "train", "in/windows", "--encoders", "in/model", "--out", "out",
        "-q"],
    "label": ["xosc-recognize", "label", "out/results/scenario", "--labels", "rules"],
    "record": ["xosc-recognize", "record", "out", "--families", "1"],
    "generate": ["xosc-generate", "in/scenario.xosc", "--free", "Gap=20..60", *SEARCH, "--out",
        "out", "-q", *QUICK],
    "loop": ["xosc-loop", "in/library", "--labels", "rules", "--budget", "2", "--rounds", "1",
        "--out", "out"],
}  # fmt: skip
"""A quick call of everything that writes, into the folder `out`"""
MOST = {
    "generate": 2,
    "loop": 6,
    "record": 2,
    "replay as a picture": 1,
    "replay as an animation": 1,
    "run, with pictures": 3,
    "train": 3,
}
"""Operations that fail in turn, of the calls that take longer; of the others all, up to eight"""
SIZES = 0, 300
"""Largest files, in bytes: nothing at all, and the beginning of most"""
UNLIMITED = {"generate", "loop", "label", "train", "replay as a picture", "run, with pictures"}
"""Calls that take long, or write in many steps, which the first test looks at"""
UNTOLD = "the trace can't be written"
"""Message where OSI's writer opens no file, and keeps the reason to itself"""


def _trace(folder: Path, command: Command, patch: pytest.MonkeyPatch) -> None:
    assert (
        command("xosc-run", folder / "scenario.xosc", *QUICK, "--osi", folder / "trace.osi").code
        == 0
    )


def _catalogue(folder: Path, command: Command, patch: pytest.MonkeyPatch) -> None:
    made = command(
        "xosc-recognize", folder / "results", "--labels", "rules", "--out", folder / "catalogue"
    )
    assert made.code == 0, made


def _model(folder: Path, command: Command, patch: pytest.MonkeyPatch) -> None:
    """Windows, and a model whose encoders are taken; it is trained once only."""
    patch.setitem(
        PRESETS,
        "tokens",
        Preset(TokenArchitecture(dim=32, depth=1, heads=2), *[TrainingSchedule(1, 64, 1e-3)] * 2),
    )
    train = ("xosc-recognize", "train", windows(folder / "windows"), "-q")
    assert command(*train, "--out", folder / "model").code == 0
    trained = load(folder / "model")
    patch.setattr("recognition.trfe.training.command.fitted", lambda *_: trained)


def _road(folder: Path, command: Command, patch: pytest.MonkeyPatch) -> None:
    road = Path(__file__).parents[1] / "conformance" / "roads" / "curve.xodr"
    (folder / "road.xodr").write_bytes(road.read_bytes())


NEEDED = {
    "convert": _road,
    "replay of a trace": _trace,
    "list of a catalogue, copied": _catalogue,
    "train": _model,
}
"""Further inputs of calls, which take time to make"""


@pytest.fixture
def fresh(
    tmp_path: Path,
    command: Command,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
) -> Callable[[str], Path]:
    """Makes the folder `out` anew for a call, beside inputs in `in`."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("runner.batch.journal._GROUP", 0.0)
    monkeypatch.setattr(os, "fsync", lambda file: None)  # no test needs the real disk

    def inputs(folder: Path) -> None:
        scenario(folder, stop=0.2)
        assert (
            command("xosc-run", folder / "scenario.xosc", *QUICK, "--out", folder / "results").code
            == 0
        )

    inputs(tmp_path / "in")
    scenario(tmp_path / "in" / "library", stop=0.2)
    if request.node.callspec.params["call"] in NEEDED:
        NEEDED[request.node.callspec.params["call"]](tmp_path / "in", command, monkeypatch)

    def make(call: str) -> Path:
        out = tmp_path / "out"
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir()
        if call in ("label", "report of a batch", "history of batches"):
            inputs(out)
        return out

    return make


def check(answer: Answer, error: str, left: dict[str, bytes], expected: dict[str, bytes]) -> None:
    """What holds after a failure."""
    assert (answer.code, answer.err.count("\n")) == (2, 1) and (
        error in answer.err or UNTOLD in answer.err
    ), answer
    half = [
        name
        for name, content in left.items()
        if expected.get(name, b"").startswith(content) and content != expected[name]
    ]
    assert [name for name in half if not name.endswith(".jsonl")] == []  # these are added to


def test_all_commands_are_here() -> None:
    served = {"xosc-explore"}  # it runs until it is ended: tests/xosc_toolchain/test_explore.py
    assert {call[0] for call in CALLS.values()} == set(SCRIPTS) - {"xosc"} - served


@pytest.mark.slow
@pytest.mark.parametrize("call", CALLS)
def test_an_operation_that_fails(call: str, fresh: Callable[[str], Path], command: Command) -> None:
    out, counting = fresh(call), Failure(-1)
    with watched(out, counting):
        usual = command(*CALLS[call])
    expected = files(out)
    assert expected and counting.count
    step = max(1, counting.count // MOST.get(call, 8))
    for place in sorted({*range(0, counting.count, step), counting.count - 1}):
        out, failure = fresh(call), Failure(place)
        with watched(out, failure):
            answer = command(*CALLS[call])
        assert failure.error is not None
        if answer.code == usual.code:
            assert failure.name in (
                "unlink",
                "rmdir",
            )  # what was to be removed stays, which harms nothing
            continue
        check(answer, str(failure.error.strerror), files(out), expected)
        assert command(*CALLS[call]).code == usual.code, failure.name
        assert files(out) == expected, failure.name


@pytest.mark.every
@pytest.mark.parametrize("call", CALLS)
def test_every_operation_fails_or_is_the_last(
    call: str, fresh: Callable[[str], Path], command: Command, tmp_path: Path
) -> None:
    """All operations, none left out; and before each the machine goes down, or the process is
    killed, and the call is repeated.

    Not in the suite: `pytest -m every --basetemp /dev/shm/every tests/security`, where numbers of
    files are not used twice.
    """
    out = fresh(call)
    disk, pictures = Disk(out), list[tuple[str, dict[str, Path]]]()
    (shots := tmp_path / "pictures").mkdir()

    def before(name: str) -> None:
        pictures.append((name, disk.pictures(shots / str(len(pictures)))))

    with watched(out, before, disk.after):
        usual = command(*CALLS[call])
    expected, wrong, seen = files(out), list[str](), list[dict[str, bytes]]()

    def left(folder: Path) -> dict[str, bytes]:
        return {
            name: content for name, content in files(folder).items() if DRAFT not in name
        }  # hidden: no command reads them

    for place in range(len(pictures)):
        out, failure = fresh(call), Failure(place)
        with watched(out, failure):
            answer = command(*CALLS[call])
        if failure.name in ("unlink", "rmdir"):  # what was to be removed stays, which harms nothing
            continue
        assert failure.error is not None
        check(answer, str(failure.error.strerror), files(out), expected)
        if command(*CALLS[call]).code != usual.code or files(out) != expected:
            wrong.append(f"repeated after {place} {failure.name} failed")
    for place, (name, kinds) in enumerate(pictures):
        for kind, shot in kinds.items():
            if (picture := left(shot)) in seen:
                continue
            seen.append(picture)
            shutil.rmtree(out)
            shutil.copytree(shot, out)
            answer = command(*CALLS[call])
            if left(out) != expected or (
                answer.code != usual.code and picture != expected
            ):  # all is there: some overwrite none
                odd = [each for each in expected if files(out).get(each) != expected[each]]
                wrong.append(f"{kind} before {place} {name}: {answer}, {odd}")
    print(f"{call}: {len(pictures)} operations, {len(seen)} states after a loss")
    assert wrong == []


@contextmanager
def largest(size: int) -> Iterator[None]:
    """Let no file grow beyond a size, in bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.slow
@pytest.mark.parametrize("call", [call for call in CALLS if call not in UNLIMITED])
def test_files_that_can_not_grow(call: str, fresh: Callable[[str], Path], command: Command) -> None:
    out = fresh(call)
    usual = command(*CALLS[call])
    expected = files(out)
    for size in SIZES:
        out = fresh(call)
        with largest(size):
            answer = command(*CALLS[call])
        check(answer, "File too large", files(out), expected)
        assert command(*CALLS[call]).code == usual.code
        assert files(out) == expected
