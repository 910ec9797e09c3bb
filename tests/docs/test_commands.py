"""What the README, the tutorials and the pages on extending say can be typed is
typed here, in the order of the page.

The README and the tutorials are played one after the other in one folder that has the libraries
where a clone has them, as a reader types them. The pages on extending are played together in one
copy of the clone, where their files are found as any other's. Blocks are

- `sh`: a command a line, which ends with 0, or with what its comment says (`# exit code 1`), or
  is ended (`# Ctrl-C`) when it has printed a line;
- any language whose first line is a comment with nothing but a file's name or path: saved there;
- `python` otherwise: run as a program;
- `text`: printed by the block before, line by line, in any order; `…` stands for anything.

Files that the page names in its text have to be there in the end; commands that it names there are
in a block, or listed below.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.commands import SCRIPTS, Command, as_of_a_terminal
from tests.xodr.formats.test_converting import STREETS

ROOT = Path(__file__).parents[2]
EXTENDING = sorted((ROOT / "docs" / "extending").glob("*.md"))
TUTORIALS = ROOT / "docs" / "tutorials"
READING = [ROOT / "README.md", TUTORIALS / "README.md"]
READING += [
    TUTORIALS / page
    for page in re.findall(
        r"\]\(([\w-]+\.md)\)", (TUTORIALS / "README.md").read_text(encoding="utf-8")
    )
]
"""The README, and the tutorials in the order of their list."""
ROADS = ROOT / "docs" / "roads.md"
PAGES = [*READING, *EXTENDING]
PRODUCT = ("schemas", "xosc", "xodr", "runner", "recognition", "generation", "studies")

NOT_RUN = {
    "xosc-explore own/mine.xosc --sut adas": "serves a page until it is interrupted",
    "xosc-export FILE --to 1.3 --out DIR": "stands for any file; test_xosc_export writes files of other versions",
    "make compiled": "takes minutes; continuous integration runs it each week",
    "git clone https://example.org/xosc-toolchain": "needs an address that is not there yet",
    "make -C xosc-toolchain demo": (
        "installs everything anew; what it consists of is in the tutorials"
    ),
    "make -C xosc-toolchain test": "is what runs the tests",
    "python -m benchmarks.install_sizes": "needs a package index, and takes minutes",
    "make docs": (
        "installs everything anew; test_reference and tests/studies/test_coverage "
        "compare what it writes"
    ),
    'pip install ".[all]"': "is what make install does, but for development",
    "pip install -e acme": (
        "needs a package index; tests/xosc_toolchain/test_plugin.py installs the package"
    ),
    "python -m pytest acme": "tests/xosc_toolchain/test_plugin.py runs the tests of all kinds",
    "make lint types test docs": "installs everything anew; continuous integration runs it",
    "pip install .": (
        "continuous integration installs the wheel into an empty environment and "
        "runs a scenario there"
    ),
    'pip install "xosc-toolchain[osi]"': (
        "needs a package index; the extra is a part of the one for development"
    ),
    "xosc-generate CATALOGUE --out DIR": (
        "needs a catalogue of 30 manoeuvres or more; "
        "tests/generation/space/test_recorded.py has one"
    ),
}
"""Commands that are not run here, and why."""

LANGUAGES = {"sh", "python", "text", "xml", "toml", "yaml"}
_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_FILE = re.compile(r"(?:# |<!-- )((?:[\w-]+/)*[\w.-]+\.\w+)(?: -->)?")
_NAMED = re.compile(
    r"(?<!`)`((?:[\w.*-]+/)*[\w*-]+\.(?:xosc|xodr|html|json|jsonl|parquet|csv|png|gif|mcap|sarif|xml|md|py|yml))`"
)
_MENTIONED = re.compile(r"`((?:xosc-\w+|make|pip|python|sumo-gui) [^`]+)`")
_SHELL = re.compile(r"[|<>&;$`~]")
_PLACEHOLDER = re.compile(r"NAME|SITE|CLASS|FILE")
_TEST = "python -m pytest "
_SECONDS = 600


class Block(NamedTuple):
    """A block of code: its language and its text."""

    language: str
    text: str

    @property
    def file(self) -> str | None:
        """Name or path of the file that it is, if any."""
        named = _FILE.fullmatch(self.text.partition("\n")[0])
        return named[1] if named else None

    @property
    def commands(self) -> list[str]:
        """Commands of a shell's block, with their comments."""
        lines = self.text.replace("\\\n", " ").splitlines() if self.language == "sh" else []
        return [line for line in lines if line.strip()]


