"""The ego as a Gymnasium environment: `gymnasium.make("xosc/Scenario-v0", scenario="file.xosc")`,
for learners.

Needs the extra `gym`.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from os import PathLike
from typing import Any, Unpack

import numpy as np

from runner.judging.execution import Prepared, Session, prepare
from runner.judging.result import INCONCLUSIVE, RunResult
from runner.judging.settings import RunSettings, SettingChanges
from runner.systems.base import PEDAL, Control, Observation
from runner.systems.kinds.commanded import Commanded
from runner.systems.outside.learner import (
    EGO,
    PARTICIPANT,
    SIGNAL,
    STATE,
    DrivingReward,
    EgoStep,
    ObservationArrays,
    RewardFunction,
    Rows,
)
from schemas.common.errors import InvalidFile, UsageError
from schemas.common.packages import missing
from xosc.distributions import variations

try:
    import gymnasium
    from gymnasium import spaces
except ModuleNotFoundError as error:
    raise missing(error) or error from None

ACTIONS = {"acceleration_and_steering": 2, "acceleration": 1, "target_speed": 1}
"""Kinds of actions with their number of values; without steering the ego follows the scenario's
path."""
_WHEELS = 0.5
"""rad, greatest angle of the front wheels where the scenario does not say"""
_TOP_SPEED = 50.0
"""m/s, highest target speed where the vehicle's Performance does not say a lower one"""
_SETTLE = 1.0
"""s in which the ego would reach a target speed, its limits aside"""
_MOST_SEEDS = 2**31 - 1


