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
_SEEDS = "seeds"
"""Column that says over how many seeds a row is a mean"""

_INTRODUCTION = """\
# The publication, row by row

This page is generated from the result files in `studies/results`: `python -m studies.publication` makes both, `--page-only` the page
alone. Edit neither by hand.

**Rows of ours can't be compared with published ones.** The publication was measured on highD and INTERACTION with CARLA, ours on
SUMO's traffic on our own maps. Who has those recordings gives their folder with `--recordings`, and gets the rows on them.
"""
_SMALLEST = """\
Tables that say *smallest settings* have one seed, {events} windows of each class, {budget} runs a search, and principal components
in the place of the encoder of grids. They show that each row is made, not how good a method is; with one seed there is no interval.
Rows of more seeds: [recognition](recognition-results.md), [generation](generation-results.md).
"""
_FULL = """\
All others have at most {events} windows of each class. Rows are means ± standard deviations over as many seeds as the table says,
of {seeds} that the command makes; none was used to choose a setting. *As published*: the encoder `{grids}` of occupancy grids, of the
publication's size; *as shipped*: tokens. A row of one seed has no interval: small differences from others mean nothing.
"""
_SMALLEST_MARK = ", smallest settings"
_ORDER = ("full", "smallest")
"""Scales, the one to show first"""


def text(results: Path) -> str:
    """The page of result files.

    Args:
        results: folder with one of tables by stage, and their journal, for each scale. A table of
            `full` is shown where there is one, else that of `smallest`.

    Raises:
        InvalidFile: a journal, or a table that is there, is damaged.
    """
    published = read_table(HERE / "published.csv")[1:]
    journals = {scale: read_journal(results / scale) for scale in _ORDER}
    paragraphs = {"full": _FULL, "smallest": _SMALLEST}
    parts = [
        _INTRODUCTION,
        *(
            paragraphs[scale].format(**SCALES[scale]._asdict())
            for scale in _ORDER
            if journals[scale]
        ),
        _components(),
    ]
    parts.append("## Recognition\n")
    for name, title, table, figures in _RECOGNITION:
        found, mark = _folder(results, [(stage, name) for stage in ("published", "shipped")])
        beside = _beside(found, name, published, table, figures)
        parts.append(_section((f"{table}: {title}" if table else title) + mark, beside))
    for name, symbol in (
        ("sensitivity-delta", "δ"),
        ("sensitivity-trees", "T"),
        ("sensitivity-w", "W"),
    ):
        for stage in ("published", "shipped"):
            found, mark = _folder(results, [(stage, name)])
            title = f"Figure 4: sensitivity to {symbol}, as {stage}{mark}"
            parts.append(_section(title, _plain(found / stage / f"{name}.csv")))
    parts.append("## Generation\n")
    for name, title, of in _GENERATION:
        found, mark = _folder(results, [("cut_in_highway", name)])
        rows = _with_published(found / "cut_in_highway" / f"{name}.csv", published, of)
        parts.append(_section(title + mark, rows))
    for stage in GEOMETRIES:
        found, mark = _folder(results, [(stage, "generated")])
        rows = _plain(found / stage / "generated.csv")
        parts.append(_section(f"Figure 8: {stage.replace('_', ' ')}{mark}", rows))
    parts += [_commands(journals[scale].values(), scale) for scale in _ORDER if journals[scale]]
    return "\n".join(part for part in parts if part)


def _folder(results: Path, tables: Iterable[tuple[str, str]]) -> tuple[Path, str]:
    """The folder of the first scale that has one of these tables (stage, name), and what its headings add."""
    wanted = list(tables)
    for scale in _ORDER:
        if any((results / scale / stage / f"{name}.csv").exists() for stage, name in wanted):
            return results / scale, _SMALLEST_MARK if scale == "smallest" else ""
    return results / _ORDER[-1], ""


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
_GENERATION = (
    ("generated", "Table 5: methods", "Table 5"),
    ("density", "Likelihoods of densities, section 4.3.3", ""),
    ("reconstruction", "Reconstruction from seven parameters", "Reconstruction"),
)
"""Tables of the searches of cut ins: name of the file, title, and the publication's table, if
any"""


def _components() -> str:
    header, *rows = read_table(HERE / "components.csv")
    return _section("Parts of the method", (header, rows), "##")


def _beside(
    folder: Path, name: str, published: Iterable[Sequence[str]], table: str, figures: Sequence[str]
) -> tuple[list[str], list[list[str]]] | None:
    """Rows as published, with the published settings here, and as shipped here."""
    paths = [folder / stage / f"{name}.csv" for stage in ("published", "shipped")]
    if any(path.exists() and _SEEDS in read_table(path)[0] for path in paths):
        figures = (*figures, _SEEDS)
    ours = [_columns(path, figures) for path in paths]
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
    return {
        row[0].strip("*"): [row[header.index(one)] if one in header else _NONE for one in figures]
        for row in rows
    }


def _with_published(
    path: Path, published: Iterable[Sequence[str]], table: str
) -> tuple[list[str], list[list[str]]] | None:
    found = _plain(path)
    if found is None:
        return None
    header, rows = found
    theirs = {figure: value for of, _, figure, value in published if of == table}
    if not theirs:
        return found
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
        [
            each.stage,
            f"`python -m {each.command}`" + (f" {each.note}" if each.note else ""),
            f"{each.seconds:.0f}",
            f"{each.cores} cores" + (f", {each.device}" if each.device else ""),
            each.date,
            each.commit,
        ]
        for each in entries
    ]
    total = sum(float(row[2]) for row in rows)
    header = ["stage", "command", "s", "machine", "date", "commit"]
    made = f"`python -m studies.publication{' --smallest' if scale == 'smallest' else ''}`"
    return (
        _section(f"Commands, {scale} settings", (header, rows), "##")
        + f"\n{made} runs them, {total / 60:.0f} minutes in all.\n"
    )
