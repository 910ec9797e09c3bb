"""`docs/publication.md`: parts of the method, and the published tables beside our rows, from result
files alone."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from studies.publication.pictures import FOLDER, PICTURES
from studies.publication.results import Entry, read_journal, read_table
from studies.publication.stages import GEOMETRIES, SCALES

HERE = Path(__file__).parent
PAGE = HERE.parents[1] / "docs" / "publication.md"
_NONE = "–"
_SEEDS = "seeds"
"""Column that says over how many seeds a row is a mean"""

_INTRODUCTION = """\
# The publication, row by row

This page is generated from the result files in `studies/results`: `python -m studies.publication`
makes both, `--page-only` the page alone. Edit neither by hand.

**Rows of ours can't be compared with published ones.** The publication was measured on highD and
INTERACTION with CARLA, ours on SUMO's traffic on our own maps. Who has those recordings gives their
folder with `--recordings`, and gets the rows on them.
"""
_SMALLEST = """\
Tables that say *smallest settings* have one seed, {events} windows of each class, {budget} runs a
search, and principal components in the place of the encoder of grids. They show that each row is
made, not how good a method is. Searches of more seeds: [planted
failures](generation-results.md#planted-failures).
"""
_FULL = """\
All others have at most {events} windows of each class and {budget} runs a search. *As published*:
the encoder `{grids}` of occupancy grids, of the publication's size; *as shipped*: tokens.
"""
_APPROACHES = """\
Cut ins before the T junction and before the four-way intersection are on the same approach, and end
before either: their rows are the same.
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
        _rests(results),
        _components(),
    ]
    parts.append("## Recognition\n")
    for name, title, table, figures in _RECOGNITION:
        heading = f"{table}: {title}" if table else title
        for found, mark, settings in _settings(results, name):
            beside = _beside(found, settings, name, published, table, figures)
            parts.append(_section(heading + mark, beside))
    parts.append(_pictures(results, "4"))
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
    for stage, name, title, of in _GENERATION:
        found, mark = _folder(results, [(stage, name)])
        rows = _with_published(found / stage / f"{name}.csv", published, of)
        parts.append(_section(title + mark, rows))
    parts.append(_pictures(results, "5", "6", "7", "8", "8 highways"))
    parts.append(_APPROACHES)
    for stage in GEOMETRIES:
        found, mark = _folder(results, [(stage, "generated")])
        rows = _plain(found / stage / "generated.csv")
        parts.append(_section(f"Figure 8: {stage.replace('_', ' ')}{mark}", rows))
    parts += [_commands(journals[scale].values(), scale) for scale in _ORDER if journals[scale]]
    return "\n".join(part for part in parts if part)


def finding(results: Path) -> Callable[[str, str], Path | None]:
    """Lookup of the table of a stage and a name, of the scale to show first."""

    def find(stage: str, name: str) -> Path | None:
        path = _folder(results, [(stage, name)])[0] / stage / f"{name}.csv"
        return path if path.exists() else None

    return find


def _pictures(results: Path, *figures: str) -> str:
    """The pictures of figures that there are tables of."""
    find = finding(results)
    lines = []
    for figure in figures:
        picture = PICTURES[figure]
        if picture.possible(find):
            paths = (find(stage, table) for stage in picture.stages for table in picture.tables)
            small = any(path is not None and "smallest" in path.parts for path in paths)
            caption = picture.caption.removesuffix(".") + (_SMALLEST_MARK if small else "") + "."
            lines.append(f"![{caption}]({FOLDER}/{picture.file})\n\n{caption}\n")
    return "\n".join(lines)