class EgoEnv(gymnasium.Env[dict[str, Any], Rows]):
    """Drives the ego of a scenario, one run an episode.

    Observations are the arrays of `runner.systems.outside.learner.ObservationArrays`. Actions are
    numbers from −1 to 1: the share of a fully pressed throttle (positive) or brake (negative), the
    share of the greatest steering angle, to the left positive, or the target speed, −1 standstill
    and 1 the greatest. An episode terminates if the ego has a contact or leaves the road, and is
    truncated where the scenario or its time limit ends it. `info` has `time` (s), `touched`
    (names), `departed`, and at the end `inconclusive`: names of causes for which the episode tested
    nothing (`runner.judging.evidence.least.CAUSES`).

    Args:
        scenario: a scenario, or a variation file: each episode takes one of its parameter sets at
            random.
        settings: how to run it, but for system under test and seed; `changes` replace single ones.
            A process has one run on SUMO at a time.
        actions: one of `ACTIONS`.
        participants: how many others are seen.
        reward: gives the reward of a step.
        render_mode: `rgb_array` for pictures of the present instant, from above.

    Raises:
        UsageError: a setting is wrong, or the scenario has no ego.
        InvalidFile: no parameter set is left. The other errors are those of `runner.run`.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"]}  # noqa: RUF012  # as the base class has it

    def __init__(
        self,
        scenario: str | PathLike[str],
        settings: RunSettings | None = None,
        *,
        actions: str = "acceleration_and_steering",
        participants: int = 8,
        reward: RewardFunction | None = None,
        render_mode: str | None = None,
        **changes: Unpack[SettingChanges],
    ) -> None:
        if actions not in ACTIONS:
            raise UsageError(f"the actions {actions!r} are not one of {', '.join(ACTIONS)}")
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise UsageError(
                f"the render mode {render_mode!r} is not one of "
                f"{', '.join(self.metadata['render_modes'])}"
            )
        self.render_mode = render_mode
        self.action_space = spaces.Box(-1.0, 1.0, (ACTIONS[actions],), np.float32)
        shapes: dict[str, tuple[int, ...]] = {
            "ego": (len(EGO),),
            "signal": (len(SIGNAL),),
            "participants": (participants, len(PARTICIPANT)),
            "state": (1 + participants, len(STATE)),
        }
        self.observation_space = spaces.Dict(
            {name: spaces.Box(-np.inf, np.inf, shapes[name], np.float32) for name in shapes}
        )
        # The learner commands the ego, whatever system the settings name.
        self._settings = replace(RunSettings.chosen(settings, changes), sut=Commanded())
        self.metadata = {**self.metadata, "render_fps": round(1.0 / self._settings.timestep)}
        self._sets = list(variations(scenario, self._settings.enforce_constraints))
        if not self._sets:
            raise InvalidFile(
                "no parameter set satisfies the constraints of the scenario", path=scenario
            )
        # Of the instance: a cache of the class would keep closed environments alive.
        self._prepared = lru_cache(maxsize=64)(self._prepare)
        self._actions, self._participants, self._reward = (
            actions,
            participants,
            reward or DrivingReward(),
        )
        self._session: Session | None = None
        self._view = ObservationArrays(participants)
        self._seen: Observation | None = None
        """what the present episode's next step begins with"""

    def _prepare(self, number: int) -> Prepared:
        path, parameters = self._sets[number]
        return prepare(path, parameters, self._settings)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin a run.

        Args:
            seed: of all episodes from now on.
            options: `set`: number of the parameter set in the variation file, instead of one at
                random.
        """
        super().reset(seed=seed)
        self.close()
        number = (options or {}).get("set", int(self.np_random.integers(len(self._sets))))
        chosen = replace(self._settings, seed=int(self.np_random.integers(_MOST_SEEDS)))
        session = self._session = Session(self._prepared(number), chosen)
        self._view = ObservationArrays(self._participants)
        # The ego may be added later: its episode begins with it.
        while session.running and session.observation is None:
            session.step()
        self._seen = session.observation
        if self._seen is None:
            self.close()
            raise UsageError("the ego of the scenario never appears", path=self._sets[number][0])
        return self._view.of(self._seen), self._info(session, False)

    def step(self, action: Rows) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Do one time step."""
        session, before = self._session, self._seen
        if session is None or before is None:
            raise UsageError("the episode has ended: reset() begins the next")
        session.step(self._control(action, before))
        there = session.observation
        # Where the ego has vanished, its last observation ends the episode.
        seen = there or before
        departed = self._view.is_off_road(seen)
        terminated = bool(session.touched) or departed
        # Gymnasium: a limit of time truncates, only an outcome terminates.
        truncated = not terminated and (there is None or not session.running)
        self._seen = None if terminated or truncated else there
        if self._seen is None:
            session.close()
        # Rewarded is what was asked for before the step: the learner has seen that.
        step = EgoStep(
            seen.ego, before.target_speed, self._settings.timestep, bool(session.touched), departed
        )
        info = self._info(session, departed)
        if self._seen is None:
            verdict = session.result().verdict
            causes = verdict.causes if verdict.outcome == INCONCLUSIVE else ()
            info["inconclusive"] = tuple(dict.fromkeys(cause.name for cause in causes))
        return self._view.of(seen), self._reward(step), terminated, truncated, info

    def result(self) -> RunResult:
        """The present run so far: verdict, trajectories, criticality.

        Raises:
            UsageError: no episode has begun.
        """
        if self._session is None:
            raise UsageError("no episode has begun: reset() begins one")
        return self._session.result()

    def render(self) -> Any:
        """Pixels of the present instant, an array of height, width and 3; None without a render
        mode.

        Raises:
            UsageError: no episode has begun.
        """
        if self.render_mode is None:
            return None
        from runner.view.replay.frames import frames

        result = self.result()
        return np.asarray(next(iter(frames([result], [result.end_time]))).convert("RGB"))

    def close(self) -> None:
        """Free the simulator; the results of the last run stay."""
        if self._session is not None:
            self._session.close()

    def _control(self, action: Rows, seen: Observation) -> Control:
        """Return the control of the ego for an action."""
        limits = seen.ego.performance
        share = np.clip(np.asarray(action, dtype=float).ravel(), -1.0, 1.0).tolist()
        if self._actions == "target_speed":
            target = (share[0] + 1.0) / 2.0 * min(limits.max_speed, _TOP_SPEED)
            return Control(acceleration=(target - seen.ego.speed) / _SETTLE)
        # As `OverrideControllerValueAction` counts pedals: at most `PEDAL`.
        pedal = min(PEDAL, limits.max_acceleration if share[0] > 0.0 else limits.max_deceleration)
        steering = share[1] * (seen.ego.max_steering or _WHEELS) if len(share) > 1 else None
        return Control(share[0] * pedal, steering)

    def _info(self, session: Session, departed: bool) -> dict[str, Any]:
        return {"time": session.time, "touched": session.touched, "departed": departed}
