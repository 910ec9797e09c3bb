"""Result of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from runner.judging.criteria.criterion import CriterionResult
from runner.recording import LogEntry
from schemas.common.errors import UsageError
from schemas.common.packages import offered

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

    from runner.judging.measures.criticality import Criticality
    from runner.recording import Recording
    from schemas.common.remarks import Remark


PASSED, FAILED, INCONCLUSIVE = "passed", "failed", "inconclusive"
"""Outcomes of a verdict"""


class Cause(NamedTuple):
    """Reason for which a run is inconclusive.

    Attributes:
        name: one of `runner.judging.evidence.least.CAUSES`.
        text: what was not tested, with file and line where there is one.
    """

    name: str
    text: str


class RunEvidence(NamedTuple):
    """Evidence of one kind that a run tested something.

    Attributes:
        name: one of `runner.judging.evidence.least.ROWS`.
        value: number that was counted.
        planned: number that there was to reach, for events, participants and criteria.
        unit: `s`, `share` (0 to 1), `yes` (1 or 0), or the things that are counted.
        least: value from which on it is enough.
        texts: what is missing; empty where it is enough.
    """

    name: str
    value: float
    planned: int | None
    unit: str
    least: float
    texts: tuple[str, ...] = ()

    @property
    def enough(self) -> bool:
        """Whether the least value is reached."""
        return self.value >= self.least


@dataclass(frozen=True, repr=False)
class Verdict:
    """Outcome of a run, and the reasons for it.

    Args:
        failures: contacts of the ego, failed criteria and limits.
        causes: why the run did not test what the file describes.
        criteria: results of the scenario's criteria, in its order.
        evidence: that it tested something; a run without any has not passed.

    Example:
        >>> import xosc_toolchain as xt
        >>> verdict = xt.run("xosc/library/cut_in_highway.xosc", sut="adas").verdict
        >>> print(verdict.outcome, verdict.passed, verdict.failures)
        passed True ()
    """

    failures: tuple[str, ...] = ()
    causes: tuple[Cause, ...] = ()
    criteria: tuple[CriterionResult, ...] = ()
    evidence: tuple[RunEvidence, ...] = ()

    @property
    def outcome(self) -> str:
        """`FAILED` with a failure, else `PASSED` with all evidence and no cause against it, else
        `INCONCLUSIVE`."""
        if self.failures:
            return FAILED
        # `all` of no rows is true: a run without evidence must not pass.
        earned = bool(self.evidence) and all(row.enough for row in self.evidence)
        return PASSED if earned and not self.causes else INCONCLUSIVE

    @property
    def passed(self) -> bool:
        """Whether the run tested what the file describes, without a failure."""
        return self.outcome == PASSED

    @property
    def reasons(self) -> tuple[str, ...]:
        """Failures, or else why the run is inconclusive; empty where it passed."""
        return self.failures or tuple(cause.text for cause in self.causes)

    def __str__(self) -> str:
        return ": ".join(filter(None, (self.outcome, "; ".join(self.reasons))))

    def __repr__(self) -> str:
        return f"<Verdict {self}>"


@dataclass(eq=False, repr=False)
class RunResult:
    """One run.

    Args:
        scenario: the scenario file.
        parameters: the parameter values that it was given.
        status: `completed` (by its stop trigger), `collision` (a contact of the ego ended it) or
            `timeout` (the time limit).
        end_time: simulation time at the end, s.
        verdict: passed, failed or inconclusive, and why.
        remarks: what is no failure, but may not be meant: what was assumed of the files (see
            `schemas.common.remarks`), that the ego has left the road, or come to its end.
        ego: name of the ego, None where the scenario has none.
        sut: name of the system under test that drove it, `none` for none.
        settings: timestep, seed, world and time limit of the run.
        events: the event log.
        recording: states of the entities over time.
        name: its name among other runs; where it has none, the scenario file's.
        sut_parameters: parameters of that system, by name.
        actors: names of the actors of each maneuver group, by its path in the event log.

    Example:
        >>> import xosc_toolchain as xt
        >>> result = xt.run("xosc/library/simple_cut_in.xosc", world="kinematic", max_time=1.0)
        >>> result.verdict.outcome, result.end_time
        ('inconclusive', 1.0)
        >>> result.trajectories.column_names[:5]
        ['time', 'entity', 'x', 'y', 'z']
    """

    scenario: Path
    parameters: dict[str, str]
    status: str
    end_time: float
    verdict: Verdict
    remarks: tuple[str, ...]
    ego: str | None
    sut: str
    settings: dict[str, Any]
    events: list[LogEntry]
    recording: Recording = field(repr=False)
    name: str = ""
    sut_parameters: dict[str, Any] = field(default_factory=dict)
    actors: dict[str, tuple[str, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.name = self.name or self.scenario.stem

    @cached_property
    def trajectories(self) -> pa.Table:
        """Trajectories of all entities in long form: time, entity, x, y, z, h, pitch, roll, speed,
        acceleration, road_id, lane_id, s, t, lane_offset (m, rad, s; reference point; see
        `runner.recording`)."""
        return self.recording.table()

    @cached_property
    def criticality(self) -> Criticality | None:
        """Criticality measures of the ego per step, and their extremes; None where the ego never
        appeared, or there is none."""
        from runner.judging.measures.criticality import of_recording

        return of_recording(self.recording, self.ego)

    def assume(self, remarks: Sequence[Remark]) -> None:
        """Add assumptions on files that the run does not know, such as the distribution of its
        parameters."""
        # Assumptions on files come first: they explain what follows.
        self.remarks = (*map(str, remarks), *self.remarks)
        causes = tuple(Cause(remark.cause, str(remark)) for remark in remarks if remark.cause)
        self.verdict = replace(self.verdict, causes=(*causes, *self.verdict.causes))

    def to_pandas(self) -> pd.DataFrame:
        """`trajectories` as a data frame.

        Raises:
            UsageError: pandas, which no extra brings, is missing.
        """
        try:
            frame: pd.DataFrame = self.trajectories.to_pandas()
        except ModuleNotFoundError as error:
            raise UsageError(f"{error.name} is missing; type: pip install {error.name}") from None
        return frame

    def save(self, folder: str | PathLike[str]) -> Path:
        """Write the run as `xosc-run --out` does, and give the folder; an earlier run's results
        there are replaced.

        Raises:
            UsageError: something else is in the way.
        """
        path = Path(folder)
        path.absolute().parent.mkdir(parents=True, exist_ok=True)
        offered("write a run")(self, path.absolute())
        return path

    def replay(self, path: str | PathLike[str] | None = None) -> Path:
        """Write a page that plays the run, and give its path: by default the run's name with
        `.html`."""
        page = Path(path or f"{self.name}.html")
        offered("write a replay")([self], page)
        return page

    def __repr__(self) -> str:
        reasons = f" ({'; '.join(self.verdict.reasons)})" if self.verdict.reasons else ""
        return (
            f"<RunResult {self.name}: {self.verdict.outcome}{reasons}, {self.status} at "
            f"{self.end_time:.2f} s, sut {self.sut}>"
        )

    def _repr_html_(self) -> str:
        """Table and replay, as notebooks show them."""
        page: str = offered("show a run")(self)
        return page
