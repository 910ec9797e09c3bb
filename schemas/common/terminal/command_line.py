"""Base of all commands: app, common options, errors as one line and an exit code, interruptions,
progress bars."""

from __future__ import annotations

import inspect
import io
import os
import signal
import sys
import textwrap
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from copy import copy
from dataclasses import replace
from functools import wraps
from glob import has_magic
from pathlib import Path
from typing import Annotated, Any, Protocol, TextIO

import typer
from typer.core import TyperCommand, TyperGroup
from typer.models import OptionInfo

from schemas.common.errors import ExitCode, ToolchainError, UsageError, describe
from schemas.common.packages import compiled, leave_working_folder_out, missing, version
from schemas.common.policy import (
    UNTRUSTED,
    CommandPolicy,
    Ended,
    end_by,
    in_force,
    of_command,
    poll,
)
from schemas.common.storage import cache_folder, drafted, own_cache, search_path, writing
from schemas.common.terminal.options import (
    CATALOG_PATH,
    READ,
    ROAD_PATH,
    SHARED,
    WRITTEN,
    PlainValues,
    file_use,
    resign,
    sections,
    writable_folder,
)
from schemas.common.terminal.settings_file import (
    Setting,
    SettingsFile,
    locate,
    signature_settings,
    use,
    values_of,
)
from schemas.common.terminal.settings_file import read as read_settings
from schemas.common.terminal.text import of_service, one_line

GROUPS: dict[str, tuple[str, ...]] = {
    "Runs": (
        "sut", "ego", "timestep", "seed", "max_time", "world", "end_after_collision", "fail_if",
        "allow_inconclusive", "dry_run",
    ),
    "Parameters": ("param", "only", "sample", "repeat", "enforce_constraints", "free", "pin",
        "density", "recorded", "kind"),
    "Files and roads": ("strict", "road", "road_path", "catalog_path"),
    "Output": (
        "out", "overwrite", "output", "format", "osi", "plot", "replay", "against", "assess", "gui",
        "junit", "junit_inconclusive", "verbose", "quiet", "help",
    ),
    "Processes and limits": ("jobs", "ray", "resume", "untrusted", "max_memory", "max_seconds",
        "max_runs"),
}  # fmt: skip
"""Headings of options by the names of their parameters; all other options stand under `Options`,
before them."""
SELDOM = frozenset({
    "sut_timeout", "sut_in_process", "least", "in_arrays", "timestep", "ego", "max_time", "world",
    "end_after_collision", "allow_inconclusive", "enforce_constraints", "only", "repeat", "strict",
    "road", "catalog_path", "osi", "plot", "gui", "junit_inconclusive", "assess", "ray",
    "maxfail", "draw",
    "road_path", "max_memory", "max_seconds", "max_runs", "weight", "rss", "apart", "violations",
    "concrete", "minutes", "every", "map", "density", "kind", "recorded", "labels", "model",
    "shown", "domain", "judge", "most", "plays", "verbose", "_verbose", "_version", "overwrite",
    "method", "maps", "encoders", "pretrain_on", "reviewed", "verdicts", "develop",
    "forest_samples", "samples", "by_changes", "per_recording",
})  # fmt: skip
"""Parameters of options that `--help` names in one line, and `--help-all` explains."""
HELP, HELP_ALL = ("-h", "--help"), "--help-all"


def epilog(codes: str, *examples: str) -> str:
    """The end of a command's help: examples, one command line each, and its exit codes."""
    return "\n".join(["\b", "Examples:", *(f"  {example}" for example in examples), "", codes])


class _HelpInFull:
    """Adds `--help-all` to a command or group of commands."""

    def get_help_option_names(self, ctx: Any) -> list[str]:
        """Names in the order of the context, which typer's set of them has not."""
        return list(ctx.help_option_names)

    def get_help_option(self, ctx: Any) -> Any:
        """The option of help, which says how to get the rest."""
        option = super().get_help_option(ctx)  # type: ignore[misc]
        option.help = "Show this help; all of it by --help-all."
        PlainValues.read([option])
        return option

    def get_short_help_str(self, limit: int = 0) -> str:
        """The first sentence in full: click cuts it to one line, often before its verb's object."""
        return str(super().get_short_help_str(sys.maxsize))  # type: ignore[misc]


