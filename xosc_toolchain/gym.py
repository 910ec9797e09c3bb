"""Environment of Gymnasium: importing this module registers `xosc/Scenario-v0`.

Example:
    >>> env = gymnasium.make("xosc_toolchain.gym:xosc/Scenario-v0", scenario="mine.xosc",
    ...                      render_mode="rgb_array")
"""

from __future__ import annotations

from runner.view.gym import register

register()
