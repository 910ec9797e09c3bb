"""Fixtures shared by all tests."""

from __future__ import annotations

import gc
import math
import os
import sys
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

from schemas.common.packages import SAFE_PATH
from schemas.common.terminal import command_line
from tests.commands import Answer, Command, main

settings.register_profile("suite", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "suite"))

# Read when numpy and torch are loaded. Tests run in processes beside each
# other: more threads in each would only spin.
for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Import all tests without looking for garbage, a sixth of that time, and leave what they hold
    out of every later search.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()
        gc.set_threshold(
            50_000, 20, 20
        )  # what tests leave is little beside what searching for it takes: a tenth of all time


_LEFT_OUT = pytest.StashKey[int]()
_BY_NAME = ("study", "every")
"""Marks of tests that run only where `-m` names them"""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out studies where `-m` does not name them: an expression on the command line, as that
    of a room's tests, takes the place of the one in pyproject.toml.
    """
    unnamed = [mark for mark in _BY_NAME if mark not in config.getoption("markexpr")]
    left = [item for item in items if any(map(item.get_closest_marker, unnamed))]
    if left:
        config.hook.pytest_deselected(items=left)
        items[:] = [item for item in items if item not in left]


def pytest_deselected(items: Sequence[pytest.Item]) -> None:
    """Count the slow tests that are left out."""
    slow = sum(item.get_closest_marker("slow") is not None for item in items)
    if slow:
        stash = items[0].config.stash
        stash[_LEFT_OUT] = stash.get(_LEFT_OUT, 0) + slow


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Send the number of slow tests to the main process."""
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["slow"] = session.config.stash.get(_LEFT_OUT, 0)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Every worker collects, and leaves out, the same."""
    node.config.stash[_LEFT_OUT] = getattr(node, "workeroutput", {}).get("slow", 0)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say how many slow tests did not run."""
    if slow := terminalreporter.config.stash.get(_LEFT_OUT, 0):
        terminalreporter.write_line(f"{slow} slow tests were left out; make test-slow runs them")


def _shared(name: str) -> Path:
    folder = SHARED / name
    if not folder.is_dir():
        pytest.skip(f"the development folder shared/{name} is not beside this checkout")
    return folder


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """A command by its name, in this process."""

    def call(name: str, *arguments: object) -> Answer:
        monkeypatch.setattr(sys, "path", list(sys.path))
        monkeypatch.setattr(sys, "meta_path", list(sys.meta_path))
        monkeypatch.setenv(SAFE_PATH, os.environ.get(SAFE_PATH, ""))
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        # On a busy machine lines about progress would come among those that tests compare.
        monkeypatch.setattr(command_line, "_PATIENCE", math.inf)
        with pytest.raises(SystemExit) as end:
            main(name)()
        return Answer(int(end.value.code or 0), *capsys.readouterr())

    return call


@pytest.fixture(scope="session")
def corpora() -> Path:
    """Public scenario libraries (ALKS, Euro NCAP 2023, esmini), present in
    development and CI only.
    """
    return _shared("corpora")


@pytest.fixture(scope="session")
def reference() -> Path:
    """Reference trajectories of those libraries, present in development and CI only."""
    return _shared("reference")


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Recordings of real traffic (TAF-BW, NGSIM), present in development and CI only."""
    return _shared("data")