class CommandGroup(_HelpInFull, TyperGroup):
    """A group of commands."""


class GroupedCommand(_HelpInFull, TyperCommand):
    """A command whose help has options under headings, and whose defaults are those of the settings
    file."""

    def make_context(
        self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any
    ) -> Any:
        """Read the settings file too, but for help, versions, completions and strangers' files."""
        PlainValues.read(self.params)
        # These must work beside a settings file that is broken, too.
        no_work = extra.get("resilient_parsing") or {*HELP, HELP_ALL, "--version"} & set(args)
        file = None if no_work else self._file("--untrusted" in args)
        use(file)
        if file is None:
            return super().make_context(info_name, args, parent, **extra)
        settings, (table, others), typed = self.settings(), self._table(parent), list(args)
        values = values_of(file, settings, table, others)
        try:
            context = super().make_context(info_name, args, parent, default_map=values, **extra)
        except typer.BadParameter as error:
            key, names = _setting_of(error.param, settings)
            # The value is one that was typed: the fault is not the file's.
            if key is None or any(word.split("=")[0] in names for word in typed):
                raise
            raise file.fault(
                key, table if key in file.tables.get(table, ()) else "", error.message
            ) from None
        told = file.remark(settings, table)
        if told and not {"--quiet", "-q"} & set(typed):  # a limit that nobody typed is no surprise
            say(f"{command_name()}: remark: {told}", to=sys.stderr)
        return context

    def _file(self, untrusted: bool) -> SettingsFile | None:
        """The settings file, if the command works on files and is to read it."""
        if all(param.name != "untrusted" for param in self.params):
            return None
        if not untrusted:
            return read_settings()
        if (path := locate()) is not None:
            told = "settings are not read under --untrusted"
            say(f"{command_name()}: remark: {path}: {told}", to=sys.stderr)
        return None

    def settings(self) -> dict[str, Setting]:
        """Settings that a file may have for the command, by key."""
        return signature_settings(self.callback) if self.callback is not None else {}

    def _table(self, parent: Any) -> tuple[str, set[str]]:
        """Name of the command's table, and the keys of other commands with the same one."""
        if parent is None:
            return str(getattr(self.callback, "__name__", "")).removeprefix("xosc_"), set()
        group = parent.command
        others = (
            command for command in group.commands.values() if isinstance(command, GroupedCommand)
        )
        return group.name.removeprefix("xosc-"), {
            key for command in others for key in command.settings()
        }

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Keep in the context whether help is asked for in full."""
        ctx.meta[HELP_ALL] = HELP_ALL in args
        return super().parse_args(ctx, args)

    def format_help_text(self, ctx: Any, formatter: Any) -> None:
        """The first paragraph of the description; all of it by `--help-all`."""
        shown = copy(self)
        if not ctx.meta.get(HELP_ALL):
            shown.help = inspect.cleandoc(self.help or "").partition("\n\n")[0]
        TyperCommand.format_help_text(shown, ctx, formatter)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments, options without a group, groups and sections; seldom ones in short."""
        heading = {name: title for title, names in GROUPS.items() for name in names}
        shown: dict[str, list[tuple[str, str]]] = {
            title: [] for title in ("Arguments", "Options", *GROUPS)
        }
        full, names, further = ctx.meta.get(HELP_ALL), [], []
        for param in self.get_params(ctx):
            record, name = param.get_help_record(ctx), param.name or ""
            if record is None:
                continue
            if name in SELDOM and not full:
                further.append(param.opts[0])
                continue
            names.append(name)
            if param.param_type_name == "argument":
                shown["Arguments"].append(record)
            else:
                shown[heading.get(name, "Options")].append(record)
        for title, records in shown.items():
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)
        for title, records in (sections[name]() for name in names if name in sections):
            with formatter.section(title):
                if full:
                    formatter.write_dl(records)
                else:
                    _write_names(formatter, [name for name, _ in records])
        if further:
            with formatter.section(f"Explained by {HELP_ALL}"):
                _write_names(formatter, further)