def _rests(results: Path) -> str:
    """Foundation of each table: seeds, trials, and data that settings were chosen on."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for title, stages, name in _RESTING:
        for stage in stages:
            found, mark = _folder(results, [(stage, name)])
            path = found / stage / f"{name}.csv"
            if path.exists():
                foundation = title, mark, _seeds(path), *_trials(found, stage)
                groups.setdefault(foundation, []).append(stage.replace("_", " "))
    rows = [
        [f"{title}: {', '.join(stages)}{mark}", *foundation]
        for (title, mark, *foundation), stages in groups.items()
    ]
    header = ["table", "seeds of a row", "trials of a seed", "settings were chosen on"]
    return _section("What rests on what", (header, rows), "##") + _STATISTICS if rows else ""


def _seeds(path: Path) -> str:
    """Fewest and most seeds of the rows of a table."""
    header, *rows = read_table(path)
    if _SEEDS not in header:
        return "1"
    counts = sorted({int(row[header.index(_SEEDS)]) for row in rows})
    return f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"


def _trials(folder: Path, stage: str) -> tuple[str, str]:
    """Trials of one seed of a stage, and what its settings were chosen on."""
    data = folder / stage / "data.csv"
    if not data.exists():
        budget = SCALES[folder.name].budget
        return f"{budget} runs a method, of which the last third counts", _SEARCHES_CHOSEN
    header, *rows = read_table(data)
    windows = sum(int(row[header.index("test")]) for row in rows)
    return f"{windows} test windows of {len(rows)} classes in five rounds", _RECOGNITION_CHOSEN


_RECOGNITION_CHOSEN = "seeds below 10"
_SEARCHES_CHOSEN = (
    "MCSG: not on record, so its rows count as seen; `cover`: planted systems of "
    "other shapes and seeds"
)
_STATISTICS = """
± is the standard deviation over seeds, each with its own split or its own draws; within a seed a
row of recognition is the mean over its rounds. Rows of one seed have no interval: differences from
others mean nothing. Comparisons with TRFE are two-sided paired t-tests over the seeds that both
rows have, from three seeds on: the result files have their p. RMSE_t and RMSE_s are of the seven
parameters, so the same for every method that searches these: the table of reconstruction has them
once.
"""
_RESTING = (
    ("Table 3", ("published", "shipped"), "open-set"),
    ("Table 4", ("published", "shipped"), "clustering"),
    ("Figure 3", ("published", "shipped"), "open-world"),
    ("Five rounds", ("published", "shipped"), "chain"),
    ("Table 5 and figure 7", ("cut_in_highway",), "generated"),
    ("Figure 8", GEOMETRIES, "generated"),
)
"""Tables whose foundation is said: title, stages, and name of the file"""


def _folder(results: Path, tables: Iterable[tuple[str, str]]) -> tuple[Path, str]:
    """The folder of the first scale that has one of these tables (stage, name),
    and what its headings add.
    """
    wanted = list(tables)
    for scale in _ORDER:
        if any((results / scale / stage / f"{name}.csv").exists() for stage, name in wanted):
            return results / scale, _SMALLEST_MARK if scale == "smallest" else ""
    return results / _ORDER[-1], ""


def _settings(results: Path, name: str) -> list[tuple[Path, str, tuple[str, ...]]]:
    """Folders that have a table of the protocol with the settings to show of each: the first scale
    of each setting, as scales can't stand in one row."""
    left, found = list(_SETTINGS), []
    for scale in _ORDER:
        made = [one for one in left if (results / scale / one / f"{name}.csv").exists()]
        left = [one for one in left if one not in made]
        if made:
            mark = _SMALLEST_MARK if scale == "smallest" else ""
            found.append((results / scale, mark, tuple(made)))
    return found or [(results / _ORDER[-1], "", _SETTINGS)]


_SETTINGS = ("published", "shipped")
"""Stages of the protocol: as published, and as shipped"""
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
    ("cut_in_highway", "generated", "Table 5: methods", "Table 5"),
    ("densities", "density", "Likelihoods of densities, section 4.3.3", ""),
    ("cut_in_highway", "reconstruction", "Reconstruction from seven parameters", "Reconstruction"),
)
"""Tables of cut ins: stage, name of the file, title, and the publication's table, if any"""


def _components() -> str:
    header, *rows = read_table(HERE / "components.csv")
    return _section("Parts of the method", (header, rows), "##")


def _beside(
    folder: Path,
    settings: Sequence[str],
    name: str,
    published: Iterable[Sequence[str]],
    table: str,
    figures: Sequence[str],
) -> tuple[list[str], list[list[str]]] | None:
    """Published rows, and ours with each of these settings."""
    paths = [folder / stage / f"{name}.csv" for stage in settings]
    if any(path.exists() and _SEEDS in read_table(path)[0] for path in paths):
        figures = (*figures, _SEEDS)
    ours = [_columns(path, figures) for path in paths]
    if not any(ours):
        return None
    theirs = {row: value for of, row, _, value in published if of == table}
    titles = dict.fromkeys((*theirs, *(title for rows in ours for title in rows)))
    header = [
        "",
        *(("published",) if theirs else ()),
        *(f"{figure}, as {stage}" for stage in settings for figure in figures),
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
    made = list(entries)
    rows = [
        [
            each.stage,
            f"`python -m {each.command}`" + (f" {each.note}" if each.note else ""),
            f"{each.seconds:.0f}" if each.seconds else _NONE,
            f"{float(each.processor):.0f}" if each.processor else _NONE,
            f"{each.cores} cores" + (f", {each.device}" if each.device else ""),
            each.date,
            each.commit,
        ]
        for each in made
    ]
    total = sum(each.seconds for each in made)
    counted = [float(each.processor) for each in made if each.processor]
    spent = f", {sum(counted) / 60:.0f} of processor time" if len(counted) == len(made) else ""
    header = ["stage", "command", "s", "processor s", "machine", "date", "commit"]
    command = f"`python -m studies.publication{' --smallest' if scale == 'smallest' else ''}`"
    return (
        _section(f"Commands, {scale} settings", (header, rows), "##")
        + f"\n{command} runs them, {total / 60:.0f} minutes in all{spent}.\n"
    )
