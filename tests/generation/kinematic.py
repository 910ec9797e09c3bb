"""A stand-in for the evaluator where a test needs thousands of episodes: the kinematics of a
cut-in, all rows at once.

The ego drives at 30 m/s and brakes at 8 m/s² while its RSS distances to the other vehicle within 10
m are violated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generation.search.outcomes import Outcomes
from generation.space.space import Space
from recognition.labels.maneuvers.parameters import PARAMETERS
from runner.engine.motion.rss import lateral_distance, longitudinal_distance, parameter_set
from schemas.common.array_types import FloatArray

STEP, LENGTH, WIDTH, LANE, EGO, SENSOR, BRAKE = 0.1, 4.5, 1.8, 3.5, 30.0, 10.0, 8.0
SPACE = Space(tuple(PARAMETERS.values()))


@dataclass
class Kinematic:
    """Counts its calls like the evaluator."""

    calls: int = 0

    def __call__(self, theta: FloatArray) -> Outcomes:
        self.calls += len(theta)
        gap, v0, t0, v1, duration, v2, rest = theta.T
        n, rss = len(theta), parameter_set("ad-rss")
        ahead, ego, end = gap - (v0 - EGO) * t0 + LENGTH, np.full(n, EGO), t0 + duration + rest
        steps, risky, least = np.zeros(n), np.zeros(n), np.full(n, np.inf)
        collision = np.zeros(n, bool)
        for number in range(int(28.0 / STEP)):
            t = number * STEP
            active = (t < end) & ~collision
            share = np.clip((t - t0) / duration, 0.0, 1.0)
            speed = np.where(
                share < 1.0,
                v0 + share * (v1 - v0),
                v1 + np.clip((t - t0 - duration) / 2.0, 0.0, 1.0) * (v2 - v1),
            )
            aside = LANE * (1.0 - share)
            drift = np.where((share > 0.0) & (share < 1.0), LANE / duration, 0.0)
            between, beside = (
                np.maximum(np.abs(ahead) - LENGTH, 0.0),
                np.maximum(aside - WIDTH, 0.0),
            )
            safe = np.where(
                ahead > 0,
                longitudinal_distance(ego, speed, rss),
                longitudinal_distance(speed, ego, rss),
            )
            danger = (between < safe) & (
                beside < lateral_distance(drift, 0.0, rss.response_other, rss.response, rss)
            )
            steps += active
            risky += active & danger
            collision |= active & (between == 0.0) & (beside == 0.0)
            closing = (ego - speed) * (ahead > 0) * (beside == 0.0)
            least = np.where(
                active & (closing > 0),
                np.minimum(least, between / np.maximum(closing, 1e-9)),
                least,
            )
            braking = danger & (between < SENSOR) & (ahead > 0)
            ego = np.where(braking, np.maximum(ego - BRAKE * STEP, 0.0), ego)
            ahead = ahead + (speed - ego) * STEP
        return Outcomes.of(
            n,
            collision=collision,
            r_risk=risky / np.maximum(steps, 1.0),
            min_ttc=np.where(collision, 0.0, least),
            end_time=steps * STEP,
        )


def driven(n: int, seed: int = 0) -> FloatArray:
    """Parameters (n, 7) as traffic has them: the three speeds depend on one
    another, gaps on the speed.
    """
    generator = np.random.default_rng(seed)
    start = generator.normal(29.0, 3.5, n)
    end = start + generator.normal(0.3, 1.0, n)
    gap = np.exp(generator.normal(3.2, 0.5, n)) * start / 29.0
    times = generator.gamma([6.0, 20.0, 6.0], [0.6, 0.23, 0.6], (n, 3))
    rows = np.column_stack(
        [
            gap,
            start,
            times[:, 0],
            end,
            times[:, 1],
            end + generator.normal(0.0, 1.5, n),
            times[:, 2],
        ]
    )
    return SPACE.clip(rows)
