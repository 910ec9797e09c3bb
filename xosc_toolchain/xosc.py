"""The command `xosc`: all commands of the package under one name, and their
completion in shells.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from schemas.common.errors import UsageError, exit_codes, nearest
from schemas.common.terminal.command_line import (
    CommandGroup,
    Verbose,
    Version,
    guarded,
    new_app,
    out_folder,
    say,
)
from schemas.common.terminal.options import parameters_of
from xosc_toolchain.start import load

SCENARIO, VARIATION = "highway_lead_brake", "simple_cut_in_variation"
"""Shipped scenario and variation that new ones begin as"""

NAME = "xosc"
COMMANDS = {
    "check": "check files and folders by ASAM's schemas and rules",
    "explore": "move a scenario's parameters on a local page, its run follows",
    "export": "export scenarios, or runs of them, for other tools",
    "generate": "search for plausible parameters at which a system fails",
    "list": "list the library by class, road and parameters",
    "loop": "recognise, search, check and run a folder",
    "recognize": "turn recordings into catalogues of scenarios",
    "replay": "write pages, pictures and reports of results",
    "road": "convert, compare, show, cut and check maps",
    "run": "run scenarios and variation files on SUMO",
}
"""Line of help of each command; `xosc run` is `xosc-run`"""
EXTENSIONS = ("action", "condition", "measure", "criterion", "export", "dataset", "system")
"""Kinds that `xosc new plugin` has a template of"""
SHELLS = ("bash", "zsh", "fish", "powershell")


class _Commands(CommandGroup):
    """Loads a command when it is asked for."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Names of all commands."""
        return [*COMMANDS, *super().list_commands(ctx)]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """A command; its module is imported where more than its name is asked for."""
        if cmd_name not in COMMANDS:
            found = super().get_command(ctx, cmd_name)
            if found is None and not ctx.resilient_parsing:
                names = self.list_commands(ctx)
                raise UsageError(f"there is no command {cmd_name!r}; {nearest(cmd_name, names)}")
            return found
        command = typer.main.get_command(load(f"{NAME}-{cmd_name}").app)
        command.name = cmd_name
        return command

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Names and lines, without importing anything."""
        own = [(name, command.get_short_help_str(60)) for name, command in self.commands.items()]
        with formatter.section("Commands"):
            formatter.write_dl([*COMMANDS.items(), *own])


app = new_app(NAME, _Commands)


_EPILOG = "xosc COMMAND --help explains a command; xosc-COMMAND is the same. " + exit_codes(
    "done", "a finding"
)


@app.callback(epilog=_EPILOG)
def xosc(_verbose: Verbose = False, _version: Version = False) -> None:
    """Run, check, vary, recognise and export OpenSCENARIO scenarios."""


new = new_app("new")
app.add_typer(new, name="new")


@new.callback()
def new_of() -> None:
    """Write a project, scenario, variation or plug-in to begin with."""


@new.command()
def plugin(
    name: Annotated[str, typer.Argument(help="Name of the package.")],
    kinds: Annotated[
        list[str] | None,
        typer.Option(
            "--kind",
            metavar="KIND",
            help=f"{', '.join(EXTENSIONS)}; several by several --kind. "
            "Without it a measure and an export.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[Path, out_folder("Folder in which the package is written.")] = Path(),
) -> None:
    """Write a package that extends the toolchain, with its test, to be installed by pip."""
    from xosc_toolchain.plugin import write_plugin

    say(*map(str, write_plugin(name, kinds or ("measure", "export"), out)))
    say(f"begin with: pip install -e {out / name} && python -m pytest {out / name}")


@new.command()
def scenario(
    name: Annotated[str, typer.Argument(help="Name of the scenario.")],
    like: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="Scenario that it begins as: a file, or the name of a shipped one."
        ),
    ] = SCENARIO,
    param: Annotated[
        list[str] | None,
        typer.Option(
            "--param", "-p", metavar="NAME=VALUE", help="Value of a parameter (repeatable)."
        ),
    ] = None,
    out: Annotated[Path, out_folder("Folder in which it is written.")] = Path(),
) -> None:
    """Write a scenario with its road and catalogue."""
    from xosc_toolchain.plugin import declare, write_scenario

    values = parameters_of(param or ())
    files = write_scenario(name, like, out)
    declare(files[0], values)
    say(*map(str, files))


@new.command()
def variation(
    name: Annotated[str, typer.Argument(help="Name of the variation file.")],
    like: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Variation that it begins as, shipped or a file; or a scenario, whose first two "
            "parameters with limits it varies.",
        ),
    ] = VARIATION,
    out: Annotated[Path, out_folder("Folder in which it is written.")] = Path(),
) -> None:
    """Write a variation file with its scenario, or one of your scenario."""
    from xosc_toolchain.plugin import write_variation

    say(*map(str, write_variation(name, like, out)))


@new.command()
def project(
    name: Annotated[str, typer.Argument(help="Name of the folder.")],
    out: Annotated[Path, out_folder("Folder in which it is made.")] = Path(),
) -> None:
    """Write a folder with settings (xosc.toml), a scenario and a variation of it."""
    from xosc_toolchain.plugin import write_project

    say(*map(str, write_project(name, VARIATION, out)))
    say(f"begin with: cd {out / name} && xosc-run scenarios")


@app.command()
def init(
    folder: Annotated[Path, out_folder("Folder in which xosc.toml is written.")] = Path(),
) -> None:
    """Write xosc.toml, the settings of a project."""
    from xosc_toolchain.settings import write_settings

    say(str(write_settings(folder)))


@app.command()
def config(
    command: Annotated[
        str | None,
        typer.Argument(
            metavar="[COMMAND]", help="All options of this command.", show_default=False
        ),
    ] = None,
) -> None:
    """Print settings, and where each comes from."""
    from xosc_toolchain.settings import lines, rows

    say(*lines(list(rows(command))))


@app.command()
def completion(shell: Annotated[str, typer.Argument(help=f"One of {', '.join(SHELLS)}.")]) -> None:
    """Print the script by which a shell completes commands.

    \b
    bash:        xosc completion bash >> ~/.bashrc
    zsh:         xosc completion zsh >> ~/.zshrc
    fish:        xosc completion fish > ~/.config/fish/completions/xosc.fish
    PowerShell:  xosc completion powershell >> $PROFILE
    """
    from typer.completion import get_completion_script  # type: ignore[attr-defined]

    if shell not in SHELLS:
        raise UsageError(f"the shell {shell!r} is not one of {', '.join(SHELLS)}")
    for name in (NAME, *(f"{NAME}-{command}" for command in COMMANDS)):
        variable = f"_{name}_COMPLETE".replace("-", "_").upper()
        print(get_completion_script(prog_name=name, complete_var=variable, shell=shell))


def main() -> None:
    """Entry point."""
    if sys.argv[1:2] == ["help"]:  # as of git and docker
        sys.argv[1:] = [*sys.argv[2:], "--help"]
    if len(sys.argv) > 1 and sys.argv[1] in COMMANDS:
        command = sys.argv.pop(1)
        sys.argv[0] = f"{NAME} {command}"
        load(f"{NAME}-{command}").main()
    guarded(NAME, app)


if __name__ == "__main__":
    main()
