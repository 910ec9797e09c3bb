"""How MCSG learns."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class McsgSettings:
    """How MCSG learns; METHOD §3 where nothing else is said.

    Attributes:
        batch: episodes to each step of REINFORCE.
        rate, clip: of Adam, and the norm that gradients are cut to.
        momentum: of the moving average of rewards that is the baseline.
        bins: of each parameter's edits, in the first stage and after it.
        span: share of the best episodes' edits that the second stage's ranges hold.
        reach: greatest edit of the first stage, in standard deviations of the real parameters.
        spread: standard deviation of the untrained policy's edits, the same way.
        elite: share of all episodes so far that the next ones start from.
        apart: least distance of two of the elite in the unit cube, root mean square over the parameters.
    """

    batch: int = 50
    rate: float = 1e-2
    clip: float = 1.0
    momentum: float = 0.9
    bins: tuple[int, int] = (5, 10)
    span: float = 0.9
    reach: float = 3.0
    spread: float = 1.0
    elite: float = 0.05
    apart: float = 0.05
