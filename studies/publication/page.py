"""`docs/publication.md`: parts of the method, and the published tables beside our rows, from result
files alone."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from studies.publication.pictures import FOLDER, PICTURES
from studies.publication.results import Entry, read_journal, read_table
from studies.publication.stages import GEOMETRIES, OWN_RECORDINGS, SCALES

HERE = Path(__file__).parent
PAGE = HERE.parents[1] / "docs" / "publication.md"
_NONE = "–"
_SEEDS = "seeds"
"""Column that says over how many seeds a row is a mean"""

_INTRODUCTION = """\
# The publication, row by row

This page is generated from the result files in `studies/results`: `python -m studies.publication`
makes both, `--page-only` the page alone. Edit neither by hand.
"""
_ON_SUMO = """\
**Rows of ours can't be compared with published ones.** The publication was measured on highD and
INTERACTION with CARLA, ours on SUMO's traffic on our own maps, recorded in the formats of both. Who
has those recordings gives their folder with `--recordings`, and gets the rows on them.
"""
_ON_OWN = """\
Our rows are of the recordings that the commands below name. Those of generation were run on SUMO,
or kinematically, and the published ones on CARLA.
"""
_SMALLEST = """\
Tables that say *smallest settings* have one seed, {events} windows of each class, {budget} runs a
search, and principal components in the place of the encoder of grids. They show that each row is
made, not how good a method is. Components are few for their windows there: with as many as half of
the training windows these lay further apart than test windows, and TRFE, which learns distances,
was below plain votes. Searches of more seeds: [planted
failures](generation-results.md#planted-failures).
"""
_MIDDLE = """\
Tables that say *middle settings* have the recordings of the full ones, {seeds} seeds, at most
{events} windows of each class, and the small encoder `{grids}` in the place of the publication's:
five seeds of that one take a GPU for hours. Figure 3 and W have one seed, and the
rounds that the notes beside the commands below say.
"""
_FULL = """\
All others have at most {events} windows of each class and {budget} runs a search. *As published*:
the encoder `{grids}` of occupancy grids, of the publication's size; *as shipped*: tokens. The rows
differ in what follows the encoder: the publication's own screening is *reading A of plain votes*,
ours *TRFE*, on either encoder.
"""
_APPROACHES = """\
Cut ins before the T junction and before the four-way intersection are on the same approach, and end
before either: their rows are the same.
"""
_MARKS = {"full": "", "middle": ", middle settings", "smallest": ", smallest settings"}
"""Scales, the one to show first, and what they add to headings"""
_ALWAYS = ("open-set",)
"""Tables of which the smallest settings are shown beside others: there a method that needs many
windows falls behind first"""


def text(results: Path) -> str:
    """The page of result files.

    Args:
        results: folder with one of tables by stage, and their journal, for each scale. A table of
            `full` is shown where there is one, else that of `smallest`.

    Raises:
        InvalidFile: a journal, or a table that is there, is damaged.
    """
    published = read_table(HERE / "published.csv")[1:]
    journals = {scale: read_journal(results / scale) for scale in _MARKS}
    paragraphs = {"full": _FULL, "middle": _MIDDLE, "smallest": _SMALLEST}
    parts = [
        _INTRODUCTION,
        _ON_OWN if any(OWN_RECORDINGS in journal for journal in journals.values()) else _ON_SUMO,
        *(
            paragraphs[scale].format(**SCALES[scale]._asdict())
            for scale in _MARKS
            if journals[scale]
        ),
        _rests(results),
        _components(results),
        _above(results),
    ]
    parts.append("## Recognition\n")
    for name, title, table, figures in _RECOGNITION:
        heading = f"{table}: {title}" if table else title
        shown = _settings(results, name, _SETTINGS)
        for found, mark, settings in shown or [(results / "smallest", "", _SETTINGS)]:
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
    for found, mark, settings in _settings(results, "generated", GEOMETRIES):
        title = f"Figure 8: searches of {SCALES[found.name].budget} runs{mark}"
        parts.append(_section(title, _geometries(found, settings)))
    parts += [_commands(journals[scale].values(), scale) for scale in _MARKS if journals[scale]]
    return "\n".join(part for part in parts if part)


def _geometries(folder: Path, stages: Iterable[str]) -> tuple[list[str], list[list[str]]]:
    """Rows of all geometries in one table, with the name of theirs first."""
    header, rows = list[str](), list[list[str]]()
    for stage in stages:
        header, *some = read_table(folder / stage / "generated.csv")
        rows += [[stage.replace("_", " "), *row] for row in some]
    return ["geometry", *header], rows


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
            paths = [find(stage, table) for stage in picture.stages for table in picture.tables]
            scales = {path.parts[-3] for path in paths if path is not None} - {"full"}
            marks = "".join(_MARKS[scale] for scale in _MARKS if scale in scales)
            caption = picture.caption.removesuffix(".") + marks + "."
            lines.append(f"![{caption}]({FOLDER}/{picture.file})\n\n{caption}\n")
    return "\n".join(lines)


def _rests(results: Path) -> str:
    """Foundation of each table: seeds, trials, and data that settings were chosen on."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for title, stages, name in _RESTING:
        for found, mark, shown in _settings(results, name, stages):
            for stage in shown:
                path = found / stage / f"{name}.csv"
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
    for scale, mark in _MARKS.items():
        if any((results / scale / stage / f"{name}.csv").exists() for stage, name in wanted):
            return results / scale, mark
    return results / "smallest", ""


def _settings(
    results: Path, name: str, stages: Sequence[str]
) -> list[tuple[Path, str, tuple[str, ...]]]:
    """Folders that have a table with the stages to show of each, as scales can't stand in one row:
    all of the full and the middle scale, and of the smallest what neither has.
    """
    left, found = list(stages), []
    for scale, mark in _MARKS.items():
        there = [one for one in stages if (results / scale / one / f"{name}.csv").exists()]
        wanted = left if scale == "smallest" and name not in _ALWAYS else stages
        made = tuple(one for one in there if one in wanted)
        left = [one for one in left if one not in made]
        if made:
            found.append((results / scale, mark, made))
    return found


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


def _above(results: Path) -> str:
    """Rows of recognition that are above TRFE in what their table is about; those of the smallest
    settings have one seed and are left out.
    """
    rows = []
    for name, title, _, figures in _RECOGNITION:
        figure = figures[-1] if "after" in figures[-1] else figures[0]
        for folder, mark, stages in _settings(results, name, _SETTINGS):
            for stage in stages if folder.name != "smallest" else ():
                where = f"{title}, as {stage}{mark}: {figure}"
                rows += [[where, *row] for row in _better(folder / stage / f"{name}.csv", figure)]
    header = ["where", _OURS, "row", "its figure", "seeds", "p"]
    better = [
        title
        for *_, title, _, _, p in rows
        if "given K" not in title and p != _NONE and float(p) <= _CERTAIN
    ]
    shown = f"Shown to be better: {', '.join(better)}." if better else _NO_OTHER
    table = _section("Rows above TRFE", (header, rows), "##")
    return table + _GIVEN.format(shown=shown) if rows else ""


def _better(path: Path, figure: str) -> list[list[str]]:
    """Rows of a table whose mean is above TRFE's: TRFE's figure, title, figure, seeds and p."""
    table = {title: row for title, row in _rows(path).items() if row[figure] != _NONE}
    ours = table.pop(_OURS, {}).get(figure, "inf")
    return [
        [ours, title, row[figure], row.get(_SEEDS, "1"), row.get("p", _NONE)]
        for title, row in table.items()
        if float(row[figure].split()[0]) > float(ours.split()[0])
    ]


_GIVEN = """
Rows *given K* are told the number of new classes, which TRFE has to find; *as shipped* is what the
product does. p is of a two-sided paired t-test over the seeds that both rows have, from three on.
{shown}
Training the encoder again needs the windows that it was trained on besides, which a model that is
passed on does not have.
"""
_NO_OTHER = "No other row is shown to be better: all are without p, or their p is above 0.05."
_CERTAIN = 0.05
"""Greatest p of a row that is shown to be better"""
_OURS = "TRFE"


def _rows(path: Path) -> dict[str, dict[str, str]]:
    """Rows of a table by their titles, each by the names of columns; nothing where there is no
    table."""
    if not path.exists():
        return {}
    header, *rows = read_table(path)
    return {row[0].rstrip(" †").strip("*"): dict(zip(header, row, strict=True)) for row in rows}


def _components(results: Path) -> str:
    """Parts of the method, each with the rows that measure its difference."""
    header, *rows = read_table(HERE / "components.csv")
    shown = [[*row[:-1], _measured(results, row[-1]) if row[-1] else _NONE] for row in rows]
    return _section("Parts of the method", ([*header[:-1], "measured"], shown), "##")


def _measured(results: Path, wanted: str) -> str:
    """Cells of result files: `stage|table|figure|row|row…`, several joined by ` & `; without rows,
    that of the only one, whose title is a number."""
    return "; ".join(_cells(results, *one.split("|")) for one in wanted.split(" & "))


def _cells(results: Path, stage: str, name: str, figure: str, *titles: str) -> str:
    """A figure of rows of a table, of the scale that has most seeds of all of them."""
    best, found = 0, ""
    for scale, mark in _MARKS.items():
        rows = _rows(results / scale / stage / f"{name}.csv")
        if not titles and rows:
            ((count, row),) = rows.items()
            return f"{figure} {row[figure]} ({count} {next(iter(row))}{mark})"
        chosen = [rows[title] for title in titles if figure in rows.get(title, {})]
        seeds = min((int(row.get(_SEEDS, "1")) for row in chosen), default=0)
        if len(chosen) == len(titles) and seeds > best:
            values = ", ".join(
                _cell(title, figure, rows[title], _TESTED.get(name)) for title in titles
            )
            many = f"{seeds} seed{'s' * (seeds > 1)}" if _SEEDS in chosen[0] else ""
            rests = ", ".join(part for part in (f"as {stage}" * (stage in _SETTINGS), many) if part)
            best, found = seeds, f"{figure} {values} ({rests}{mark})".replace(" ()", "")
    return found or f"{figure}: not made yet"


def _cell(title: str, figure: str, row: dict[str, str], tested: str | None) -> str:
    """The figure of a row with its name, and p where the table has it and it is that of the figure
    that is compared."""
    p = row.get("p", _NONE)
    return f"*{title}* {row[figure]}" + (f" (p {p})" if p != _NONE and figure == tested else "")


_TESTED = {
    "open-set": "macro-F1",
    "clustering": "ACC_cluster",
    "open-world": "macro-F1 after",
    "chain": "macro-F1 after",
}
"""Figure of a table by which its rows are compared with TRFE in result files"""


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
    clock = [each.seconds for each in made if each.seconds]
    counted = [float(each.processor) for each in made if each.processor]
    spent = [
        f"{sum(times) / 60:.0f} minutes {what}"
        for times, what in ((clock, "by the clock"), (counted, "of processor time"))
        if len(times) == len(made)
    ]
    header = ["stage", "command", "s", "processor s", "machine", "date", "commit"]
    command = f"`python -m studies.publication{'' if scale == 'full' else f' --{scale}'}`"
    return (
        _section(f"Commands, {scale} settings", (header, rows), "##")
        + f"\n{command} runs them{', ' * bool(spent)}{', '.join(spent)}.\n"
    )