def blocks(page: Path) -> list[Block]:
    """The blocks of code of a page."""
    return [Block(*found) for found in _BLOCK.findall(page.read_text(encoding="utf-8"))]


def prose(page: Path) -> str:
    """A page without its blocks."""
    return _BLOCK.sub("", page.read_text(encoding="utf-8"))


def bare(command: str) -> str:
    """A command without its comment."""
    return command.partition(" #")[0].strip()


def typed(page: Path) -> list[str]:
    """The commands of a page."""
    return [bare(command) for block in blocks(page) for command in block.commands]


TYPED = {command for page in PAGES for command in typed(page)}
MENTIONED = {command for page in PAGES for command in _MENTIONED.findall(prose(page))}


def name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


Do = Callable[[str], tuple[int, str]]
"""Does a command line or runs a program: its exit code and output."""


@pytest.fixture
def do(tmp_path: Path, command: Command) -> Do:
    """Does command lines: our own commands in this process, which has their
    libraries, others in a shell.
    """

    def do(line: str) -> tuple[int, str]:
        name, *arguments = shlex.split(line)
        if name not in SCRIPTS or _SHELL.search(line):
            return call(["bash", "-c", line], tmp_path)
        answer = command(
            name, *(found for argument in arguments for found in expanded(argument, tmp_path))
        )
        return answer.code, answer.out + answer.err

    return do


@pytest.fixture
def execute(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Do:
    """Runs programs in this process, which finds modules beside them as Python does."""

    def execute(program: str) -> tuple[int, str]:
        monkeypatch.syspath_prepend(str(tmp_path))
        exec(compile(program, "a program of the page", "exec"), {"__name__": "__main__"})
        return 0, capsys.readouterr().out

    return execute


def expanded(argument: str, folder: Path) -> list[str]:
    """What a shell makes of an argument with wildcards."""
    found = sorted(folder.glob(argument)) if "*" in argument else []
    return [path.relative_to(folder).as_posix() for path in found] or [argument]


def call(
    arguments: list[str], folder: Path, environment: Mapping[str, str] | None = None
) -> tuple[int, str]:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        arguments,
        cwd=folder,
        env=os.environ | {"PATH": path, "COLUMNS": "120"} | (environment or {}),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=_SECONDS,
    )
    return done.returncode, done.stdout


def play(page: Path, folder: Path, do: Do, execute: Do) -> None:
    """Do what a page says."""
    printed = ""
    for block in blocks(page):
        if block.file is not None:
            (folder / block.file).write_text(block.text, encoding="utf-8")
        elif block.language == "sh":
            printed = "".join(answers(block, do))
        elif block.language == "python":
            code, printed = execute(block.text)
            assert code == 0, printed
        elif block.language == "text":
            missing = [line for line in block.text.splitlines() if not is_printed(line, printed)]
            assert not missing, printed


def answers(block: Block, do: Do) -> Iterator[str]:
    """What the commands of a block print; each has to end with the code that is announced."""
    for command in block.commands:
        if bare(command) not in NOT_RUN:
            announced = re.search(r"exit code (\d)", command)
            ended = "Ctrl-C" in command.partition(" #")[2]
            code, printed = (interrupted if ended else do)(bare(command))
            assert code == (int(announced[1]) if announced else 0), f"{command}: {printed}"
            yield printed


def interrupted(line: str) -> tuple[int, str]:
    """Exit code and first line of a command that is ended by Ctrl-C."""
    name, *arguments = shlex.split(line)
    program = [Path(sys.executable).with_name(name), *arguments]
    with subprocess.Popen(
        program, stdout=subprocess.PIPE, text=True, preexec_fn=as_of_a_terminal
    ) as process:
        assert process.stdout is not None
        try:
            first = process.stdout.readline()
            process.send_signal(signal.SIGINT)
            return process.wait(_SECONDS), first
        finally:
            process.kill()  # leaving the block waits for it


def is_printed(line: str, printed: str) -> bool:
    pattern = ".*".join(re.escape(part) for part in line.rstrip().split("…"))
    return any(re.fullmatch(pattern, given.rstrip()) for given in printed.splitlines())


def require_named_files(page: Path, folder: Path) -> None:
    """What a page names in its text has to be there after it was played."""
    named = {one for one in _NAMED.findall(prose(page)) if not _PLACEHOLDER.search(one)}
    there = {path.relative_to(folder).as_posix() for path in folder.rglob("*")}
    lost = [
        one
        for one in sorted(named)
        if not any(Path(path).match(one) for path in there) and not list(ROOT.glob(one))
    ]
    assert not lost


