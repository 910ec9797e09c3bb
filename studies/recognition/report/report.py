"""The report of an evaluation: which tables there are, what they are called and
what has to be said beside them.
"""

from __future__ import annotations

from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

from recognition.labels import Label
from recognition.trfe.discovery.candidates import Preprocessing
from recognition.trfe.inputs.samples import BACKGROUND
from schemas.common.terminal.text import csv_text
from studies.recognition.ablations import CHAINED, VARIANTS
from studies.recognition.experiments import clustering, open_set
from studies.recognition.protocol.evaluation import EXPERIMENTS, Evaluation
from studies.recognition.report.tables import (
    REFERENCE,
    Table,
    by_round,
    comparison,
    results_of,
    spread,
)

TITLES = {
    "open-set": open_set.TITLES,
    "clustering": clustering.TITLES,
    "open-world": {name: variant.title for name, variant in VARIANTS.items()},
    "chain": {name: VARIANTS[name].title for name in CHAINED},
}
"""Titles of rows, by kind of experiment and name."""
PUBLISHED = (
    "Published figures, on highD and INTERACTION, for orientation only: TRFE F1 0.906, ACC 0.972, "
    "ACC_cluster 0.964; MDENet F1 "
    "0.883; CEVT F1 0.875; AutoNovel ACC_cluster 0.902. Here: same protocol, other data."
)
_OPEN_SET = {
    "macro_f1": "macro-F1",
    "accuracy": "(K+1) accuracy",
    "closed_accuracy": "closed-set accuracy",
    "auroc": "AUROC",
    "oscr": "OSCR",
    "false_rejection": "false rejection",
}
_CLUSTERING = {"accuracy": "ACC_cluster", "unmatched": "unmatched", "clusters": "clusters"}
_OPEN_WORLD = {
    "accuracy": "ACC_cluster",
    "accuracy_of_all": "of all new",
    "unmatched": "unmatched",
    "dropped": "dropped",
    "mistaken": "known taken for new",
    "found": "new recognised later",
    "macro_f1": "macro-F1 after",
}


def tables(evaluation: Evaluation) -> list[Table]:
    """All tables for which there are results."""
    found = [
        _data(evaluation),
        *_compared(
            evaluation, "open-set", _OPEN_SET, "macro_f1", "Open-set recognition", _OPEN_SET_NOTE
        ),
        *_compared(
            evaluation,
            "clustering",
            _CLUSTERING,
            "accuracy",
            "Clustering of the new classes",
            _CLUSTERING_NOTE,
        ),
        *_compared(
            evaluation,
            "open-world",
            _OPEN_WORLD,
            "macro_f1",
            "Open world, ablations and options",
            _OPEN_WORLD_NOTE,
        ),
        *_compared(
            evaluation,
            "chain",
            _OPEN_WORLD,
            "macro_f1",
            "Open world on its own discoveries",
            _CHAIN_NOTE,
        ),
        *(_curve(evaluation, name, title) for name, title in (("delta", "δ"), ("trees", "T"))),
        _capacities(evaluation),
        _probe(evaluation),
    ]
    return [table for table in found if table.rows]


_OPEN_SET_NOTE = (
    "Means over the rounds, then mean ± standard deviation over seeds. Known: the classes before "
    "the round, learnt with true "
    "labels; unknown: the round's new ones. All methods work on the same frozen features and give "
    "up 5 % of the known "
    "validation windows; one row has TRFE with the δ that it chooses by leaving one known class "
    "out. p: paired t-test over seeds "
    "against TRFE."
)
_CLUSTERING_NOTE = (
    "Hungarian accuracy on up to 500 windows of the round's new classes, the same for all, none "
    "dropped. Unmatched: windows in "
    "clusters for which no class was left; they count as wrong. Rows that say so are given the "
    "true number of classes, as is "
    "random; rows with the K of held-out classes the number that suits known classes best whose "
    "labels are held back; the others "
    "find theirs. p: paired t-test over seeds against TRFE."
)
_OPEN_WORLD_NOTE = (
    "One round at a time, from true labels of the known classes: a stream of known and new "
    "windows is screened, buffered, "
    "sifted, clustered and promoted. ACC_cluster is over windows in promoted clusters, known ones "
    "among them counting as "
    "wrong; `of all new` counts dropped windows as wrong too. Macro-F1 after: test windows of all "
    "classes so far, discovered "
    "classes under the name of the class they are matched with. p: paired t-test of it over seeds "
    "against TRFE."
)
_CHAIN_NOTE = (
    "The same through all rounds on the model's own discoveries: only the two first classes ever "
    "have true labels, and the "
    "encoder stays that of the first round."
)


def _compared(
    evaluation: Evaluation, kind: str, figures: dict[str, str], main: str, title: str, note: str
) -> list[Table]:
    titles, results = (
        TITLES[kind],
        results_of(
            evaluation.store, kind, [name for name in EXPERIMENTS[kind] if not _is_capacity(name)]
        ),
    )
    results = {name: seeds for name, seeds in results.items() if not _is_capacity(name)}
    return [
        Table(kind, title, note, *comparison(results, titles, figures, main)),
        Table(
            f"{kind}-rounds",
            f"{title}: {figures[main]} by round",
            "",
            *by_round(results, titles, main),
        ),
    ]


