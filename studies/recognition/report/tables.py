"""Tables of an evaluation: mean and standard deviation over seeds, as Markdown and CSV."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from statistics import fmean, stdev
from typing import Any, NamedTuple

from schemas.common.terminal.text import csv_text
from studies.recognition.protocol.store import Store

Results = dict[str, dict[int, dict[int, dict[str, Any]]]]
"""Values by method, seed and round."""
REFERENCE = "trfe"
"""The method with which others are compared."""
_FEWEST_SEEDS = 3


class Table(NamedTuple):
    """One table.

    Attributes:
        name: for its file.
        title, note: above and below it.
        header, rows: cells as text.
    """

    name: str
    title: str
    note: str
    header: tuple[str, ...]
    rows: list[tuple[str, ...]]

    def markdown(self) -> str:
        """The table with its title and note."""
        lines = [self.header, tuple("---" for _ in self.header), *self.rows]
        body = "\n".join("| " + " | ".join(line) + " |" for line in lines)
        return f"## {self.title}\n\n{body}\n" + (f"\n{self.note}\n" if self.note else "")

    def csv(self) -> str:
        """The header and the rows."""
        return csv_text([self.header, *self.rows])


def results_of(store: Store, kind: str, order: Sequence[str]) -> Results:
    """All results of a kind; methods in this order."""
    found: Results = {name: {} for name in order}
    for key, values in store.results(kind):
        found.setdefault(key.method, {}).setdefault(key.seed, {})[key.round] = values
    return {name: seeds for name, seeds in found.items() if seeds}


def spread(values: Iterable[float], digits: int = 3) -> str:
    """`mean ± standard deviation` (of the sample); the mean alone for one value,
    a dash for none.
    """
    numbers = list(values)
    if not numbers:
        return "–"
    text = f"{fmean(numbers):.{digits}f}"
    return text if len(numbers) < 2 else f"{text} ± {stdev(numbers):.{digits}f}"


def over_rounds(seeds: dict[int, dict[int, dict[str, Any]]], figure: str) -> list[float]:
    """A figure of each seed, as the mean over its rounds."""
    return [fmean(values[figure] for values in rounds.values()) for rounds in seeds.values()]


def comparison(
    results: Results, titles: dict[str, str], figures: dict[str, str], tested: str
) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows: a row for each method, a column for each figure (name of the value →
    heading), means over rounds.

    The last columns are the number of seeds, and the p of a paired t-test over those of the figure
    `tested` against that of TRFE.
    """
    rows = [
        (
            titles.get(name, name),
            *(spread(over_rounds(seeds, figure)) for figure in figures),
            str(len(seeds)),
            paired(seeds, results.get(REFERENCE, {}), tested) if name != REFERENCE else "–",
        )
        for name, seeds in results.items()
    ]
    return ("", *figures.values(), "seeds", "p"), rows


def paired(
    seeds: dict[int, dict[int, dict[str, Any]]],
    others: dict[int, dict[int, dict[str, Any]]],
    figure: str,
) -> str:
    """p of a two-sided paired t-test over the seeds that both have; a dash where there are fewer
    than three."""
    from scipy.stats import ttest_rel

    both = sorted(seeds.keys() & others.keys())
    if len(both) < _FEWEST_SEEDS:
        return "–"
    one, other = (over_rounds({seed: of[seed] for seed in both}, figure) for of in (seeds, others))
    return "–" if one == other else f"{ttest_rel(one, other).pvalue:.2g}"


def by_round(
    results: Results, titles: dict[str, str], figure: str
) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows: a row for each method, a column for each round."""
    numbers = sorted(
        {number for seeds in results.values() for rounds in seeds.values() for number in rounds}
    )
    rows = [
        (
            titles.get(name, name),
            *(
                spread(rounds[number][figure] for rounds in seeds.values() if number in rounds)
                for number in numbers
            ),
        )
        for name, seeds in results.items()
    ]
    return ("", *(f"round {number}" for number in numbers)), rows
