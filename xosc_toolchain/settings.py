"""Settings of a project over all commands: those that exist, a file to begin with, and where each
value comes from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from schemas.common.errors import UsageError, nearest
from schemas.common.storage import keep, writing
from schemas.common.terminal.settings_file import FILE, SettingsFile, read, settings_of
from xosc_toolchain.start import MODULES, load

if TYPE_CHECKING:
    from schemas.common.terminal.settings_file import Setting

COMMANDS = tuple(sorted(name.removeprefix("xosc-") for name in MODULES if "-" in name))
"""Commands that a settings file may have tables of"""
_DEFAULT = "default"
_TEMPLATE = """\
# Settings of all xosc commands, found from the working folder upwards; what the command line says
# wins. `xosc config` shows each value and where it comes from.

# The system under test. adas has a radar; without this line it is cas, which sees 10 m as published
# and fails most ordinary manoeuvres at motorway speeds.
sut = "adas"

# Limits by which a run fails besides collisions of the ego.
# fail-if = ["min_ttc<1"]

# Evidence without which a run is inconclusive.
# least = ["ego_seconds=2"]

# Folders with roads and catalogues that are not where scenarios say, relative to this file.
# road-path = ["maps"]
# catalog-path = ["catalogs"]

seed = 0
jobs = 2

# Options of one command stand in its table.
# [run]
# out = "results"
"""


def shared_settings() -> dict[str, Setting]:
    """Return the settings that stand at the top of a file, by key."""
    from runner.batch.options import BatchOptions
    from runner.judging.settings import RunSettings
    from schemas.common.terminal.command_line import limits_parameters
    from schemas.common.terminal.options import options_of

    parameters = (*options_of(RunSettings), *options_of(BatchOptions), *limits_parameters())
    return {key: setting for key, setting in settings_of(parameters).items() if setting.shared}


def of_command(name: str) -> dict[str, Setting]:
    """Return the settings of a command, or of all commands in a group, by key.

    Raises:
        UsageError: there is no such command.
    """
    import typer

    if name not in COMMANDS:
        raise UsageError(f"there is no command {name!r}; {nearest(name, COMMANDS)}")
    command: Any = typer.main.get_command(load(f"xosc-{name}").app)
    settings: dict[str, Setting] = {}
    for subcommand in getattr(command, "commands", {"": command}).values():
        settings |= subcommand.settings()
    return settings


def unknown(key: str) -> str:
    """Return the message about a key that is no shared setting."""
    dashed = key.replace("_", "-")
    shared = shared_settings()
    if dashed not in shared:
        tables = [name for name in COMMANDS if dashed in of_command(name)]
        if tables:
            table = "run" if "run" in tables else tables[0]
            return f"this is an option of single commands: it stands in a table, as [{table}]"
    return f"there is no such setting; {nearest(dashed, shared)}"


class SettingRow(NamedTuple):
    """A value that holds: its key, with its table where it has one, its text, and where it comes
    from."""

    key: str
    value: str
    source: str


def rows(command: str | None = None) -> Iterator[SettingRow]:
    """Yield the values that hold in the working folder: those of all commands, or of one.

    Raises:
        InvalidFile: the settings file is wrong.
        UsageError: there is no such command.
    """
    file = read()
    shared = shared_settings()
    chosen = shared if command is None else of_command(command)
    for key, setting in chosen.items():
        own = command is not None and file is not None and key in file.tables.get(command, {})
        yield _row(setting, file, command or "" if own else "")
    if command is None and file is not None:
        for table, values in file.tables.items():
            offered = of_command(table)
            for key in values:
                if key not in offered:
                    told = f"{table} has no such option; {nearest(key, offered)}"
                    raise file.fault(key, table, told)
                yield _row(offered[key], file, table)


def _row(setting: Setting, file: SettingsFile | None, table: str) -> SettingRow:
    key = f"{table}.{setting.key}" if table else setting.key
    at_top = setting.shared and file is not None and setting.key in file.values
    if file is None or not (table or at_top):
        required = setting.default is ...
        return SettingRow(key, "" if required else _text(setting.default), _DEFAULT)
    line = file.line(setting.key, table)
    place = str(file.path) if line is None else f"{file.path}:{line}"
    return SettingRow(key, _text(file.value(setting, table)), place)


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return ", ".join(map(str, value))
    return "–" if value is None else str(value)


def lines(found: Sequence[SettingRow]) -> list[str]:
    """Return rows as lines in columns, those of the settings file first."""
    found = sorted(found, key=lambda row: row.source == _DEFAULT)
    wide, long = (max((len(row[i]) for row in found), default=0) for i in (0, 1))
    return [f"{row.key:{wide}}  {row.value:{long}}  {row.source}" for row in found]


def write_settings(folder: Path) -> Path:
    """Write a settings file to begin with; its path.

    Raises:
        UsageError: there is one, or it can't be written.
    """
    path = folder / FILE
    if path.exists():
        raise UsageError("this file is there already", path=path)
    with writing("the settings", path):
        folder.mkdir(parents=True, exist_ok=True)
        keep(_TEMPLATE.encode(), path)
    return path
