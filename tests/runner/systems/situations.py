"""Random situations of traffic for systems under test; hypothesis draws their seeds and sizes."""

from __future__ import annotations

import math
from random import Random

from hypothesis import strategies as st

from runner.engine.participants.declaration import BoundingBox, Performance
from runner.engine.worlds.aspects import Aspect
from runner.engine.worlds.signals_ahead import SignalAhead, StopLine
from runner.engine.worlds.surroundings import Environment
from runner.systems import Observation, Participant

ENVIRONMENTS = (Environment(), Environment(name="rain", friction=0.6))


def participant(name: str, x: float, y: float, rng: Random) -> Participant:
    """A participant at x and y (m), mostly along the x axis."""
    h = rng.choice([0.0, 0.0, 0.05, -0.1, math.pi, rng.uniform(-math.pi, math.pi)])
    speed = rng.choice([0.0, 20.0, rng.uniform(0.0, 40.0), rng.uniform(-5.0, 5.0)])
    pulled = rng.choice([0.0, rng.uniform(-9.0, 3.0)])
    return Participant(
        name,
        rng.choice(["vehicle", "pedestrian"]),
        rng.choice(["car", "truck"]),
        BoundingBox(
            rng.uniform(0.0, 2.0), 0.0, 0.75, rng.uniform(0.4, 12.0), rng.uniform(0.4, 2.6), 1.5
        ),
        x=x,
        y=y,
        z=rng.choice([0.0, 0.0, 0.0, 6.0]),
        h=h,
        speed=speed,
        acceleration=pulled,
        vx=speed * math.cos(h),
        vy=speed * math.sin(h),
        ax=pulled * math.cos(h),
        ay=pulled * math.sin(h),
        odometer=rng.uniform(0.0, 100.0),
        performance=Performance(70.0, 10.0, rng.choice([9.0, math.inf])),
        front_axle=2.8,
        mass=1500.0,
        lights=rng.choice([{}, {"fogLights": "on"}]),
        overrides=rng.choice([{}, {"Brake": 0.5}]),
    )


def situation(seed: int, others: int) -> Observation:
    """An ego near the origin, and so many others within 60 m, sometimes a light."""
    rng = Random(seed)
    ego = participant("Ego", rng.uniform(-2.0, 2.0), 0.0, rng)
    lights = SignalAhead("S1", "1000001", rng.uniform(0.0, 100.0), "on;off;off", Aspect.RED)
    return Observation(
        0.0,
        ego,
        [
            participant(f"Other{number}", rng.uniform(-15.0, 60.0),
                rng.choice([0.0, rng.uniform(-6.0, 6.0)]), rng)
            for number in range(others)
        ],
        rng.choice([ego.speed, ego.speed, 0.0, 25.0, -2.0]),
        None,
        rng.choice(ENVIRONMENTS),
        rng.choice([None, None, StopLine("S1", rng.uniform(-3.0, 120.0))]),
        rng.choice([(), (lights,)]),
    )  # fmt: skip


observations = st.builds(situation, st.integers(0, 1 << 30), st.integers(0, 4))
