"""Files and folders that commands write: what is missing above them is made, and
what is in the way is one line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.commands import SCRIPTS, Command
from tests.runner.files import scenario

LIBRARY = Path(__file__).parents[1] / "xodr" / "library"
ROAD, OTHER = LIBRARY / "highway_straight.xodr", LIBRARY / "highway_on_ramp.xodr"
QUICK = ("--world", "kinematic", "--sut", "none")

Call = tuple[object, ...]
CALLS: dict[str, Callable[[Path, Path], Call]] = {
    "run --junit x.xml": lambda done, to: ("xosc-run", done / "s.xosc", *QUICK, "--junit", to),
    "run --osi x.mcap": lambda done, to: ("xosc-run", done / "s.xosc", *QUICK, "--osi", to),
    "run --osi x.osi": lambda done, to: ("xosc-run", done / "s.xosc", *QUICK, "--osi", to),
    "run --out": lambda done, to: ("xosc-run", done / "s.xosc", *QUICK, "--out", to),
    "check --output x.txt": lambda done, to: ("xosc-check", done / "s.xosc", "--output", to),
    "check --output x.sarif": lambda done, to: (
        "xosc-check", done / "s.xosc", "--format", "sarif", "--output", to,
    ),
    "list --output x.txt": lambda done, to: ("xosc-list", "--output", to),
    "replay --out x.html": lambda done, to: ("xosc-replay", done / "out" / "s", "--out", to),
    "replay --out x.png": lambda done, to: ("xosc-replay", done / "out" / "s", "--out", to),
    "replay --out x.gif": lambda done, to: ("xosc-replay", done / "out" / "s", "--out", to),
    "replay batches --out y.html": lambda done, to: (
        "xosc-replay", done / "out", done / "again", "--out", to,
    ),
    "export --out": lambda done, to: (
        "xosc-export", done / "s.xosc", "--to", "esmini", "--out", to,
    ),
    "road convert --out x.net.xml": lambda done, to: ("xosc-road", "convert", ROAD, "--out", to),
    "road show x.html": lambda done, to: ("xosc-road", "show", ROAD, "--out", to),
    "road show x.svg": lambda done, to: ("xosc-road", "show", ROAD, "--out", to),
    "road compare --page x.html": lambda done, to: (
        "xosc-road", "compare", ROAD, OTHER, "--page", to,
    ),
    "recognize replay --out x.xosc": lambda done, to: (
        "xosc-recognize", "replay", done / "out" / "s", "--out", to,
    ),
    "recognize --out": lambda done, to: (
        "xosc-recognize", done / "out", "--labels", "rules", "--out", to,
    ),
}  # fmt: skip
SEARCHES = {"xosc-generate", "xosc-loop"}
"""Commands that take long; their --out is made by the same function as that of `xosc-recognize`"""

SERVERS = {"xosc-explore"}
"""Commands that write when a page asks for it; see tests/xosc_toolchain/test_explore.py"""


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A scenario, and two batches of it."""
    from runner.batch.batch import run_batch
    from runner.batch.jobs import jobs_of
    from runner.judging.settings import RunSettings

    folder = tmp_path_factory.mktemp("done")
    path = scenario(folder, "s", stop=0.5)
    for name in ("out", "again"):
        settings = RunSettings(sut="none", world="kinematic")
        list(run_batch(jobs_of([path], {}, True), settings, out=folder / name))
    yield folder


def name_of(call: str) -> str:
    last = call.rpartition(" ")[2]
    return last if last[1:2] == "." else "made"


def test_no_command_that_writes_is_left_out(tmp_path: Path) -> None:
    commands = {str(make(tmp_path, tmp_path)[0]) for make in CALLS.values()}
    assert commands | SEARCHES | SERVERS == SCRIPTS.keys() - {"xosc"}


@pytest.mark.parametrize("call", CALLS)
def test_folders_above_are_made(call: str, done: Path, tmp_path: Path, command: Command) -> None:
    target = tmp_path / "reports" / "of today" / name_of(call)
    answer = command(*CALLS[call](done, target))
    assert target.exists(), answer
    assert answer.code in (0, 1, 6), answer
    assert "Traceback" not in answer.err


@pytest.mark.parametrize("option", ["--junit", "--osi"])
def test_what_a_run_can_not_write_is_said_before_it(
    option: str, done: Path, tmp_path: Path, command: Command
) -> None:
    answer = command("xosc-run", done / "s.xosc", *QUICK, option, tmp_path)
    assert answer.code == 2 and answer.out == "" and "can't be written" in answer.err


@pytest.mark.parametrize(
    "call",
    [
        ("xosc-run", "FILE", *QUICK, "--junit", "FILE"),
        ("xosc-run", "FILE", *QUICK, "--osi", "FILE"),
        ("xosc-check", "FILE", "--output", "FILE"),
        ("xosc-run", "FILE", *QUICK, "--junit", "x.mcap", "--osi", "x.mcap"),
    ],
)
def test_no_file_that_is_read_is_written(call: Call, tmp_path: Path, command: Command) -> None:
    path = scenario(tmp_path, stop=0.2)
    before = path.read_bytes()
    names = {"FILE": path, "x.mcap": tmp_path / "x.mcap"}
    answer = command(*(names.get(str(part), part) for part in call))
    assert answer.code == 2 and "name another" in answer.err
    assert path.read_bytes() == before and not (tmp_path / "x.mcap").exists()


@pytest.mark.parametrize("call", CALLS)
def test_a_file_in_the_place_of_the_folder_is_one_line(
    call: str, done: Path, tmp_path: Path, command: Command
) -> None:
    (tmp_path / "reports").write_text("mine")
    answer = command(*CALLS[call](done, tmp_path / "reports" / name_of(call)))
    assert answer.code == 2, answer
    assert len(answer.err.splitlines()) == 1 and "reports" in answer.err
    assert (tmp_path / "reports").read_text() == "mine"
