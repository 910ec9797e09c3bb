"""The ego driven from outside: an environment for learners, and a bridge for other processes."""

from __future__ import annotations

ENVIRONMENT = "xosc/Scenario-v0"
"""Name of the environment in Gymnasium"""


def register() -> None:
    """Tell Gymnasium the environment's name; the entry point `gymnasium.envs` calls it, and loads nothing else of the package."""
    import gymnasium

    if ENVIRONMENT not in gymnasium.registry:
        gymnasium.register(ENVIRONMENT, entry_point="runner.outside.environment:EgoEnv")
