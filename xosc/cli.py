"""The command `xosc-list`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from schemas.commands.options import Version, deliver, guarded_reader, new_app

if TYPE_CHECKING:
    from xosc.tags import Tag

_EPILOG = "Exit codes: 0 listed, 2 wrong usage or nothing like that is there, 3 invalid file, 4 a file of an unknown version."

app = new_app()


@app.command(epilog=_EPILOG)
def xosc_list(
    paths: Annotated[
        list[str] | None, typer.Argument(metavar="[PATH...]", help="Files, folders and globs.  [default: the shipped library]")
    ] = None,
    label: Annotated[str | None, typer.Option("--class", metavar="CLASS", help="Scenarios of this class only.")] = None,
    tag: Annotated[
        list[str] | None, typer.Option(metavar="NAME[=VALUE]", help="Scenarios with this tag only; may be given several times.")
    ] = None,
    format: Annotated[Literal["text", "json", "csv"], typer.Option(help="csv has the scenarios only.")] = "text",
    output: Annotated[Path | None, typer.Option(metavar="FILE", help="Write to a file.")] = None,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print parameters, variations and tags as well.")] = False,
    _version: Version = False,
) -> None:
    """List scenarios: class, road, parameters with their limits, variations; and the catalogues that they use."""
    from xosc import tables
    from xosc.listing import LIBRARY, Listing, listing

    found = listing(paths or [str(LIBRARY)])
    chosen = Listing(found.scenarios, found.catalogues)
    if label or tag:
        chosen = Listing(found.chosen(label, map(_tag, tag or [])), [])
    content = tables.text(chosen, verbose) if format == "text" else tables.FORMATS[format](chosen)
    deliver(content, "the list", output)


def _tag(text: str) -> Tag:
    from xosc.tags import Tag

    name, _, value = text.partition("=")
    return Tag(name, value or None)


def main() -> None:
    """Entry point."""
    guarded_reader("xosc-list", app)


if __name__ == "__main__":
    main()
