"""A small program as users write it; CI checks its types against the installed wheel, where `py.typed` must be."""

from __future__ import annotations

from pathlib import Path

import recognition
import runner
import schemas
import xodr
import xosc
from runner.sut import Control, Observation


class Cautious:
    """Brakes gently when it is faster than 10 m/s."""

    def reset(self, ego: object, timestep: float, seed: int) -> None:
        """Nothing to forget."""

    def control(self, observation: Observation, dt: float) -> Control:
        """Less speed."""
        return Control(acceleration=-1.0, reason="too fast") if observation.ego.speed > 10.0 else Control()


def main() -> None:
    """Check, load and run a scenario."""
    scenario = Path(xosc.__file__).parent / "library" / "highway_cut_in.xosc"
    problems = [problem.message for problem in schemas.check(scenario)]
    version: tuple[int, int] = xosc.load(scenario).version
    result = runner.run(scenario, sut="none", timestep=0.1)
    passed: bool = result.verdict.passed
    roads: int = len(xodr.load(Path(xodr.__file__).parent / "library" / "highway_straight.xodr").roads)
    print(problems, version, passed, result.end_time, roads, recognition.TRFE)


main()
