"""Collisions of systems under test on the same cases, and the share that a careful and competent
driver avoids.

Cases are scenarios, or the parameter sets of variation files such as `xosc-generate` writes. The
command for it is `python -m studies.generation systems`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from generation.search.outcomes import CAREFUL, Outcomes, Simulator
from runner.batch.jobs import Job, Outcome
from runner.judging.settings import RunSettings
from schemas.common.array_types import BoolArray

if TYPE_CHECKING:
    import pyarrow as pa

SYSTEMS = ("cas", "aeb", "idm", "r157-cc", "r157-reg", "rss", "fsm")


class Row(NamedTuple):
    """Results of one system.

    Args:
        system: its name.
        runs: cases that could be run.
        collisions: of these.
        avoidable, unavoidable: collisions in cases in which the careful and competent driver (UN
            Regulation 157) has none, or has one as well; they do not add up where its run failed.
        r_risk: mean share of time in which RSS distances are violated.
    """

    system: str
    runs: int
    collisions: int
    avoidable: int
    unavoidable: int
    r_risk: float


@dataclass(frozen=True, eq=False)
class Comparison:
    """Outcomes of every system in n cases.

    Args:
        cases: the runs; what could not be read is an outcome.
        outcomes: of each system, of the careful driver in any case.
    """

    cases: list[Job | Outcome]
    outcomes: dict[str, Outcomes]

    def avoidable(self, system: str) -> BoolArray:
        """Collisions (n,) of a system that the careful and competent driver does not have."""
        return self.outcomes[system].collision & self.outcomes[CAREFUL].survived

    def rows(self) -> list[Row]:
        """One row for each system."""
        return [
            Row(
                system,
                int(found.executed.sum()),
                int(found.collision.sum()),
                int(self.avoidable(system).sum()),
                int((found.collision & self.outcomes[CAREFUL].collision).sum()),
                float(found.r_risk[found.executed].mean()) if found.executed.any() else 0.0,
            )
            for system, found in self.outcomes.items()
        ]

    def markdown(self) -> str:
        """The rows as a table."""
        lines = [
            "| system under test | runs | collisions | avoidable | not avoidable | mean R_risk |",
            "|---|---|---|---|---|---|",
        ]
        for row in self.rows():
            counts = f"{row.runs} | {row.collisions} | {row.avoidable} | {row.unavoidable}"
            lines.append(f"| `{row.system}` | {counts} | {row.r_risk:.3f} |")
        return "\n".join(lines) + "\n"

    def table(self) -> pa.Table:
        """A row for each case and system: case, parameters (a map), system, collision, avoidable,
        r_risk, min_ttc (s; null where there never was a lead), end_time (s), error; collision,
        r_risk and end_time are null where there was no run, avoidable where there was no collision
        or the careful driver's run failed."""
        import pyarrow as pa

        jobs = [case.job if isinstance(case, Outcome) else case for case in self.cases]
        parts = []
        for system, found in self.outcomes.items():
            failed = ~found.executed
            columns = {
                "case": pa.array([job.name for job in jobs]),
                "parameters": pa.array(
                    [sorted(job.parameters.items()) for job in jobs],
                    pa.map_(pa.string(), pa.string()),
                ),
                "system": pa.array([system] * len(jobs), pa.string()),
                "collision": pa.array(found.collision, mask=failed),
                "avoidable": pa.array(
                    self.avoidable(system), mask=~found.collision | ~self.outcomes[CAREFUL].executed
                ),
                "r_risk": pa.array(found.r_risk, mask=failed),
                "min_ttc": pa.array(found.min_ttc, mask=np.isinf(found.min_ttc)),
                "end_time": pa.array(found.end_time, mask=failed),
                "error": pa.array(found.error.tolist(), pa.string()),
            }
            parts.append(pa.table(columns))
        return pa.concat_tables(parts)

    def write(self, folder: Path) -> None:
        """Write `systems.md` and `cases.parquet`."""
        import pyarrow.parquet as pq

        folder.mkdir(parents=True, exist_ok=True)
        (folder / "systems.md").write_text(self.markdown(), encoding="utf-8", newline="\n")
        pq.write_table(self.table(), folder / "cases.parquet", compression="zstd")


def compare(
    cases: Sequence[Job | Outcome],
    systems: Sequence[str] = SYSTEMS,
    *,
    timestep: float = 0.05,
    processes: int = 2,
    progress: Callable[[str], None] = lambda system: None,
) -> Comparison:
    """Run every case with every system, and with the careful and competent driver.

    Args:
        cases: what to run (`runner.batch.jobs.jobs_of`).
        systems: names of systems under test.
        timestep: s.
        processes: how many run at a time.
        progress: called with each system before its runs.

    Raises:
        UsageError: there is no such system, or a setting is wrong.
    """
    outcomes: dict[str, Outcomes] = {}
    for system in dict.fromkeys((*systems, CAREFUL)):
        with Simulator(run=RunSettings(sut=system, timestep=timestep), processes=processes) as runs:
            progress(system)
            outcomes[system] = runs.of(cases)
    return Comparison(list(cases), outcomes)
