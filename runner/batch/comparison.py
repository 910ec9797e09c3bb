"""A batch against an earlier one, run by run: what fails now and did not, what no longer fails, what still does."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from runner.batch import journal
from runner.batch.jobs import Job, Outcome

Identity = tuple[str, tuple[tuple[str, str], ...], int | None]
"""Key that identifies a run in two batches: file name, parameters, seed"""
_FAILS = ("failed", "error")


def identity(file: Path, parameters: Mapping[str, object] | Iterable[tuple[str, str]], seed: int | None) -> Identity:
    """Return the key of a run."""
    pairs = parameters.items() if isinstance(parameters, Mapping) else parameters
    return Path(file).stem, tuple(sorted((name, str(value)) for name, value in pairs)), seed


def _of(job: Job) -> Identity:
    return identity(job.source, job.parameters, job.seed)


@dataclass
class Comparison:
    """Sorts the runs of a batch by what they were in an earlier one; a run that was not in it counts as one that did not fail.

    Attributes:
        title: of the earlier batch.
        new, fixed, still: runs that fail now only, that failed before only, and that fail in both.
    """

    title: str
    before: dict[Identity, str]
    new: list[Outcome] = field(default_factory=list)
    fixed: list[Outcome] = field(default_factory=list)
    still: list[Outcome] = field(default_factory=list)

    @classmethod
    def with_batch(cls, folder: Path) -> Comparison:
        """With the batch of an output folder.

        Raises:
            UsageError: the folder is not that of a batch.
        """
        earlier = journal.finished(folder).outcomes.values()
        return cls(folder.resolve().name, {_of(each.job): each.state for each in earlier})

    def add(self, outcome: Outcome) -> None:
        """Take a run of the batch in."""
        failed, fails = self.failed(outcome), outcome.state in _FAILS
        if failed or fails:
            (self.still if failed and fails else self.new if fails else self.fixed).append(outcome)

    def failed(self, outcome: Outcome) -> bool:
        """Whether a run failed in the earlier batch."""
        return self.was(outcome) in _FAILS

    def was(self, outcome: Outcome) -> str | None:
        """State of a run in the earlier batch; None where it was not in it."""
        return self.before.get(_of(outcome.job))
