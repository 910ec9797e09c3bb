"""The system under test `sumo`: SUMO's own driver."""

from __future__ import annotations

from runner.sut.base import WorldDriven

SYSTEM = ("sumo", "SumoDriver")


class SumoDriver(WorldDriven):
    """SUMO's car-following (Krauss) and lane-changing (LC2013) models drive the ego along its route or the straightest way.

    The scripted speed is what it wants: it keeps its distance from others, yields at junctions, obeys traffic lights and
    overtakes. `runner.worlds.sumo_simulation` says how its models are set, `runner.interpreter.drivers.WorldDriver` how it
    combines with scripted actions.
    """
