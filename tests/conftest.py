"""Fixtures shared by all tests."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Generator
from pathlib import Path

import pytest
from hypothesis import settings

from schemas.common.packages import SAFE_PATH
from tests.commands import Answer, Command, main

settings.register_profile("suite", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "suite"))

# Read when numpy and torch are loaded. Tests run in processes beside each other: more threads in each would only spin.
for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Import all tests without looking for garbage, a sixth of that time, and leave what they hold out of every later search."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


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
        with pytest.raises(SystemExit) as end:
            main(name)()
        return Answer(int(end.value.code or 0), *capsys.readouterr())

    return call


@pytest.fixture(scope="session")
def corpora() -> Path:
    """Public scenario libraries (ALKS, Euro NCAP 2023, esmini), present in development and CI only."""
    return _shared("corpora")


@pytest.fixture(scope="session")
def reference() -> Path:
    """Reference trajectories of those libraries, present in development and CI only."""
    return _shared("reference")


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Recordings of real traffic (TAF-BW, NGSIM), present in development and CI only."""
    return _shared("data")
