"""The ego driven from outside: an environment for learners, and a bridge for other processes."""

from __future__ import annotations

ENVIRONMENT = "xosc/Scenario-v0"
"""Name of the environment in Gymnasium"""


def register() -> None:
    """Tell Gymnasium the environment's name, and load nothing else of the package.

    `xosc_toolchain.gym` calls it, as does the entry point `gymnasium.envs`, which not all versions
    of Gymnasium read.
    """
    import gymnasium

    if ENVIRONMENT not in gymnasium.registry:
        gymnasium.register(ENVIRONMENT, entry_point="runner.view.gym.environment:EgoEnv")
