"""A small program on the installed packages: a strict type checker must accept it, and know the type of what it returns."""

from pathlib import Path
from typing import assert_type

import runner
import schemas
import xodr
import xosc
import xosc_toolchain as xt
from runner import RunResult, RunSettings


def faults(path: Path) -> list[str]:
    """The messages of the errors in a file."""
    return [problem.message for problem in schemas.check(path) if problem.level == "error"]


def length(path: Path, road: str) -> float:
    """The length of a road in m."""
    return xodr.load(path).roads[road].length


def collides(path: Path) -> bool:
    """Whether any variation of a scenario fails."""
    settings = RunSettings(sut="cas")
    for scenario, parameters in xosc.variations(path):
        result = runner.run(scenario, settings, parameters=parameters)
        assert_type(result, RunResult)
        if result.verdict.passed is False:
            return True
    return False


def stops(path: Path) -> bool:
    """Whether a system with a radar avoids a collision, by the one import for everything."""
    result = xt.run(path, sut="adas")
    assert_type(result, RunResult)
    return result.verdict.passed is True


assert_type(runner.__version__, str)
