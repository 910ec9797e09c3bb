"""The command `xosc-list`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from schemas.common.errors import ExitCode, ToolchainError, UsageError, exit_codes, gravest
from schemas.common.terminal.command_line import (
    Version,
    deliver,
    epilog,
    guarded,
    new_app,
    protected,
    say,
)
from schemas.common.terminal.options import READ, WRITTEN

if TYPE_CHECKING:
    from xosc.exports.draft import Folder
    from xosc.writing.tags import Tag

_EXAMPLES = (
    'xosc-list --class "highway cut in" --verbose',
    "xosc-list CATALOGUE --where \"class = 'highway cut in' and min_ttc < 2 and ego_speed between 22 and 33\" --sort min_ttc",
    "xosc-list CATALOGUE --where \"trust = 'agree'\" --distinct --copy-to DIR",
)
_EPILOG = exit_codes("listed", "")

app = new_app()


@app.command(epilog=epilog(_EPILOG, *_EXAMPLES))
@protected("max_runs")
def xosc_list(
    paths: Annotated[
        list[str] | None,
        READ,
        typer.Argument(
            metavar="[PATH...]", help="Files, folders and globs.  [default: the shipped library]"
        ),
    ] = None,
    label: Annotated[
        str | None, typer.Option("--class", metavar="CLASS", help="Scenarios of this class only.")
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
            metavar="CONDITION", help="Rows of a catalogue's index that meet this condition only."
        ),
    ] = None,
    sort: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[-]COLUMN", help="Order of the index's rows, - descending; repeatable."
        ),
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
        Literal["text", "json", "csv"], typer.Option(help="csv has the scenarios only.")
    ] = "text",
    output: Annotated[
        Path | None, WRITTEN, typer.Option(metavar="FILE", help="Write to a file.")
    ] = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Print parameters, variations and tags as well.")
    ] = False,
    _version: Version = False,
) -> None:
    """List scenarios: class, road, parameters with their limits, variations; and the catalogues that they use.

    --where, --sort, --distinct, --like and --copy-to ask the index of a catalogue that
    xosc-recognize wrote.
    """
    from xosc.listing import FORMATS, LIBRARY, Listing, listing, text

    if overwrite and copy_to is None:
        raise UsageError("--overwrite is for --copy-to")
    if where is not None or sort or distinct or like or copy_to:
        if label or tag or paths is None or len(paths) != 1:
            raise UsageError(
                "questions are to one catalogue: name its folder; --where \"class = '…'\" is for --class and --tag"
            )
        from xosc.exports.draft import Folder

        folder = Folder(copy_to, overwrite) if copy_to is not None else None
        deliver(
            _asked(paths[0], where, sort or [], distinct, like, folder, format, verbose),
            "the list",
            output,
        )
        return
    codes = [ExitCode.PASSED]

    def tell(error: ToolchainError) -> None:
        codes.append(error.exit_code)
        say(f"xosc-list: {error}", to=sys.stderr)

    found = listing(paths or [str(LIBRARY)], tell)
    if not (found.scenarios or found.catalogues) and len(codes) > 1:
        raise typer.Exit(gravest(codes))
    chosen = Listing(found.scenarios, found.catalogues)
    if label or tag:
        chosen = Listing(found.chosen(label, map(_tag, tag or [])), [])
    content = text(chosen, verbose) if format == "text" else FORMATS[format](chosen)
    deliver(content, "the list", output)
    raise typer.Exit(gravest(codes))


def _asked(
    path: str,
    where: str | None,
    sort: list[str],
    distinct: bool,
    like: Path | None,
    folder: Folder | None,
    format: str,
    verbose: bool,
) -> str:
    """Answer of an index to a question, in a format."""
    from xosc.listing import of_rows, questions

    index = questions.read_index(path)
    shown = [name for name in ("file", "class") if name in index.table.column_names]
    table = questions.similar(index, like) if like is not None else index.table
    if where is not None:
        question = questions.condition(where, table.schema)
        table, shown = table.filter(question.expression), [*shown, *question.columns]
    if sort or like is None:
        table = questions.ordered(table, sort)
    if distinct:
        table = questions.distinct(table)
    shown += [name.removeprefix("-") for name in sort] + ["distance"] * (like is not None)
    if folder is not None:
        say(f"{questions.copy(index, table, folder)} files copied to {folder.path}", to=sys.stderr)
    return of_rows(
        table.to_pylist(), table.column_names if verbose else list(dict.fromkeys(shown)), format
    )


def _tag(text: str) -> Tag:
    from xosc.writing.tags import Tag

    name, _, value = text.partition("=")
    return Tag(name, value or None)


def main() -> None:
    """Entry point."""
    guarded("xosc-list", app, traced=False)


if __name__ == "__main__":
    main()