def _is_capacity(name: str) -> bool:
    return name[0] == "w" and name[1:].isdigit()


def _data(evaluation: Evaluation) -> Table:
    first = min(_seeds(evaluation), default=0)
    split, labels = evaluation.split(first), evaluation.windows.labels
    rows = [
        (
            str(int(label)),
            Label(int(label)).title,
            *(str(np.count_nonzero(labels[part] == label)) for part in split[:4]),
        )
        for label in np.unique(labels[split.test])
        if label != BACKGROUND
    ]
    names = len(np.unique(evaluation.windows.recordings))
    left_out = ", ".join(
        f"{Label(label).title} ({count} windows)" for label, count in split.left_out.items()
    )
    note = (
        f"Windows of seed {first}, of {names} recordings, split by {evaluation.settings.unit}."
        + (f" Left out, as they are not in every part: {left_out}." if left_out else "")
    )
    return Table(
        "data", "Data", note, ("id", "class", "labelled", "stream", "validation", "test"), rows
    )


def _curve(evaluation: Evaluation, name: str, symbol: str) -> Table:
    seeds = results_of(evaluation.store, "sensitivity", [name]).get(name, {})
    values = [
        point["value"]
        for rounds in seeds.values()
        for point in next(iter(rounds.values()))["points"]
    ]
    figures = {
        "macro_f1": "macro-F1",
        "accuracy": "(K+1) accuracy",
        "auroc": "AUROC",
        "false_rejection": "false rejection",
    }
    rows = [
        (f"{value:g}", *(spread(_at(seeds, value, figure)) for figure in figures))
        for value in sorted(set(values))
    ]
    return Table(
        f"sensitivity-{name}", f"Sensitivity to {symbol}", "", (symbol, *figures.values()), rows
    )


def _at(seeds: dict[int, dict[int, dict[str, Any]]], value: float, figure: str) -> list[float]:
    """The figure of each seed at one value of the parameter, as the mean over its rounds."""
    return [
        fmean(
            point[figure]
            for one in rounds.values()
            for point in one["points"]
            if point["value"] == value
        )
        for rounds in seeds.values()
    ]


def _capacities(evaluation: Evaluation) -> Table:
    results = results_of(evaluation.store, "open-world", [])
    found = {int(name[1:]): seeds for name, seeds in results.items() if _is_capacity(name)}
    if found and REFERENCE in results:
        found.setdefault(Preprocessing().capacity, results[REFERENCE])
    titles = {str(capacity): str(capacity) for capacity in sorted(found)}
    results = {name: found[int(name)] for name in titles}
    header, rows = comparison(results, titles, _OPEN_WORLD, "macro_f1")
    rows = [row[:-1] for row in rows]
    return Table(
        "sensitivity-w", "Sensitivity to W", "As in the open world.", ("W", *header[1:-1]), rows
    )


def _probe(evaluation: Evaluation) -> Table:
    results = results_of(evaluation.store, "probe", EXPERIMENTS["probe"])
    measured = {
        figure
        for rounds in results.get("encoder", {}).values()
        for values in rounds.values()
        for figure in values
    }
    titles = {"features": "the encoder's features", "speed": "the ego's speed alone"}
    tables = {
        title: by_round(results, {"encoder": title}, figure)
        for figure, title in titles.items()
        if figure in measured
    }
    header = next(iter(tables.values()), (("",), []))[0]
    note = (
        "Mean accuracy over known and new classes of a logistic regression on frozen features, "
        "with labels of all of them."
    )
    return Table(
        "probe", "Linear probe", note, header, [row for _, rows in tables.values() for row in rows]
    )


def write_report(evaluation: Evaluation, out: Path) -> list[Table]:
    """Write `report.md`, a CSV for each table, and `results.csv` with every
    single figure; the tables.
    """
    found = tables(evaluation)
    seeds = _seeds(evaluation)
    settings = evaluation.settings
    intro = (
        f"Incremental open-world protocol over {len(evaluation.rounds(min(seeds, default=0)))} "
        "rounds, seeds "
        f"{', '.join(map(str, seeds))}, encoder preset "
        f"`{settings.preset}`, at most {settings.events_per_class or 'all'} events of each "
        f"class.\n\n{PUBLISHED}"
    )
    text = "\n".join(
        [f"# Results of recognition\n\n{intro}\n", *(table.markdown() for table in found)]
    )
    (out / "report.md").write_text(text, encoding="utf-8", newline="\n")
    (out / "tables").mkdir(exist_ok=True)
    for table in found:
        (out / "tables" / f"{table.name}.csv").write_text(
            table.csv(), encoding="utf-8", newline="\n"
        )
    (out / "results.csv").write_text(
        csv_text(_single_figures(evaluation)), encoding="utf-8", newline="\n"
    )
    return found


def _seeds(evaluation: Evaluation) -> list[int]:
    return sorted({key.seed for kind in EXPERIMENTS for key, _ in evaluation.store.results(kind)})


def _single_figures(evaluation: Evaluation) -> list[tuple[Any, ...]]:
    rows: list[tuple[Any, ...]] = [("kind", "method", "seed", "round", "figure", "value")]
    for kind in EXPERIMENTS:
        for key, values in evaluation.store.results(kind):
            rows += [
                (*key, name, value)
                for name, value in values.items()
                if isinstance(value, int | float)
            ]
    return rows
