"""Settings of a project: `xosc.toml`, or the table `[tool.xosc]` of `pyproject.toml`, in the
working folder or above it.

    sut = "adas"
    fail-if = ["min_ttc<1"]
    road-path = ["maps"]

    [run]
    out = "results"

Keys are the long names of options. Those that options declare as `SHARED` stand at the top and hold
for every command that has them; a command's table takes all of its options. Paths are relative to
the file. What the command line says wins.
"""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from schemas.common.errors import InvalidFile, nearest
from schemas.common.packages import offered
from schemas.common.terminal.options import SHARED, FileUse, file_use

FILE, PROJECT = "xosc.toml", "pyproject.toml"
_MARK = b"tool.xosc"
_MAX_BYTES = 1 << 20
_NEVER = ("untrusted",)
"""Parameters that a file can't set: under --untrusted it is not read"""
_KINDS = {bool: "true or false", int: "a whole number", float: "a number"}


class Setting(NamedTuple):
    """An option that a settings file may set.

    Attributes:
        key: its name in files, that of the option without dashes.
        parameter: of the command. kind: type of its value.
        files: use of the files that it names. shared: whether it stands at the top of a file.
        default: its value without a file; `...` for an option that is required.
    """

    key: str
    parameter: str
    kind: Any
    files: FileUse | None
    shared: bool
    default: Any

    @property
    def is_list(self) -> bool:
        """Whether its value is a list."""
        return get_origin(self.kind) is list


def settings_of(parameters: Iterable[inspect.Parameter]) -> dict[str, Setting]:
    """Return the settings among the parameters of a command, by key."""
    from typer.models import OptionInfo

    settings = {}
    for parameter in parameters:
        annotation = parameter.annotation
        kind, *metadata = get_args(annotation) if get_origin(annotation) is Annotated else (None,)
        info = next((item for item in metadata if isinstance(item, OptionInfo)), None)
        # Eager ones, as --version, end the command: in a file they would end each.
        if info is None or info.is_eager or parameter.name in _NEVER:
            continue
        texts = (info.default, *(info.param_decls or ()))  # typer takes the first name as a default
        names = [name for text in texts if isinstance(text, str) for name in text.split("/")]
        long = [name.removeprefix("--") for name in names if name.startswith("--")]
        key = (long or [parameter.name.replace("_", "-")])[0]
        default = ... if parameter.default is inspect.Parameter.empty else parameter.default
        settings[key] = Setting(
            key, parameter.name, _bare(kind), file_use(annotation), SHARED in metadata, default
        )
    return settings


def _bare(kind: Any) -> Any:
    """A type without None."""
    if get_origin(kind) not in (Union, UnionType):
        return kind
    return next(option for option in get_args(kind) if option is not type(None))


def _shown(value: Any) -> str:
    """A value as TOML has it, about."""
    return str(value).lower() if isinstance(value, bool) else repr(value)


class SettingsFile(NamedTuple):
    """A file with settings.

    Attributes:
        path: as from the working folder. content: its bytes.
        values: those at the top, by key. tables: those of commands, by name and key.
        prefix: of the tables' names in the file.
    """

    path: Path
    content: bytes
    values: Mapping[str, Any]
    tables: Mapping[str, Mapping[str, Any]]
    prefix: str = ""

    def line(self, key: str, table: str = "") -> int | None:
        """Line of a key, from 1, or that of its table; None where it is written otherwise."""
        wanted, current, begin = f"{self.prefix}{table}".strip("."), "", None
        for number, text in enumerate(self.content.decode("utf-8", "replace").splitlines(), 1):
            if head := re.match(r"\s*\[([^\[\]]+)\]", text):
                current = re.sub(r"[\s\"']", "", head[1])
                # The table's line for keys in forms that are not searched for, as inline tables.
                begin = number if current == wanted else begin
            elif current == wanted and re.match(rf"\s*[\"']?{re.escape(key)}[\"']?\s*[.=]", text):
                return number
        return begin

    def value(self, setting: Setting, table: str = "") -> Any:
        """Return the checked value of a setting that the file has; paths as from the working
        folder.

        Raises:
            InvalidFile: it is of another type.
        """
        given = (self.tables[table] if table else self.values)[setting.key]
        if not setting.is_list:
            return self._checked(setting.kind, given, setting, table)
        if not isinstance(given, list):
            raise self._wrong(setting, table, 'a list is expected, as ["…"]')
        (kind,) = get_args(setting.kind)
        return [self._checked(kind, item, setting, table) for item in given]

    def _checked(self, kind: Any, given: Any, setting: Setting, table: str) -> Any:
        if kind in _KINDS:
            # bool is a subclass of int: `true` is no number for that.
            accepted = (int, float) if kind is float else kind
            if not isinstance(given, accepted) or (kind is not bool and isinstance(given, bool)):
                raise self._wrong(
                    setting, table, f"{_KINDS[kind]} is expected, not {_shown(given)}"
                )
            return kind(given)
        if not isinstance(given, str):
            raise self._wrong(setting, table, f'a text is expected, as "…", not {_shown(given)}')
        choices = get_args(kind) if get_origin(kind) is Literal else (given,)
        if given not in choices:
            told = f"{given!r} is none of {', '.join(choices)}; {nearest(given, choices)}"
            raise self._wrong(setting, table, told)
        return self._from_working_folder(given, kind, setting)

    def _from_working_folder(self, text: str, kind: Any, setting: Setting) -> str:
        if setting.files is None:
            return text
        # A path is one whether or not it is there: an output folder is made by the run.
        if kind is Path or setting.is_list:
            return self._moved(text)
        if setting.files is FileUse.WITHIN:
            return re.sub(r"[^:,=]+", lambda part: self._moved_file(part[0]), text)
        return self._moved_file(text)

    def _moved_file(self, text: str) -> str:
        """A path where the text is that of a file; `auto` and names stay as they are."""
        # A name without either, as `cas`, is a system's even where a file is called so.
        is_path = "." in text or "/" in text
        return self._moved(text) if is_path and (self.path.parent / text).is_file() else text

    def _moved(self, text: str) -> str:
        # An absolute path stays as it is: joining drops what is before it.
        return str(self.path.parent / Path(text).expanduser())

    def _wrong(self, setting: Setting, table: str, message: str) -> InvalidFile:
        return self.fault(setting.key, table, message)

    def fault(self, key: str, table: str, message: str) -> InvalidFile:
        """Return an error at a key of the file."""
        return InvalidFile(message, path=self.path, line=self.line(key, table), element=key)

    def remark(self, settings: Mapping[str, Setting], table: str) -> str:
        """Return the keys that hold for a command, in one line."""
        names = [*self.own(settings), *self.tables.get(table, ())]
        return f"{self.path} sets {', '.join(dict.fromkeys(names))}" if names else ""

    def own(self, settings: Mapping[str, Setting]) -> list[str]:
        """Return the keys at the top that are options of a command."""
        return [key for key in self.values if key in settings and settings[key].shared]


