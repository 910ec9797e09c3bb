"""What Windows and macOS do otherwise, simulated: their paths, processes that
are spawned, modules that are not there.
"""

from __future__ import annotations

import ast
import errno
import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import runner
import schemas
from runner.batch.jobs import Job, Outcome
from runner.batch.journal import Journal
from runner.judging.settings import RunSettings
from schemas.catalogs import locate, referred
from schemas.common import policy
from schemas.common.errors import InvalidFile, UsageError
from schemas.common.policy import CommandPolicy, in_force
from schemas.common.storage import in_any_case, keep
from tests.runner.files import distribution, scenario

ROOT = Path(__file__).parents[1]
PACKAGES = ("schemas", "xosc", "xodr", "runner", "recognition", "generation", "studies")
MODULES = [module for package in PACKAGES for module in sorted((ROOT / package).rglob("*.py"))]
SETTINGS = RunSettings(world="kinematic", sut="none", max_time=0.5)
NOT_ON_WINDOWS = {"fcntl", "grp", "posix", "pwd", "resource", "termios", "tty", "syslog"}
NOT_OF_OS = {
    "fork",
    "forkpty",
    "getuid",
    "geteuid",
    "getpgid",
    "killpg",
    "mkfifo",
    "setsid",
    "sched_getaffinity",
    "uname",
}
TEXTS = {"open": 1, "read_text": 0, "write_text": 1}
"""What reads and writes texts, by the place of the argument before or at which
the encoding is looked for.
"""


@cache
def calls() -> list[tuple[str, str, ast.Call]]:
    """What reads, writes or opens texts in all modules: where it is, what it is
    called, and the call.
    """
    return [
        (f"{module.relative_to(ROOT)}:{node.lineno}", called, node)
        for module in MODULES
        for source in [module.read_text("utf-8")]
        if any(each in source for each in TEXTS)
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Call)
        for called in [_called(node.func)]
        if called in TEXTS
    ]


def _called(function: ast.expr) -> str:
    """Name of a function `open`, or of a method."""
    if isinstance(function, ast.Attribute):
        return function.attr if function.attr != "open" else ""
    return function.id if isinstance(function, ast.Name) and function.id == "open" else ""


def is_binary(call: ast.Call) -> bool:
    """Whether a call opens a file for bytes."""
    modes = [
        each.value
        for each in call.args
        if isinstance(each, ast.Constant) and isinstance(each.value, str)
    ]
    return any("b" in mode for mode in modes)


def test_texts_have_an_encoding() -> None:
    """Windows would take its own code page."""
    found = [
        place
        for place, called, call in calls()
        if called in ("read_text", "write_text")
        and len(call.args) <= TEXTS[called]
        and not any(keyword.arg in ("encoding", None) for keyword in call.keywords)
    ]
    opened = [
        place
        for place, called, call in calls()
        if called == "open"
        and not is_binary(call)
        and not any(keyword.arg == "encoding" for keyword in call.keywords)
    ]
    assert found + opened == []


def test_texts_have_the_same_ends_of_lines_everywhere() -> None:
    found = [
        place
        for place, called, call in calls()
        if called == "write_text"
        and not any(keyword.arg in ("newline", None) for keyword in call.keywords)
    ]
    assert found == []


def test_a_file_that_is_read_while_another_writes_the_same_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "cached"

    def replace(draft: Path, target: Path) -> Path:
        target.write_bytes(first)
        raise PermissionError(errno.EACCES, "it is open", str(target))

    monkeypatch.setattr(Path, "replace", replace)
    first = b"the same"
    assert keep(b"the same", path) == path and list(tmp_path.iterdir()) == [path]
    path.unlink()
    first = b"another"
    with pytest.raises(PermissionError):
        keep(b"the same", path)
    assert list(tmp_path.iterdir()) == [path]


