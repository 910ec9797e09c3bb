"""The report of a study: which tables there are, and what has to be said beside them."""

from __future__ import annotations

from statistics import fmean

import numpy as np

from schemas.common.terminal.text import csv_text
from studies.generation import densities, reconstruction
from studies.generation.comparison import points, trajectories
from studies.generation.comparison.measures import Measures, last_third, measure
from studies.generation.comparison.study import Key, Study
from studies.generation.methods import ABLATIONS, METHODS
from studies.recognition.report.tables import Table, spread

PUBLISHED = (
    "Published figures of MCSG, on other data and another simulator, for orientation only: R_risk "
    "0.779, CR 0.663."
)
FIGURES = {
    "r_risk": "R_risk",
    "collisions": "CR",
    "log_likelihood": "log-likelihood",
    "plausible": "plausible",
    "edge_cases": "plausible collisions",
    "distinct": "distinct ones",
    "diversity": "diversity",
    "reward": "reward",
}
"""Measures in the tables, and their headings."""
Results = dict[str, dict[int, Measures]]
"""Measures by method and seed."""

_LAST_NOTE = (
    "Mean ± standard deviation over seeds, of the last third of each search: what it generates "
    "once it has learnt. "
    "Log-likelihood: of recorded parameters, natural, mean over episodes. Plausible: no less "
    "likely than 99 % of the recorded "
    "manoeuvres. Distinct ones: plausible collisions no nearer to each other than 5 % of the "
    "ranges. † keeps to the plausible "
    "by its reward or its source. Avoidable: share of the collisions that the careful and "
    "competent driver of UN R157 avoids."
)
_ALL_NOTE = "The same over all simulator calls of each search."


def results(study: Study, complete: bool = False) -> Results:
    """Measures of all searches that are there: of their last thirds, or of the whole searches."""
    found: Results = {}
    for key in study.searches():
        history = study.history(key)
        found.setdefault(key.method, {})[key.seed] = measure(
            history if complete else last_third(history), study.problem
        )
    return found


def title(name: str) -> str:
    """Return the title of a method's row."""
    return METHODS[name].title + (" †" if METHODS[name].realistic else "")


def _tables(study: Study, last: Results, complete: Results, likelihoods: bool) -> list[Table]:
    """All tables for which there are results."""
    header = ("", *FIGURES.values())
    theta, recordings = study.recorded.theta, study.recorded.recordings
    found = [
        Table(
            "generated",
            "What the methods generate",
            _LAST_NOTE,
            (*header, "avoidable", "seeds"),
            _rows(last, study),
        ),
        Table(
            "calls",
            "What the methods spend their calls on",
            _ALL_NOTE,
            (*header, "seeds"),
            _rows(complete),
        ),
        reconstruction.overall(study.recorded.errors),
        trajectories.table(study),
        *([densities.comparison(theta, recordings)] if likelihoods else []),
    ]
    return [table for table in found if table.rows]


def _rows(found: Results, study: Study | None = None) -> list[tuple[str, ...]]:
    """A row for each method, with its seeds; with a study, the share of avoidable collisions
    before them."""
    rows = []
    for name, seeds in found.items():
        row = [
            title(name),
            *(_cell([getattr(values, figure) for values in seeds.values()]) for figure in FIGURES),
        ]
        if study is not None:
            shares = [study.avoidable(Key(name, seed)) for seed in seeds]
            row.append(spread((share for share in shares if share is not None), 2))
        rows.append((*row, str(len(seeds))))
    return rows


def _cell(values: list[float]) -> str:
    return spread(values, 1 if max(abs(value) for value in values) >= 10.0 else 3)


def write_report(study: Study, likelihoods: bool = True) -> list[Table]:
    """Write `report.md`, a CSV for each table and for the points of pictures, and `results.csv`
    with every single figure; the tables.

    Args:
        likelihoods: whether the table of held-out likelihoods is among them; to fit the flow takes
            minutes.
    """
    last, complete = results(study), results(study, complete=True)
    found = _tables(study, last, complete, likelihoods)
    text = "\n".join(
        [
            f"# Results of generation\n\n{_introduction(study, last)}\n",
            *(table.markdown() for table in found),
        ]
    )
    (study.out / "report.md").write_text(text, encoding="utf-8", newline="\n")
    (study.out / "tables").mkdir(exist_ok=True)
    for table in found:
        (study.out / "tables" / f"{table.name}.csv").write_text(
            table.csv(), encoding="utf-8", newline="\n"
        )
    shown = points.rows(study)
    if shown:
        path = study.out / "tables" / f"{points.NAME}.csv"
        path.write_text(csv_text(shown), encoding="utf-8", newline="\n")
    rows: list[tuple[object, ...]] = [("episodes", "method", "seed", *Measures._fields)]
    for episodes, measured in (("last third", last), ("all", complete)):
        rows += (
            (episodes, name, seed, *values)
            for name, seeds in measured.items()
            for seed, values in seeds.items()
        )
    (study.out / "results.csv").write_text(csv_text(rows), encoding="utf-8", newline="\n")
    return found


def _introduction(study: Study, last: Results) -> str:
    settings, realism, recorded = study.settings, study.problem.reward.realism, study.recorded
    seeds = {key.seed for key in study.searches()}
    pinned = ", ".join(f"{name} {value}" for name, value in study.space.pinned.items())
    limits = f"{realism.limit:.2f} to {realism.limit + realism.scale:.2f}"
    about = (
        f"Scenario `{study.scenario.name}`, system under test `{settings.sut}`, {settings.budget} "
        "simulator calls a search, "
        f"{len(seeds)} seeds, RSS set `{settings.rss}`, time step {settings.timestep} s. Pinned: "
        f"{pinned or 'nothing'}. "
        f"Searched: {', '.join(study.space.names)}. Density `{settings.density}` of "
        f"{len(recorded.theta)} manoeuvres from "
        f"{len(np.unique(recorded.recordings))} recordings; realism weight {settings.weight}, "
        f"from a negative log-likelihood of {limits}."
    )
    return "\n\n".join([about, PUBLISHED, _verdict(last)])


def _verdict(found: Results) -> str:
    """Return the measures in which MCSG leads or not, among all methods that are
    no ablation of it.
    """
    means = {
        name: {figure: fmean(getattr(one, figure) for one in seeds.values()) for figure in FIGURES}
        for name, seeds in found.items()
        if name not in ABLATIONS
    }
    if "mcsg" not in means or len(means) < 2:
        return ""
    lines = []
    for figure in ("r_risk", "collisions", "log_likelihood", "edge_cases", "distinct"):
        ranked = sorted(means, key=lambda name: -means[name][figure])
        realistic = [name for name in ranked if METHODS[name].realistic]
        best = [
            f"{METHODS[name].title.strip('*')} {means[name][figure]:.3g}" for name in ranked[:3]
        ]
        lines.append(
            f"- {FIGURES[figure]}: MCSG is number {realistic.index('mcsg') + 1} of the "
            f"{len(realistic)} methods that keep to the "
            f"plausible (†), number {ranked.index('mcsg') + 1} of all {len(ranked)} "
            f"({', '.join(best)})"
        )
    return "\n".join(lines)