def _write_names(formatter: Any, names: Sequence[str]) -> None:
    """Write names as one paragraph, none of them broken at a hyphen."""
    text = textwrap.wrap(
        ", ".join(names), formatter.width - formatter.current_indent, break_on_hyphens=False
    )
    for line in text:
        formatter.write(" " * formatter.current_indent + line + "\n")


def _setting_of(param: Any, settings: Mapping[str, Setting]) -> tuple[str | None, Sequence[str]]:
    """Key of the setting of a parameter, None where it has none, and the names of its option."""
    name = getattr(param, "name", None)
    keys = (key for key, setting in settings.items() if setting.parameter == name)
    return next(keys, None), getattr(param, "opts", ())


def command_name() -> str:
    """Name of the command that this process was started as."""
    return Path(sys.argv[0]).stem


class App(typer.Typer):
    """A typer app whose commands are grouped ones."""

    def command(self, name: str | None = None, **options: Any) -> Any:
        """Same as `typer.Typer.command`."""
        options.setdefault("cls", GroupedCommand)
        return super().command(name, **options)


# options and their policy ----------------------------------------------------------------------

Bar = Callable[[str, int], AbstractContextManager[Callable[[float], None]]]
"""Shows progress: takes a description and the number of steps, gives a function to call with how
many more of them are done."""
PIPE_CLOSED = 141
"""Exit code that shells give to what SIGPIPE has ended"""
_ENDING = ("SIGINT", "SIGTERM", "SIGHUP")
"""Signals that end a command in good order"""
_SIGNALLED = 128
_STANDARD_ERROR = 2
_DIGITS = 6


_LIMITS: dict[str, Any] = {
    "untrusted": Annotated[
        bool,
        typer.Option(
            "--untrusted",
            help="Files come from anyone: read nothing but what is named here, load no plug-in, "
            "keep to limits "
            f"({UNTRUSTED.max_memory:g} GiB, {UNTRUSTED.max_seconds:g} s, "
            f"{UNTRUSTED.max_runs:,} runs).",
        ),
    ],
    "max_memory": Annotated[
        float | None,
        SHARED,
        typer.Option(
            min=0.1,
            metavar="GIB",
            help="Memory that each process may take; what needs more is an error.",
        ),
    ],
    "max_seconds": Annotated[
        float | None,
        SHARED,
        typer.Option(
            min=0.1,
            metavar="S",
            help="Time that each file or run may take; what needs more is an error.",
        ),
    ],
    "max_runs": Annotated[
        int | None,
        SHARED,
        typer.Option(
            min=1, metavar="N", help="Runs, or parameter sets, that one file may stand for."
        ),
    ],
}


def limits_parameters(*left_out: str) -> list[inspect.Parameter]:
    """Return --untrusted and the limits, but for those left out, as parameters of a command."""
    return [
        inspect.Parameter(
            name, inspect.Parameter.KEYWORD_ONLY, default=_NOT_GIVEN[name], annotation=option
        )
        for name, option in _LIMITS.items()
        if name not in left_out
    ]