def test_the_journal_of_a_batch_is_written_as_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flags: list[int] = []
    real = os.open
    monkeypatch.setattr(os, "O_BINARY", 0x8000, raising=False)
    monkeypatch.setattr(
        os,
        "open",
        lambda path, flag, mode=0o777: (flags.append(flag), real(path, flag & ~0x8000, mode))[1],
    )
    Journal(tmp_path, {}).enter(Outcome(Job("a", Path("a.xosc"), Path("a.xosc")), "passed", 0))
    assert [flag for flag in flags if flag & os.O_APPEND] and all(
        flag & 0x8000 for flag in flags if flag & os.O_APPEND
    )


def test_nothing_needs_what_windows_lacks() -> None:
    """What is not there is imported only where its absence is caught, and called
    only under POSIX.
    """
    found = []
    for module in MODULES:
        source = module.read_text("utf-8")
        if not any(each in source for each in NOT_ON_WINDOWS | NOT_OF_OS):
            continue
        tree = ast.parse(source)
        caught = {
            each
            for node in ast.walk(tree)
            if isinstance(node, ast.Try)
            for part in node.body
            for each in ast.walk(part)
        }
        guarded = {
            each
            for node in ast.walk(tree)
            if isinstance(node, ast.If) and "posix" in ast.unparse(node.test).lower()
            for part in node.body
            for each in ast.walk(part)
        }
        for node in ast.walk(tree):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [str(node.module)] if isinstance(node, ast.ImportFrom) else []
            if NOT_ON_WINDOWS.intersection(names) and node not in caught:
                found.append(f"{module.relative_to(ROOT)}:{node.lineno}: {names}")
            if (
                isinstance(node, ast.Attribute)
                and isinstance(node.value, ast.Name)
                and node.value.id == "os"
                and (node.attr in NOT_OF_OS)
                and node not in guarded
            ):
                found.append(f"{module.relative_to(ROOT)}:{node.lineno}: os.{node.attr}")
    assert found == []


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        (r"..\maps\town.xodr", "/project/scenarios/../maps/town.xodr"),
        ("file:///maps/town%20one.xodr", "/maps/town one.xodr"),
        ("FILE://localhost/maps/town.xodr", "/maps/town.xodr"),
        ("file:///C:/maps/town.xodr", "/project/scenarios/C:/maps/town.xodr"),
        ("file:maps/town.xodr", "/project/scenarios/maps/town.xodr"),
        ("maps/100%25.xodr", "/project/scenarios/maps/100%25.xodr"),
    ],
)
def test_paths_as_other_systems_write_them(written: str, meant: str) -> None:
    assert referred(Path("/project/scenarios/a.xosc"), written) == Path(meant)


@pytest.mark.parametrize(
    "written",
    [r".\Straight.XODR", r"C:\Users\me\maps\straight.xodr", "file:///C:/maps/straight.xodr"],
)
def test_a_road_of_another_system_is_found_and_said(written: str, tmp_path: Path) -> None:
    path = scenario(tmp_path)
    path.write_text(
        path.read_text("utf-8").replace('filepath="straight.xodr"', f'filepath="{written}"'),
        "utf-8",
    )
    (remark,) = runner.run(path, SETTINGS).remarks
    assert str(tmp_path / "straight.xodr") in remark and "is taken" in remark


def test_a_road_in_a_folder_that_was_asked_for_is_found_in_other_case(tmp_path: Path) -> None:
    path = scenario(tmp_path)
    (tmp_path / "maps").mkdir()
    (tmp_path / "straight.xodr").rename(tmp_path / "maps" / "Straight.XODR")
    (remark,) = runner.run(path, SETTINGS, road_path=(str(tmp_path / "maps"),)).remarks
    assert f"{tmp_path / 'maps' / 'Straight.XODR'} is taken" in remark


