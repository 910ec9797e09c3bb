"""Command-line options that are declared once, with the settings that they set: fields of a
dataclass.

    @dataclass(frozen=True)
    class Settings:
        timestep: float = option(0.05, "Time step.", metavar="SECONDS")

    @with_settings
    def command(path: Path, settings: Settings) -> None: ...

gives the command `--timestep SECONDS` in the place of `settings`, with the default of the field.
"""

from __future__ import annotations

import inspect
import math
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import Field, field, fields, is_dataclass
from enum import Enum
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, get_args, get_origin

from schemas.common.errors import UsageError

if TYPE_CHECKING:
    from typer.models import OptionInfo

ROAD_PATH = (
    "Folder with road networks that are not where the scenario says (repeatable; also "
    "XOSC_ROAD_PATH)."
)
CATALOG_PATH = (
    "Folder with catalogues that are not where the scenario says (repeatable; also "
    "XOSC_CATALOG_PATH)."
)
"""Helps of `--road-path` and `--catalog-path`"""
_OPTION, _PART = "option", "part"
_TYPES = {"int": int, "float": float, "bool": bool, "str": str, "Path": Path}
_LISTS: dict[str, tuple[type, Any]] = {
    "tuple[str, ...]": (tuple, list[str]),
    "Sequence[str]": (tuple, list[str]),
    "Sequence[Path]": (tuple, list[Path]),
    "Mapping[str, str]": (dict, list[str]),
}
"""Fields of options that can be repeated, with the types of field and given values; a mapping is
given as NAME=VALUE"""


class FileUse(Enum):
    """Use of the files and folders that an option names; part of its annotation, as in
    `Annotated[Path, WRITTEN, typer.Option()]`."""

    READ = "read"
    WRITTEN = "written"
    WITHIN = "within"
    """Parts of a text may be files, as those of a system under test."""


READ, WRITTEN = FileUse.READ, FileUse.WRITTEN


class SettingScope(Enum):
    """Scope of an option in settings files; part of its annotation, as `FileUse`."""

    SHARED = "shared"
    """One value for all commands that have it (see `schemas.common.terminal.settings_file`)."""


SHARED = SettingScope.SHARED


def writable_folder(path: Path | None) -> Path | None:
    """Callback of options that name an output folder, which need not exist.

    Raises:
        UsageError: a file is in the way.
    """
    there = (
        next((place for place in (path, *path.parents) if os.path.exists(place)), None)
        if path
        else None
    )
    if there and not there.is_dir():
        raise UsageError("a folder to write into is expected, this is a file", path=there)
    return path


def file_use(annotation: Any) -> FileUse | None:
    """Return the use that a parameter's annotation declares; None where it names no files.

    A path is read unless it is declared `WRITTEN` or is an output folder (`writable_folder`); text
    names files where it is declared `READ`.
    """
    kind, *metadata = get_args(annotation) if get_origin(annotation) is Annotated else (annotation,)
    declared = next((note for note in metadata if isinstance(note, FileUse)), None)
    if any(getattr(note, "callback", None) is writable_folder for note in metadata):
        return WRITTEN
    return declared or (READ if _is_path(kind) else None)


def _is_path(kind: Any) -> bool:
    """Whether a type is that of a path, of several, or of none or some."""
    return kind is Path or any(map(_is_path, get_args(kind)))


