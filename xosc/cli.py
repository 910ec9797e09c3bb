"""The command `xosc-list`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from schemas.commands.help import epilog
from schemas.commands.options import Version, deliver, guarded, new_app, protected, say
from schemas.errors import ExitCode, ToolchainError, exit_codes, gravest

if TYPE_CHECKING:
    from xosc.tags import Tag

_EXAMPLES = ('xosc-list --class "highway cut in" --verbose',)
_EPILOG = exit_codes("listed", "")

app = new_app()


@app.command(epilog=epilog(_EPILOG, *_EXAMPLES))
@protected("max_runs")
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
    content = tables.text(chosen, verbose) if format == "text" else tables.FORMATS[format](chosen)
    deliver(content, "the list", output)
    raise typer.Exit(gravest(codes))


def _tag(text: str) -> Tag:
    from xosc.tags import Tag

    name, _, value = text.partition("=")
    return Tag(name, value or None)


def main() -> None:
    """Entry point."""
    guarded("xosc-list", app, traced=False)


if __name__ == "__main__":
    main()
