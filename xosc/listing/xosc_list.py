"""The command `xosc-list`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from schemas.common.errors import ExitCode, ToolchainError, UsageError, exit_codes, gravest
from schemas.common.storage import drafted, writing
from schemas.common.terminal.command_line import (
    Version,
    deliver,
    epilog,
    guarded,
    new_app,
    protected,
    say,
)
from schemas.common.terminal.files import complete_name
from schemas.common.terminal.options import READ, WRITTEN, completed

if TYPE_CHECKING:
    from pyarrow import Schema
    from pyarrow.compute import Expression

    from xosc.exports.draft import Folder
    from xosc.listing.tables import Index
    from xosc.writing.tags import Tag

_EXAMPLES = (
    "xosc-list results --where \"min_ttc < 1 and verdict = 'failed'\" --sort impact_speed",
    "xosc-list highway_lead_brake --copy-to mine",
    'xosc-list --class "highway cut in" --verbose',
    (
        "xosc-list CATALOGUE --where \"class = 'highway cut in' and min_ttc < 2 and ego_speed "
        'between 22 and 33" --sort min_ttc'
    ),
    "xosc-list CATALOGUE --where \"trust = 'agree'\" --distinct --copy-to DIR",
)
_EPILOG = exit_codes("listed", "")

app = new_app()


def _classes() -> list[str]:
    """Classes of the shipped scenarios."""
    from xosc.listing import LIBRARY, listing

    return sorted({scenario.label for scenario in listing([str(LIBRARY)]).scenarios} - {""})


@app.command(epilog=epilog(_EPILOG, *_EXAMPLES))
@protected("max_runs")
def xosc_list(
    paths: Annotated[
        list[str] | None,
        READ,
        typer.Argument(
            metavar="[PATH...]",
            autocompletion=complete_name,
            help="Files, folders, globs, names of shipped scenarios; results to ask."
            "  [default: the shipped library]",
        ),
    ] = None,
    label: Annotated[
        str | None,
        typer.Option(
            "--class",
            metavar="CLASS",
            autocompletion=completed(_classes),
            help="Scenarios of this class only.",
        ),
    ] = None,
    tag: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[=VALUE]", help="Scenarios with this tag only; may be given several times."
        ),
    ] = None,
    where: Annotated[
        str | None,
        typer.Option(
            metavar="CONDITION", help='Rows that meet this condition only, as "min_ttc < 1".'
        ),
    ] = None,
    sort: Annotated[
        list[str] | None,
        typer.Option(metavar="[-]COLUMN", help="Order of the rows, - descending; repeatable."),
    ] = None,
    columns: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME,...", help="Columns to write; repeatable."),
    ] = None,
    distinct: Annotated[
        bool, typer.Option("--distinct", help="Leave out near-duplicates, and name them.")
    ] = False,
    like: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Order the index's rows by their distance from this scenario."
        ),
    ] = None,
    copy_to: Annotated[
        Path | None,
        WRITTEN,
        typer.Option(
            metavar="DIR", help="Copy the scenarios with their roads, catalogues and index."
        ),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace other files that are in --copy-to.")
    ] = False,
    format: Annotated[
        Literal["text", "json", "csv", "parquet"],
        typer.Option(help="Format; csv of files has scenarios only, parquet is for rows."),
    ] = "text",
    output: Annotated[
        Path | None, WRITTEN, typer.Option(metavar="FILE", help="Write to a file.")
    ] = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Print parameters, variations and tags as well.")
    ] = False,
    _version: Version = False,
) -> None:
    """List scenarios: class, road, parameters with their limits, variations; and the catalogues
    that they use.

    --where, --sort and --columns ask folders of batches, runs, searches and catalogues, several of
    one kind joined; --distinct and --like compare scenarios of catalogues. Parameters are columns.
    """
    from schemas.common.terminal.files import LIBRARY
    from xosc.listing import FORMATS, Listing, listing, text

    if overwrite and copy_to is None:
        raise UsageError("--overwrite is for --copy-to")
    folder = _folder(copy_to, overwrite)
    asks = where is not None or sort or distinct or like or columns or _has_rows(paths, folder)
    # A catalogue's rows are a table, as those of batches are; without one they are its scenarios.
    whole = format in ("csv", "parquet") and not (label or tag) and _all_tables(paths)
    if asks or whole:
        if label or tag:
            raise UsageError(
                "--class and --tag are for lists of scenarios; rows of catalogues are asked by "
                f"--where, as --where \"class = '{label or '…'}'\""
            )
        if not paths:
            raise UsageError(
                "questions are to catalogues, batches and searches: name their folders"
            )
        asked = _asked(paths, where, sort or [], columns or [], distinct, like, folder, verbose)
        index, shown = asked
        _deliver_rows(index, shown if asks else index.table.column_names, format, output)
        return
    if format == "parquet":
        raise UsageError("--format parquet is for rows of catalogues, batches and searches")
    codes = [ExitCode.PASSED]

    def tell(error: ToolchainError) -> None:
        codes.append(error.exit_code)
        say(f"xosc-list: {error}", to=sys.stderr)

    listed = listing(paths or [str(LIBRARY)], tell)
    if not (listed.scenarios or listed.catalogues) and len(codes) > 1:
        raise typer.Exit(gravest(codes))
    chosen = Listing(listed.scenarios, listed.catalogues)
    if label or tag:
        chosen = Listing(listed.chosen(label, map(_tag, tag or [])), [])
    if folder is not None:
        from xosc.listing.tables import copy_scenarios

        say(
            f"{copy_scenarios(chosen.scenarios, folder)} files copied to {folder.path}",
            to=sys.stderr,
        )
    content = _cut(text(chosen, verbose), output) if format == "text" else FORMATS[format](chosen)
    deliver(content, "the list", output)
    raise typer.Exit(gravest(codes))


_MOST_LINES = 200
"""Lines of text up to which a terminal shows a list whole"""


def _cut(content: str, output: Path | None) -> str:
    """Text of a list, cut for a person at a terminal; whole for files and pipes."""
    lines = content.splitlines()
    if output is not None or not sys.stdout.isatty() or len(lines) <= _MOST_LINES:
        return content
    left = (
        f"... {len(lines) - _MOST_LINES:,} of {len(lines):,} lines are left out: --where or "
        "--class narrows them, --output FILE or a pipe has all"
    )
    return "\n".join([*lines[:_MOST_LINES], left]) + "\n"


def _folder(path: Path | None, overwrite: bool) -> Folder | None:
    from xosc.exports.draft import Folder

    return Folder(path, overwrite) if path is not None else None


def _all_tables(paths: list[str] | None) -> bool:
    from xosc.listing.tables import table_of

    return bool(paths) and all(map(table_of, paths or ()))


def _has_rows(paths: list[str] | None, folder: Folder | None) -> bool:
    """Whether paths are of tables without scenarios, or of an index to copy from."""
    from xosc.listing.tables import INDEX, table_of

    tables = [table_of(path) for path in paths or ()]
    if not all(tables):
        return False
    return bool(tables) and (
        folder is not None or all(path and path.name != INDEX for path in tables)
    )


def _asked(
    paths: list[str],
    where: str | None,
    sort: list[str],
    columns: list[str],
    distinct: bool,
    like: Path | None,
    folder: Folder | None,
    verbose: bool,
) -> tuple[Index, list[str]]:
    """Answer of tables to a question: the rows, and the columns of their text."""
    from xosc.listing import questions, tables
    from xosc.listing.tables import copy_rows

    def wanted(schema: Schema) -> Expression | None:
        return questions.condition(where, schema).expression if where is not None else None

    index = tables.read_all(paths, wanted)
    for option, given in (("--distinct", distinct), ("--like", like), ("--copy-to", folder)):
        if given:
            index.need_catalogue(option)
    shown = index.shown
    table = questions.similar(index, like) if like is not None else index.table
    if where is not None:
        question = questions.condition(where, table.schema)
        rows, shown = table.filter(question.expression), [*shown, *question.columns]
        whole = table if index.whole is None else index.whole.to_table(columns=question.columns)
        if not len(rows) and (hint := question.missing(whole)):
            say(f"xosc-list: {hint}", to=sys.stderr)
        table = rows
    if sort or like is None:
        table = questions.ordered(table, sort)
    if distinct:
        table = questions.distinct(table)
    shown += [name.removeprefix("-") for name in sort] + ["distance"] * (like is not None)
    if folder is not None:
        say(f"{copy_rows(index, table, folder)} files copied to {folder.path}", to=sys.stderr)
    if columns:
        shown = tables.chosen(columns, table)
        table = table.select(shown + ["duplicates"] * distinct)
    return index._replace(table=table), table.column_names if verbose else list(
        dict.fromkeys(shown)
    )


def _deliver_rows(answer: Index, shown: list[str], format: str, output: Path | None) -> None:
    """Write rows in a format, or print them."""
    from xosc.listing import of_rows

    if format != "parquet":
        content = of_rows(answer.table.to_pylist(), shown, format, answer.noun)
        content = _cut(content, output) if format == "text" else content
        deliver(content, "the list", output)
        return
    if output is None:
        raise UsageError("--format parquet is written to a file: --output FILE")
    import pyarrow.parquet as pq

    with writing("the list", output), drafted(output) as draft:
        pq.write_table(answer.table, draft, compression="zstd")


def _tag(text: str) -> Tag:
    from xosc.writing.tags import Tag

    name, _, value = text.partition("=")
    return Tag(name, value or None)


def main() -> None:
    """Entry point."""
    guarded("xosc-list", app, traced=False)


if __name__ == "__main__":
    main()
