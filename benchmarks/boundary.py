"""Cost of a step with a class of the user in a process of its own, against the same class in the
process of the run.

    python -m benchmarks.boundary [--steps N] [--rounds N]

Scripted cars on a motorway, and a class that follows by the Intelligent Driver Model, so that it
does some work. Runs with and without the boundary take turns; the least time by the clock counts,
because the run waits for the other process. The first run of a process, which imports the class, is
measured by itself.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from time import perf_counter

from runner.judging.execution import Prepared, prepare
from runner.judging.settings import RunSettings
from runner.systems.isolation.boundary import release
from runner.systems.kinds.idm import IntelligentDriver
from tests.runner.files import car, place, scenario

COUNTS = (2, 6, 20)
TIMESTEP = 0.05
SYSTEM = "benchmarks.boundary:Follower"


class Follower(IntelligentDriver):
    """The package's driver as a class of another package."""


def main() -> None:
    """Print the cost of a step both ways, and the ratio."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("--steps", type=int, default=1000)
    arguments.add_argument("--rounds", type=int, default=7)
    options = arguments.parse_args()
    print(f"{'participants':14}{'in process':>14}{'boundary':>14}{'ratio':>8}{'more':>12}")
    with tempfile.TemporaryDirectory() as folder:
        for count in COUNTS:
            prepared = _scenario(Path(folder), count, options.steps)
            inside, outside = _times(prepared, options.steps, options.rounds)
            more = (outside - inside) * 1e6
            print(
                f"{count:<14}{inside * 1e6:11.1f} µs{outside * 1e6:11.1f} "
                f"µs{outside / inside:8.2f}{more:9.1f} µs"
            )
        prepared = _scenario(Path(folder), 2, 1)
        starts = [_start(prepared) for _ in range(options.rounds)]
    print(f"start of a process, once for each worker: {min(starts) * 1e3:.0f} ms")
    release()


def _scenario(folder: Path, count: int, steps: int) -> Prepared:
    names = ["Ego", *(f"Car{number}" for number in range(1, count))]
    init = "".join(
        place(name, 100 + 40 * (number // 2), 20 + 0.1 * number, -1 - number % 2)
        for number, name in enumerate(names)
    )
    path = scenario(
        folder,
        f"cars{count}",
        entities=[car(name) for name in names],
        init=init,
        stop=steps * TIMESTEP,
    )
    return prepare(path)


def _times(prepared: Prepared, steps: int, rounds: int) -> tuple[float, float]:
    """Least seconds a step in this process, and in another."""
    times: dict[bool, list[float]] = {True: [], False: []}
    for _ in range(rounds + 1):
        for in_process, found in times.items():
            settings = RunSettings(
                TIMESTEP,
                SYSTEM,
                world="kinematic",
                sut_in_process=in_process,
                end_after_collision=False,
            )
            begun = perf_counter()
            prepared.run(settings)
            found.append((perf_counter() - begun) / steps)
    return min(times[True][1:]), min(times[False][1:])


def _start(prepared: Prepared) -> float:
    """Seconds that the first run of a process takes."""
    release()
    begun = perf_counter()
    prepared.run(RunSettings(TIMESTEP, SYSTEM, world="kinematic", max_time=TIMESTEP))
    return perf_counter() - begun


if __name__ == "__main__":
    main()