def protected(*left_out: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command --untrusted and the limits, and let it work under the policy that they and its
    arguments state.

    Args:
        left_out: names of limits that make no difference to the command.
    """
    options = {name: option for name, option in _LIMITS.items() if name not in left_out}

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own_parameters = inspect.signature(command, eval_str=True).parameters
        uses = {name: file_use(parameter.annotation) for name, parameter in own_parameters.items()}

        @wraps(command)
        def with_policy(**given: Any) -> None:
            limits = _limits({name: given.pop(name) for name in options})
            inputs, outputs = (
                _named(given[name] for name, use in uses.items() if use is wanted)
                for wanted in (READ, WRITTEN)
            )
            # The user names folders by environment variables as by options.
            asked_for = [folder for variable in _FOLDERS for folder in search_path((), variable)]
            if not given.get("overwrite"):
                _refuse_overlap(inputs, outputs)
            with own_cache() as remark:
                own = [*_PACKAGES, Path(sys.prefix), *_installed(), cache_folder(), *asked_for]
                if remark:
                    say(f"{command_name()}: remark: {remark}", to=sys.stderr)
                with in_force(of_command(inputs, outputs, own, limits)):
                    command(**given)

        resign(with_policy, [*own_parameters.values(), *limits_parameters(*left_out)])
        return with_policy

    return decorate


def _refuse_overlap(inputs: Iterable[str | Path], outputs: Iterable[str | Path]) -> None:
    """Refuse a file to be written that is read, too, or that two options name.

    Raises:
        UsageError: there is one.
    """
    taken = {os.path.realpath(path) for path in inputs if os.path.isfile(path)}
    for path in outputs:
        real = os.path.realpath(path)
        if real in taken:
            raise UsageError(
                "this file is read, or written by another option: name another", path=path
            )
        # Several outputs may share a folder, no two a file.
        if not os.path.isdir(path):
            taken.add(real)


_NOT_GIVEN = {"untrusted": False, "max_memory": None, "max_seconds": None, "max_runs": None}
_FOLDERS = ("XOSC_ROAD_PATH", "XOSC_CATALOG_PATH", "XOSC_SCHEMA_DIR")
_PACKAGES = [
    Path(__file__).parents[3] / name
    for name in ("schemas", "xosc", "xodr", "runner", "recognition", "generation")
]
"""The toolchain's own files: libraries of scenarios and roads, models"""


def _installed() -> list[Path]:
    """Folders of installed packages, which may be outside of the environment: those of the user, or
    of the system."""
    return [
        folder
        for folder in map(Path, sys.path)
        if folder.name in ("site-packages", "dist-packages")
    ]


def _limits(given: dict[str, Any]) -> CommandPolicy:
    """Return the limits that the options give, over those of the policy for untrusted files or of
    none."""
    base = UNTRUSTED if given.pop("untrusted") else CommandPolicy()
    return replace(base, **{name: value for name, value in given.items() if value is not None})


def _named(values: Iterable[Any]) -> list[str | Path]:
    """The files and folders that arguments name; of globs the folders that they begin with."""
    return [
        _without_glob(path)
        for value in values
        if value is not None
        for path in (value if isinstance(value, list) else [value])
    ]


def _without_glob(name: str | Path) -> str | Path:
    parts = Path(name).parts
    magic = next((number for number, part in enumerate(parts) if has_magic(part)), None)
    return name if magic is None or os.path.exists(name) else Path(*parts[:magic], "")


def new_app(name: str | None = None, group: type[TyperGroup] = CommandGroup) -> typer.Typer:
    """An app that leaves errors to its caller, and prints plain text; with a name and a group where
    it has subcommands."""
    return App(
        name=name,
        cls=group,
        add_completion=False,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        no_args_is_help=False,
        context_settings={"help_option_names": [*HELP, HELP_ALL]},
    )


def _print_version(context: typer.Context, requested: bool) -> None:
    if requested:
        names = [level.command.name for level in (context.parent, context) if level is not None]
        print(f"{' '.join(filter(None, names))} {version()}{' (compiled)' if compiled() else ''}")
        raise typer.Exit


RoadPath = Annotated[
    list[str] | None, READ, SHARED, typer.Option("--road-path", metavar="DIR", help=ROAD_PATH)
]
CatalogPath = Annotated[
    list[str] | None, READ, SHARED, typer.Option("--catalog-path", metavar="DIR", help=CATALOG_PATH)
]
AllowInconclusive = Annotated[
    bool,
    SHARED,
    typer.Option(
        "--allow-inconclusive",
        help="Exit as if runs that did not test what their file describes had passed.",
    ),
]
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="Replace what an earlier call has written to --out.")
]
Version = Annotated[
    bool,
    typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version."),
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Print tracebacks of errors.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")]
Jobs = Annotated[
    int, SHARED, typer.Option("--jobs", "-j", min=1, metavar="N", help="Number of processes.")
]


def out_folder(help: str) -> OptionInfo:
    """An option that names a folder to write into."""
    return typer.Option(metavar="DIR", callback=writable_folder, help=help)


def _begin() -> None:
    """Prepare the process; called first in every command."""
    _open_closed_output()
    leave_working_folder_out()
    _listen()
    print_anything()


def _listen() -> None:
    """Make the first signal an interrupt; a second one ends the process at once. Ignored signals
    (nohup) stay ignored.

    Helper threads, and what libraries ignore, say nothing from then on.
    """
    numbers = [getattr(signal, name) for name in _ENDING if hasattr(signal, name)]

    def end(number: int, _frame: object) -> None:
        for ending in numbers:
            signal.signal(ending, signal.SIG_DFL)
        end_by(number)
        threading.excepthook = sys.unraisablehook = _say_nothing
        raise Ended(number)

    end_by(0)
    for number in numbers:
        if (
            threading.current_thread() is threading.main_thread()
            and signal.getsignal(number) != signal.SIG_IGN
        ):
            signal.signal(number, end)


def _say_nothing(_: object) -> None:
    pass


def print_anything() -> None:
    """Escape characters that the terminal's encoding lacks: names of files may be of any bytes."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def guarded(
    name: str, app: Callable[[], object], extra: str | None = None, traced: bool = True
) -> None:
    """Run a command's app: errors become one line and an exit code, after a traceback with -v or
    for an unexpected error.

    A closed pipe gives `PIPE_CLOSED`, output that can't be written (a full disk) is an error as any
    other.

    Args:
        extra: the extra of the package that brings all that the command needs.
        traced: -v adds the traceback of an error; elsewhere it asks for longer output.
    """
    _begin()
    if any(
        variable.startswith("_XOSC") and variable.endswith("_COMPLETE") for variable in os.environ
    ):
        from typer.completion import completion_init  # type: ignore[attr-defined]

        completion_init()  # a shell asks for words that complete a line
    try:
        try:
            app()
        except Exception:
            poll()  # libraries make errors of their own of an interrupt
            raise
        finally:
            sys.stdout.flush()  # else what can't be written would be a message of the interpreter
    except SystemExit as ending:
        # Typer makes 1 of a closed pipe, and 130 of every interruption: the cause decides.
        code = PIPE_CLOSED if isinstance(ending.__context__, BrokenPipeError) else ending.code
        cause = getattr(ending.__context__, "__cause__", None)
        code = _interrupted(name, cause) if isinstance(cause, KeyboardInterrupt) else code
    except KeyboardInterrupt as ending:
        code = _interrupted(name, ending)
    except BrokenPipeError:
        code = PIPE_CLOSED
    except Exception as raised:
        error = missing(raised, extra) or raised
        message, code = describe(error)
        expected = code != ExitCode.INTERNAL or isinstance(error, ToolchainError)
        with suppress(OSError):
            if not expected or (traced and ("-v" in sys.argv or "--verbose" in sys.argv)):
                say(*traceback.format_exc().splitlines(), to=sys.stderr)
            print(f"{name}: {message}", file=sys.stderr)
    _settle_output()
    raise SystemExit(code)


def _open_closed_output() -> None:
    """Give a process that was started with closed streams ones that lead nowhere, before a file
    takes their numbers."""
    while (file := os.open(os.devnull, os.O_RDWR)) <= _STANDARD_ERROR:
        os.set_inheritable(file, True)
    os.close(file)
    for stream in ("stdout", "stderr"):
        if getattr(sys, stream) is None:
            setattr(sys, stream, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115


def _settle_output() -> None:
    """Discard output that could not be written: else the interpreter tries again when it ends, and
    reports an error."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)


def say(*lines: str, to: TextIO | None = None) -> None:
    """Print lines that may hold names and messages from files, each escaped as one line; to
    standard output by default."""
    for line in lines:
        print(one_line(line), file=to or sys.stdout, flush=True)


def deliver(content: str, what: str, output: Path | None) -> None:
    """Write a text to a file and make its folder; print it without a file.

    Raises:
        UsageError: it can't be written; the message says what.
    """
    if output is None:
        print(of_service(content), end="")
        return
    with writing(what, output), drafted(output) as draft:
        draft.write_bytes(content.encode("utf-8", "backslashreplace"))


@contextmanager
def interruptible(name: str, hint: str = "") -> Iterator[None]:
    """End the command in good order when it is interrupted, with a hint how to continue."""
    try:
        yield
    except KeyboardInterrupt as ending:
        raise typer.Exit(_interrupted(name, ending, hint)) from None


def _interrupted(name: str, ending: KeyboardInterrupt, hint: str = "") -> int:
    """Say that the command was interrupted; its exit code."""
    with suppress(OSError):
        print(f"\n{name}: interrupted{hint and f'; {hint}'}", file=sys.stderr)
    return _SIGNALLED + (ending.number if isinstance(ending, Ended) else signal.SIGINT)


class ProgressBar(Protocol):
    """A bar of finished items."""

    def __call__(self, count: float) -> None:
        """Advance it by finished items, or shares of one."""

    def below(self, doing: str, total: int) -> ProgressBar:
        """Show another bar below, of items that are many a second; with their rate."""

    def phase(self, name: str) -> None:
        """Show what is being done."""


class _NoBar:
    def __call__(self, count: float) -> None:
        return

    def phase(self, name: str) -> None:
        return

    def below(self, doing: str, total: int) -> _NoBar:
        return self


_PATIENCE = 60.0
"""Seconds between two lines about work in a log; a reader of it would take longer silence for a
hang"""


class _LogLines:
    """A line on standard error, which is no terminal, once a minute. A context manager."""

    def __init__(self, doing: str, total: int) -> None:
        self._doing, self._total, self._done, self._phase = doing, total, 0.0, ""
        self._begun, self._over = time.monotonic(), threading.Event()
        self._lower: _LogLines | None = None

    def __enter__(self) -> _LogLines:
        # A thread, as one item, or what precedes the first one, may take minutes.
        threading.Thread(target=self._lines, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()

    def __call__(self, count: float) -> None:
        self._done += count

    def below(self, doing: str, total: int) -> _LogLines:
        self._lower = _LogLines(doing, total)
        return self._lower

    def phase(self, name: str) -> None:
        self._phase, self._lower = name, None

    def _lines(self) -> None:
        while not self._over.wait(min(_PATIENCE, threading.TIMEOUT_MAX)):
            with suppress(OSError, ValueError):  # the stream may be closed
                say(self._line(), to=sys.stderr)

    def _line(self) -> str:
        taken = time.monotonic() - self._begun
        if self._lower is not None:
            return self._lower._line()
        phase = self._phase and f", {self._phase}"
        return f"{self._doing}: {self._done:,.0f} of {self._total:,} after {taken:,.0f} s{phase}"


class _Bar:
    """A task of a `rich.progress.Progress`."""

    def __init__(self, tasks: Any, doing: str, total: int, **shown: Any) -> None:
        self._tasks, self._done, self._doing = tasks, 0.0, doing
        self._task = tasks.add_task(doing, total=total, **shown)

    def __call__(self, count: float) -> None:
        self._done += count
        # Shares of an item add up to it.
        self._tasks.update(self._task, completed=round(self._done, _DIGITS))

    def below(self, doing: str, total: int) -> _Bar:
        return _Bar(self._tasks, doing, total, rated=True)

    def phase(self, name: str) -> None:
        self._tasks.update(self._task, description=f"{self._doing}, {name}")


@contextmanager
def progress_bar(doing: str, total: int, quiet: bool) -> Iterator[ProgressBar]:
    """Progress bar on standard error, or a line a minute where that is no terminal; yields the
    function that advances it.

    It shows the elapsed time, which advances during long items too, and the remaining time.
    """
    if quiet:
        yield _NoBar()
        return
    if not sys.stderr.isatty():
        with _LogLines(doing, total) as lines:
            yield lines
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class Rate(ProgressColumn):
        """Items a second, where a bar shows them."""

        def render(self, task: Task) -> Text:
            speed = task.finished_speed or task.speed
            return Text(f"{speed:,.0f} a second" if speed and task.fields.get("rated") else "")

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        Rate(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as tasks:
        yield _Bar(tasks, doing, total)