@pytest.mark.slow
def test_readme_and_tutorials_do_what_they_say_one_after_the_other(
    tmp_path: Path, do: Do, execute: Do, monkeypatch: pytest.MonkeyPatch
) -> None:
    for library in ("xosc/library", "xodr/library"):
        shutil.copytree(ROOT / library, tmp_path / library)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")
    for constant, fewer in (
        ("_MOST", 2),
        ("_STARTS", 1),
    ):  # how well densities fit is for tests/generation/space/density
        monkeypatch.setattr(f"generation.space.density.models.mixtures.{constant}", fewer)
    for page in READING:
        try:
            play(page, tmp_path, do, execute)
            require_named_files(page, tmp_path)
        except AssertionError as error:
            error.add_note(f"in {name(page)}")
            raise


@pytest.mark.slow
def test_the_page_on_roads_does_what_it_says(
    tmp_path: Path, do: Do, execute: Do, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(ROOT / "xodr" / "library", tmp_path / "xodr" / "library")
    (tmp_path / "streets.osm").write_text(STREETS, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert len(typed(ROADS)) >= 10
    play(ROADS, tmp_path, do, execute)


def test_reading_has_every_tutorial_once() -> None:
    assert sorted(READING) == sorted({ROOT / "README.md", *TUTORIALS.glob("*.md")})


@pytest.mark.slow
def test_pages_on_extending_do_what_they_say(tmp_path: Path) -> None:
    """In a clone that has the new kinds of all pages; their tests are run at once."""
    for part in (*PRODUCT, "tests"):
        shutil.copytree(ROOT / part, tmp_path / part)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    environment = {"PYTHONPATH": str(tmp_path)}
    files = [block for page in EXTENDING for block in blocks(page) if block.file is not None]
    for block in files:
        (tmp_path / str(block.file)).write_text(block.text, encoding="utf-8")
    tests = [
        line.removeprefix(_TEST)
        for page in EXTENDING
        for line in typed(page)
        if line.startswith(_TEST)
    ]
    assert tests
    code, printed = call([*shlex.split(_TEST), *tests], tmp_path, environment)
    assert code == 0, printed

    def do(line: str) -> tuple[int, str]:
        return (
            (0, printed)
            if line.startswith(_TEST)
            else call(["bash", "-c", line], tmp_path, environment)
        )

    def execute(program: str) -> tuple[int, str]:
        return call([sys.executable, "-c", program], tmp_path, environment)

    for page in EXTENDING:
        play(page, tmp_path, do, execute)
        require_named_files(page, tmp_path)


@pytest.mark.parametrize(
    "page",
    [page for page in EXTENDING if page.stem not in ("README", "version")],
    ids=name,
)
def test_a_kind_is_one_file_its_test_and_its_scenario(page: Path) -> None:
    """Files that were there before are not touched: a page shows all that is
    new, and it is enough for the page to work.
    """
    files = [block.file for block in blocks(page) if block.file is not None]
    assert not [file for file in files if (ROOT / file).exists()]
    assert len([file for file in files if file.startswith(PRODUCT)]) == 1
    assert len([file for file in files if re.fullmatch(r"tests/.*test_\w+\.py", file)]) == 1
    assert len([file for file in files if file.endswith(".xosc")]) <= 1
    others = [
        block.file
        for other in EXTENDING
        if other != page
        for block in blocks(other)
        if block.file is not None
    ]
    assert not [
        file
        for file in others
        if file.removesuffix(".py").replace("/", ".") in page.read_text(encoding="utf-8")
    ]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_block_says_what_it_is(page: Path) -> None:
    assert {block.language for block in blocks(page)} <= LANGUAGES


def test_what_is_not_run_is_listed_with_its_reason() -> None:
    assert set(NOT_RUN) <= TYPED | MENTIONED
    assert TYPED | set(NOT_RUN) >= MENTIONED
    assert {shlex.split(command)[0] for command in TYPED - set(NOT_RUN)} <= {
        *SCRIPTS,
        "python",
        "cp",
        "mkdir",
        "sed",
    }


@pytest.mark.parametrize(
    "command",
    [command for command in NOT_RUN if command.startswith("make ") and "-C" not in command],
)
def test_make_has_the_target(command: str) -> None:
    planned = subprocess.run(
        ["make", "--dry-run", *command.split()[1:]], cwd=ROOT, capture_output=True, text=True
    )
    assert planned.returncode == 0, planned.stderr


def test_readme_shows_every_command() -> None:
    shown = {
        bare(command).split()[0]
        for block in blocks(ROOT / "README.md")
        for command in block.commands
    }
    assert shown >= set(SCRIPTS)