def completed(names: Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """Completion of an option's value in shells, for `autocompletion`: the names that begin as
    typed."""

    def complete(incomplete: str) -> list[str]:
        return [name for name in names() if name.startswith(incomplete)]

    return complete


Section = Callable[[], tuple[str, list[tuple[str, str]]]]
"""Gives a heading, and names with a line each; called when help is printed."""
sections: dict[str, Section] = {}
"""Sections that follow the options in the help of every command that has an option, by the name of
its parameter"""


def explain(option: str, section: Section) -> None:
    """Add a section to the help of every command that has an option, given by the name of its
    parameter."""
    # By the parameter's name: several commands share an option, and its section stands in each.
    sections[option] = section


class Declared(NamedTuple):
    """Declaration of an option.

    Attributes:
        help: its text. names: on the command line, `--` and the name of the field where there are
            none.
        parameter: name of the command's parameter, that of the field where it is None.
        type: of the value given, that of the field where it is None.
        section: what help says below the options: a heading, and names with a line each.
        files: use of the files that it names; a path is read where it is None.
        shared: whether a settings file has one value of it for all commands.
        how: what `typer.Option` takes besides.
    """

    help: str
    names: tuple[str, ...]
    parameter: str | None
    type: Any
    section: Section | None
    files: FileUse | None
    shared: bool
    how: Mapping[str, Any]


def option(
    default: Any,
    help: str,
    *names: str,
    parameter: str | None = None,
    type: Any = None,
    section: Section | None = None,
    files: FileUse | None = None,
    shared: bool = False,
    **how: Any,
) -> Any:
    """A field of a settings dataclass that commands offer as an option;
    arguments as of `Declared`.
    """
    metadata = {_OPTION: Declared(help, names, parameter, type, section, files, shared, how)}
    # dataclasses refuse a dict as default: all objects would share it.
    return (
        field(default_factory=dict, metadata=metadata)
        if default == {}
        else field(default=default, metadata=metadata)
    )


def part(settings: type, *offered: str) -> Any:
    """A field that is a settings dataclass itself; commands offer its named options, or all."""
    return field(default_factory=settings, metadata={_PART: (settings, offered)})


def option_of(settings: type, name: str) -> OptionInfo:
    """The option of one field, for commands that take no others of the settings."""
    return _info(next(field for field in fields(settings) if field.name == name))


def options_of(settings: type) -> list[inspect.Parameter]:
    """Return the options of a settings dataclass as parameters of a command."""
    return list(_parameters(settings, ()))


def with_settings(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of its settings: those of the fields of each parameter whose
    annotation is a dataclass."""
    own = inspect.signature(command, eval_str=True).parameters.values()
    settings = {
        parameter.name: parameter.annotation
        for parameter in own
        if is_dataclass(parameter.annotation)
    }

    @wraps(command)
    def with_options(**given: Any) -> None:
        # `_build` takes its values out of `given`; what is left are the command's own options.
        made = {name: _build(of, (), given) for name, of in settings.items()}
        command(**made, **given)

    resign(
        with_options,
        [
            new
            for parameter in own
            for new in (
                _parameters(settings[parameter.name], ())
                if parameter.name in settings
                else [parameter]
            )
        ],
    )
    return with_options


def resign(function: Callable[..., None], parameters: list[inspect.Parameter]) -> None:
    """Give a function a signature of these parameters, all by keyword, as typer reads it."""
    parameters = [
        parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in parameters
    ]
    function.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    function.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}


class PlainValues:
    """Values of one option that need no library to be read, for typer's parameters.

    Typer builds a validator of pydantic for each option, given or not: a third of a command's
    start. Names, paths, decimal numbers and defaults are read here; all else, every
    error included, is left to typer.

    Args:
        parameter: an option or argument of typer.
    """

    def __init__(self, parameter: Any) -> None:
        self._parameter = parameter

    @staticmethod
    def read(parameters: Iterable[Any]) -> None:
        """Let parameters read their plain values; others than those of this
        typer are left alone.
        """
        for parameter in parameters:
            # An inner name of typer: where a later version lacks it, its own reading stays.
            if getattr(parameter, "_runtime_param", parameter) is None:
                parameter._runtime_param = PlainValues(parameter)

    def coerce(self, value: Any, param: Any, ctx: Any) -> Any:
        """Return the value as the option's type; same as typer's method of this name."""
        described, several = param.type_descriptor, param.multiple or param.nargs == -1
        if value is None:
            return () if several else None
        kind, info = described.annotation, described.parameter_info
        if several and isinstance(value, list | tuple) and get_origin(kind) is list:
            read = [_plain(item, get_args(kind)[0], info) for item in value]
        else:
            read = [_plain(value, kind, info)]
        # One value that is not plain hands all over: errors then have typer's words and places.
        if None in read:
            self._parameter._runtime_param = None
            return self._parameter.get_runtime_param().coerce(value, param=param, ctx=ctx)
        return read if several else read[0]


_DECIMAL = re.compile(r"-?[0-9]{1,15}(\.[0-9]{1,15})?")


def _plain(value: Any, kind: Any, info: Any) -> Any:
    """Return a value as a type; None where that is not as plain as all that."""
    if info.parser is not None or info.resolve_path or info.allow_dash or info.path_type:
        return None
    if kind is str and isinstance(value, str):
        return value
    if get_origin(kind) is Literal and isinstance(value, str):
        return value if value in get_args(kind) else None
    if kind is Path and isinstance(value, str) and _is_usual(value, info):
        return Path(value)
    if kind not in (int, float):
        return None
    if isinstance(value, str) and _DECIMAL.fullmatch(value) and (kind is float or "." not in value):
        value = kind(value)
    # The default too: it comes here as it is declared, and of another type where a class forgot it.
    inside = (
        type(value) is kind
        and math.isfinite(value)
        and (info.min is None or value >= info.min)
        and (info.max is None or value <= info.max)
    )
    return value if inside else None


def _is_usual(path: str, info: Any) -> bool:
    """Whether typer takes a path as it is: it can be read, or is not there and need not be."""
    if not os.path.exists(path):
        return not info.exists
    return info.file_okay and info.dir_okay and not info.writable and os.access(path, os.R_OK)


def parameters_of(pairs: Iterable[str], option: str = "--param") -> dict[str, str]:
    """Values of parameters by name, from the texts of an option.

    Raises:
        UsageError: one is not of the form NAME=VALUE, or two name one parameter.
    """
    values: dict[str, str] = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not (name and equals):
            raise UsageError(f"{option} {pair!r}: NAME=VALUE is expected")
        # The same twice is no contradiction: scripts add options to those of others.
        if values.get(name, value) != value:
            raise UsageError(
                f"{option} {name}: {values[name]!r} and {value!r} are given; one value is expected"
            )
        values[name] = value
    return values


def _fields(settings: Any, offered: tuple[str, ...]) -> Iterator[Field[Any]]:
    for setting in fields(settings):
        if not offered or setting.name in offered:
            yield setting


def _parameters(settings: Any, offered: tuple[str, ...]) -> Iterator[inspect.Parameter]:
    for setting in _fields(settings, offered):
        if _PART in setting.metadata:
            yield from _parameters(*setting.metadata[_PART])
        elif _OPTION in setting.metadata:
            # The type as text: `from __future__ import annotations` leaves fields without evaluated
            # types.
            declared, text = setting.metadata[_OPTION], str(setting.type)
            repeated = text in _LISTS
            kind: Any = declared.type or (
                _LISTS[text][1] if repeated else _TYPES[text.removesuffix(" | None")]
            )
            if repeated or (text.endswith(" | None") and declared.type is None):
                # typer takes an option without a default as required, unless its type allows None.
                kind |= None
            # A list as default would be shown in help as brackets.
            default = None if repeated else setting.default
            yield inspect.Parameter(
                _name(setting),
                inspect.Parameter.KEYWORD_ONLY,
                default=default,
                annotation=Annotated[
                    kind, declared.files, SHARED if declared.shared else None, _info(setting)
                ],
            )


def _build(settings: Any, offered: tuple[str, ...], given: dict[str, Any]) -> Any:
    """Settings of the values of options, which are taken out of those given."""
    values = {}
    for setting in _fields(settings, offered):
        if _PART in setting.metadata:
            kind, only = setting.metadata[_PART]
            values[setting.name] = _build(kind, only, given)
        elif _OPTION in setting.metadata:
            value = given.pop(_name(setting))
            values[setting.name] = (
                _repeated(setting, value or []) if str(setting.type) in _LISTS else value
            )
    return settings(**values)


def _repeated(setting: Field[Any], texts: list[Any]) -> Any:
    return (
        parameters_of(texts, setting.metadata[_OPTION].names[0])
        if _LISTS[str(setting.type)][0] is dict
        else tuple(texts)
    )


def _name(setting: Field[Any]) -> str:
    name: str = setting.metadata[_OPTION].parameter or setting.name
    return name


def _info(setting: Field[Any]) -> OptionInfo:
    import typer

    declared: Declared = setting.metadata[_OPTION]
    if declared.section is not None:
        explain(_name(setting), declared.section)
    info: OptionInfo = typer.Option(*declared.names, help=declared.help, **declared.how)
    return info
