"""`docs/publication.md`: parts of the method, and the published tables beside our rows, from result
files alone."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from studies.publication.results import Entry, read_journal, read_table
from studies.publication.stages import GEOMETRIES, SCALES

HERE = Path(__file__).parent
PAGE = HERE.parents[1] / "docs" / "publication.md"
_NONE = "–"

_INTRODUCTION = """\
# The publication, row by row

This page is generated from the result files in `studies/results`: `python -m studies.publication` makes both, `--page` the page
alone. Edit neither by hand.

**Rows of ours can't be compared with published ones.** The publication was measured on highD and INTERACTION with CARLA, ours on
SUMO's traffic on our own maps. Who has those recordings gives their folder with `--recordings`, and gets the rows on them.
"""
_SMALLEST = """\
The settings of the rows below are the **smallest**: one seed, {events} windows of each class, {budget} runs a search, principal
components in the place of the encoder of grids. They show that each row is made, not how good a method is; with one seed there is
no interval. Rows of more seeds: [recognition](recognition-results.md), [generation](generation-results.md).
"""
_FULL = (
    "Rows are means ± standard deviations over {seeds} seeds (recognition) and {searches} (generation), of which none was used to "
    "choose a setting. p is of a two-sided paired t-test over seeds, against TRFE.\n"
)


def text(folder: Path, scale: str, settings: str) -> str:
    """The page of the results in a folder.

    Args:
        folder: tables by stage, with their journal.
        scale: name of the settings of the results.
        settings: a paragraph that states them.

    Raises:
        InvalidFile: the journal, or a table that is there, is damaged.
    """
    published = read_table(HERE / "published.csv")[1:]
    journal = read_journal(folder)
    parts = [_INTRODUCTION, settings, _components()]
    parts.append("## Recognition\n")
    for name, title, table, figures in _RECOGNITION:
        beside = _beside(folder, name, published, table, figures)
        parts.append(_section(f"{table}: {title}" if table else title, beside))
    parts += [
        _section(f"Figure 4: sensitivity to {symbol}", _plain(folder / "published" / f"{name}.csv"))
        for name, symbol in (
            ("sensitivity-delta", "δ"),
            ("sensitivity-trees", "T"),
            ("sensitivity-w", "W"),
        )
    ]
    parts.append("## Generation\n")
    generated = folder / "cut_in_highway"
    parts += [
        _section(
            "Table 5: methods", _with_published(generated / "generated.csv", published, "Table 5")
        ),
        _section("Likelihoods of densities, section 4.3.3", _plain(generated / "density.csv")),
        _section(
            "Reconstruction from seven parameters",
            _with_published(generated / "reconstruction.csv", published, "Reconstruction"),
        ),
        *(
            _section(f"Figure 8: {name.replace('_', ' ')}", _plain(folder / name / "generated.csv"))
            for name in GEOMETRIES
        ),
    ]
    parts.append(_commands(journal.values(), scale))
    return "\n".join(part for part in parts if part)


def settings_of(scale: str) -> str:
    """The paragraph that states the settings of a scale."""
    return (_SMALLEST if scale == "smallest" else _FULL).format(**SCALES[scale]._asdict())


_RECOGNITION = (
    (
        "open-set",
        "recognition of known and unknown classes",
        "Table 3",
        ("macro-F1", "AUROC", "OSCR"),
    ),
    ("clustering", "clustering of new classes", "Table 4", ("ACC_cluster", "clusters")),
    ("open-world", "parts left out", "Figure 3", ("ACC_cluster", "macro-F1 after")),
    ("chain", "five rounds on the model's own discoveries", "", ("ACC_cluster", "macro-F1 after")),
)
"""Tables of the protocol: name of the file, title, the publication's table, and the columns that
are shown"""


def _components() -> str:
    header, *rows = read_table(HERE / "components.csv")
    return _section("Parts of the method", (header, rows), "##")


def _beside(
    folder: Path, name: str, published: Iterable[Sequence[str]], table: str, figures: Sequence[str]
) -> tuple[list[str], list[list[str]]] | None:
    """Rows as published, with the published settings here, and as shipped here."""
    ours = [_columns(folder / stage / f"{name}.csv", figures) for stage in ("published", "shipped")]
    if not any(ours):
        return None
    theirs = {row: value for of, row, _, value in published if of == table}
    titles = dict.fromkeys((*theirs, *ours[0], *ours[1]))
    header = [
        "",
        *(("published",) if theirs else ()),
        *(
            f"{figure}, {settings}"
            for settings in ("as published", "as shipped")
            for figure in figures
        ),
    ]
    none = [_NONE] * len(figures)
    rows = [
        [
            title,
            *((theirs.get(title, _NONE),) if theirs else ()),
            *(value for rows in ours for value in rows.get(title, none)),
        ]
        for title in titles
    ]
    return header, rows


def _columns(path: Path, figures: Sequence[str]) -> dict[str, list[str]]:
    """These columns of a table by the title of the row; nothing where there is no table."""
    if not path.exists():
        return {}
    header, *rows = read_table(path)
    places = [header.index(figure) for figure in figures]
    return {row[0].strip("*"): [row[place] for place in places] for row in rows}


def _with_published(
    path: Path, published: Iterable[Sequence[str]], table: str
) -> tuple[list[str], list[list[str]]] | None:
    found = _plain(path)
    if found is None:
        return None
    header, rows = found
    theirs = {figure: value for of, _, figure, value in published if of == table}
    return header, [
        ["as published, on other data", *(theirs.get(one, _NONE) for one in header[1:])],
        *rows,
    ]


def _plain(path: Path) -> tuple[list[str], list[list[str]]] | None:
    if not path.exists():
        return None
    header, *rows = read_table(path)
    return header, rows


def _section(
    title: str, table: tuple[list[str], list[list[str]]] | None, level: str = "###"
) -> str:
    """A heading and a table; a sentence where the results have none."""
    if table is None:
        return f"{level} {title}\n\nNot made with these settings.\n"
    header, rows = table
    lines = (header, ["---"] * len(header), *rows)
    body = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    return f"{level} {title}\n\n{body}\n"


def _commands(entries: Iterable[Entry], scale: str) -> str:
    rows = [
        [each.stage, f"`python -m {each.command}`", f"{each.seconds:.0f}", each.date, each.commit]
        for each in entries
    ]
    total = sum(float(row[2]) for row in rows)
    header = ["stage", "command", "s", "date", "commit"]
    made = f"`python -m studies.publication{' --smallest' if scale == 'smallest' else ''}`"
    return (
        _section("Commands", (header, rows), "##")
        + f"\n{made} runs them, {total / 60:.0f} minutes in all.\n"
    )