def locate(folder: Path | None = None) -> Path | None:
    """Return the settings file that holds in a folder, by default the working folder; None where
    there is none."""
    start = Path(os.path.abspath(folder or os.curdir))
    for place in (start, *start.parents):
        # The nearest wins alone: settings of two projects are not mixed.
        if (place / FILE).is_file():
            return _relative(place / FILE)
        project = place / PROJECT
        if project.is_file() and _MARK in _bytes(project):
            return _relative(project)
    return None


def _relative(path: Path) -> Path:
    try:
        return Path(os.path.relpath(path))
    except ValueError:  # on another drive
        return path


def _bytes(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            # One byte beyond the limit shows that the file is larger.
            return file.read(_MAX_BYTES + 1)
    except OSError as error:
        raise InvalidFile(f"this can't be read: {error.strerror or error}", path=path) from None


def read(folder: Path | None = None) -> SettingsFile | None:
    """Read the settings file that holds in a folder; None where there is none.

    Raises:
        InvalidFile: it is no TOML, or names a table or a shared setting that no command has.
    """
    path = locate(folder)
    if path is None:
        return None
    import tomllib

    content = _bytes(path)
    if len(content) > _MAX_BYTES:
        raise InvalidFile(f"at most {_MAX_BYTES} bytes are read", path=path)
    try:
        # Editors of Windows begin files with a byte order mark.
        top: Any = tomllib.loads(content.decode("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        # tomllib (Python 3.11) gives the place in its message only.
        line = re.search(r"at line (\d+)", str(error))
        told = re.sub(r" \(at .*\)", "", str(error)).lower()
        where = int(line[1]) if line else None
        raise InvalidFile(f"this is no TOML: {told}", path=path, line=where) from None
    prefix = ""
    if path.name == PROJECT:
        tool = top.get("tool", {})
        if not isinstance(tool, dict) or "xosc" not in tool:
            return None
        top, prefix = tool["xosc"], "tool.xosc."
        if not isinstance(top, dict):
            raise InvalidFile("tool.xosc: a table [tool.xosc] is expected", path=path)
    tables = {key: value for key, value in top.items() if isinstance(value, dict)}
    values = {key: value for key, value in top.items() if key not in tables}
    made = SettingsFile(path, content, values, tables, prefix)
    _refuse_unknown(made)
    return made


def _refuse_unknown(file: SettingsFile) -> None:
    try:
        known = offered("project settings")
    except KeyError:
        return  # one package alone does not know the others
    shared, commands = known.shared_settings(), known.COMMANDS
    for name in file.tables:
        if name not in commands:
            names = (*commands, *shared)
            raise file.fault(name, name, f"there is no such command; {nearest(name, names)}")
    for key in file.values:
        if key not in shared:
            raise file.fault(key, "", known.unknown(key))


_in_use: SettingsFile | None = None


def in_use() -> SettingsFile | None:
    """Return the settings file that the command of this process took values from."""
    return _in_use


def use(file: SettingsFile | None) -> None:
    """Note that a command takes its values from a file, or from none."""
    global _in_use
    _in_use = file


def values_of(
    file: SettingsFile, settings: Mapping[str, Setting], table: str, others: Iterable[str] = ()
) -> dict[str, Any]:
    """Return the values that a file has for a command, by parameter.

    Args:
        settings: of the command.
        table: name of its table in the file.
        others: keys that belong to other commands with the same table.

    Raises:
        InvalidFile: its table has an unknown key, or a value is of another type.
    """
    own = file.tables.get(table, {})
    # Commands with one table have different options: a key of another one is no slip.
    for key in own:
        if key not in settings and key not in others:
            raise file.fault(key, table, f"{table} has no such option; {nearest(key, settings)}")
    values = {settings[key].parameter: file.value(settings[key]) for key in file.own(settings)}
    return values | {
        settings[key].parameter: file.value(settings[key], table) for key in own if key in settings
    }


def signature_settings(command: Callable[..., Any]) -> dict[str, Setting]:
    """Return the settings of a command's function."""
    return settings_of(inspect.signature(command, eval_str=True).parameters.values())