def test_letters_of_windows_are_read(tmp_path: Path) -> None:
    """Editors there write windows-1252 into files that say UTF-8, or nothing."""
    path = scenario(tmp_path)
    sound = path.read_text("utf-8")
    path.write_bytes(
        sound.replace("<RoadNetwork", "<!-- Über – 1 € --><RoadNetwork").encode("windows-1252")
    )
    (remark,) = runner.run(path, SETTINGS).remarks
    line = sound[: sound.index("<RoadNetwork")].count("\n") + 1
    assert remark.startswith(f"{path}:{line}: this is not UTF-8; the file is read as windows-1252")
    with pytest.raises(InvalidFile, match="this is not UTF-8"):
        runner.run(path, SETTINGS, strict=True)
    path.write_bytes(sound.replace("<RoadNetwork", "<!-- Ü -->\x81<RoadNetwork").encode("latin-1"))
    with pytest.raises(InvalidFile, match="Invalid bytes"):
        runner.run(path, SETTINGS)


def test_a_catalogue_folder_in_other_case_is_found_and_said(tmp_path: Path) -> None:
    (tmp_path / "maps" / "Vehicles").mkdir(parents=True)
    (tmp_path / "maps" / "Vehicles" / "cars.XOSC").touch()
    found = locate(tmp_path / "Maps" / "vehicles", tmp_path / "a.xosc")
    assert found.files == [str(tmp_path / "maps" / "Vehicles" / "cars.XOSC")]
    assert found.assumed.endswith(f"{tmp_path / 'maps' / 'Vehicles'} is taken, by its name")


def test_checks_name_a_file_that_differs_in_case(tmp_path: Path) -> None:
    path = scenario(tmp_path)
    path.write_text(
        path.read_text("utf-8").replace('filepath="straight.xodr"', 'filepath="Straight.xodr"'),
        "utf-8",
    )
    (problem,) = [each for each in schemas.check(path) if "Straight.xodr" in each.message]
    assert (
        problem.level == "error"
        and f"{tmp_path / 'straight.xodr'} differs in upper and lower case" in problem.message
    )


def test_checks_name_a_folder_in_the_place_of_a_file(tmp_path: Path) -> None:
    path = scenario(tmp_path)
    text = path.read_text("utf-8").replace('filepath="straight.xodr"', 'filepath="."')
    path.write_text(text, "utf-8")
    (problem,) = [each for each in schemas.check(path) if "there is no file" in each.message]
    assert problem.message.endswith(": this is a folder")


def test_two_names_that_differ_in_case_are_no_answer(tmp_path: Path) -> None:
    for name in ("road.xodr", "ROAD.xodr"):
        (tmp_path / name).touch()
    assert in_any_case(tmp_path / "Road.xodr") is None
    assert in_any_case(tmp_path / "ROAD.xodr") == tmp_path / "ROAD.xodr"
    assert in_any_case(tmp_path / "nothing" / "x") is None


def test_without_the_module_that_limits_memory_the_option_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(policy, "resource", None)
    with (
        pytest.raises(UsageError, match="leave --max-memory and --max-seconds out"),
        in_force(CommandPolicy(max_memory=1.0)),
    ):
        pass


SPAWNED = """
import multiprocessing, sys
from runner.xosc_run import main

if __name__ == "__main__":
    multiprocessing.set_start_method("spawn")
    main()
"""


@pytest.mark.slow
def test_spawned_processes_give_the_same_bytes(tmp_path: Path) -> None:
    """As on Windows and macOS, where nothing of the parent's memory is there."""
    scenario(tmp_path / "files")
    path = distribution(tmp_path / "files", "gaps", {"Gap": (70, 90, 10)})
    script = tmp_path / "spawned.py"
    script.write_text(SPAWNED, "utf-8")
    for name, jobs in (("one", "1"), ("two", "2")):
        arguments = [
            str(path),
            "--out",
            str(tmp_path / name),
            "--jobs",
            jobs,
            "--world",
            "kinematic",
            "--sut",
            "none",
            "--quiet",
        ]
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        done = subprocess.run(
            [sys.executable, str(script), *arguments],
            capture_output=True,
            text=True,
            env=environment,
        )
        assert done.returncode == 0, done.stderr
    files = sorted(
        file.relative_to(tmp_path / "one") for file in (tmp_path / "one").rglob("*.parquet")
    )
    assert len(files) > 3
    assert all(
        (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes()
        for file in files
    )
