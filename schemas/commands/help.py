"""Help of all commands: options in groups, sections that explain an option, examples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import typer
from typer.core import TyperCommand

GROUPS: dict[str, tuple[str, ...]] = {
    "Runs": (
        "sut", "ego", "timestep", "seed", "max_time", "world", "end_after_collision", "fail_if", "allow_inconclusive", "dry_run",
    ),
    "Parameters": ("param", "only", "sample", "repeat", "enforce_constraints", "free", "pin", "density", "recorded", "kind"),
    "Files and roads": ("strict", "road", "road_path", "catalog_path"),
    "Output": (
        "out", "overwrite", "output", "format", "osi", "plot", "replay", "against", "assess", "gui", "junit",
        "junit_inconclusive", "verbose", "quiet",
    ),
    "Processes and limits": ("jobs", "ray", "resume", "untrusted", "max_memory", "max_seconds", "max_runs"),
}  # fmt: skip
"""Headings of options by the names of their parameters; all other options stand under `Options`, before them."""
Section = Callable[[], tuple[str, list[tuple[str, str]]]]
"""Gives a heading, and names with a line each; called when help is printed."""
_sections: dict[str, Section] = {}


def explain(option: str, section: Section) -> None:
    """Add a section to the help of every command that has an option, given by the name of its parameter."""
    _sections[option] = section


def epilog(codes: str, *examples: str) -> str:
    """The end of a command's help: examples, one command line each, and its exit codes."""
    return "\n".join(["\b", "Examples:", *(f"  {each}" for each in examples), "", codes])


class GroupedCommand(TyperCommand):
    """A command whose help has options under headings."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Arguments, options without a group, groups, sections."""
        heading = {name: title for title, names in GROUPS.items() for name in names}
        found: dict[str, list[tuple[str, str]]] = {title: [] for title in ("Arguments", "Options", *GROUPS)}
        names = []
        for param in self.get_params(ctx):
            record = param.get_help_record(ctx)
            if record is not None:
                name = param.name or ""
                found["Arguments" if param.param_type_name == "argument" else heading.get(name, "Options")].append(record)
                names.append(name)
        explained = (_sections[name]() for name in names if name in _sections)
        for title, records in (*found.items(), *explained):
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)


class App(typer.Typer):
    """A typer app whose commands are grouped ones."""

    def command(self, name: str | None = None, **options: Any) -> Any:
        """As `typer.Typer.command`."""
        options.setdefault("cls", GroupedCommand)
        return super().command(name, **options)
