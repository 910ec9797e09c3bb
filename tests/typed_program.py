"""A small program on the installed packages: a strict type checker must accept
it, and know the type of what it returns.
"""

from pathlib import Path
from typing import assert_type

import runner
import schemas
import xodr
import xosc
import xosc_toolchain as xt
from runner import RunResult, RunSettings
from runner.engine.compile.element import EntityCondition
from runner.engine.compile.protocols import Instant
from runner.engine.participants.boxes import gap
from runner.engine.participants.entity import Entity


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


class Near(EntityCondition):
    """Holds while anyone else is near, as a condition of a package does."""

    def holds(self, entity: Entity, run: Instant) -> bool:
        """Whether a box is nearer than 2 m."""
        others = (other for other in run.entities.values() if other is not entity)
        return any(other.active and other.placed and gap(entity, other) < 2.0 for other in others)

    def describe(self, entity: Entity, run: Instant) -> str:
        """Its name."""
        return entity.name


assert_type(runner.__version__, str)
