"""Systems under test that decide nothing themselves: commands of a caller, a script of a test, or
SUMO's own driver (`sumo`)."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field

from runner.systems.base import Control, Observation, Participant, Pose, WorldDriven

SYSTEMS = {
    "sumo": ("SumoDriver", "SUMO's driver: keeps distance, yields, obeys lights, changes lanes"),
}


@dataclass(slots=True)
class Commanded:
    """Answers with a fixed command.

    Args:
        command: what the ego does in each step until it is replaced; by default all is left to the
            scenario.
    """

    command: Control | Pose = field(default_factory=Control)

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Each run begins with all left to the scenario."""
        self.command = Control()

    def control(self, observation: Observation, dt: float) -> Control | Pose:
        """The command."""
        return self.command


@dataclass(frozen=True, slots=True)
class Scripted:
    """Plays a script, whatever it sees: `runner.run(scenario, sut=Scripted([(1.0,
    Control(acceleration=-2.0))]))`.

    Args:
        script: time (s) and control from that time on, in ascending order; before the first it
            leaves all to the scenario.
    """

    script: Sequence[tuple[float, Control | Pose]] = ()

    def reset(self, ego: Participant, timestep: float, seed: int) -> None:
        """Do nothing: a script has no state."""

    def control(self, observation: Observation, dt: float) -> Control | Pose:
        """Return the scripted answer for this time."""
        # Simulation time is a sum of steps: a script's time may be missed by rounding.
        index = bisect_right(self.script, observation.time + 1e-9, key=lambda entry: entry[0])
        return self.script[index - 1][1] if index else Control()


class SumoDriver(WorldDriven):
    """SUMO's car-following (Krauss) and lane-changing (LC2013) models drive the ego along its route
    or the straightest way.

    The scripted speed is what it wants: it keeps its distance from others, yields at junctions,
    obeys traffic lights and overtakes. `runner.engine.worlds.sumo_simulation` says how its models
    are set, `runner.systems.drivers.WorldDriver` how it combines with scripted actions.
    """
