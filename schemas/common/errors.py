"""The exceptions that a user of the toolchain sees, each one clear line.

Every package raises these (or a subclass): what went wrong, where (file and line), and what
would be right. The command lines print `str(error)` and turn the class into an exit code.
"""

from __future__ import annotations

import difflib
import errno
import sys
import traceback
from collections.abc import Iterable
from enum import IntEnum
from importlib.util import find_spec
from os import PathLike

from schemas.common.terminal.text import one_line

_MOST_COMPARED, _LONGEST_COMPARED = 300, 100
"""Names beyond this number, and characters beyond that, are not compared: that takes its time."""


class ExitCode(IntEnum):
    """Exit codes of all commands: the same cause has the same code in each of them.

    `FINDING` is the negative answer of a command that did its work: a failed verdict of `xosc-run`,
    a file that `xosc-check` does not accept, no edge case of `xosc-generate`.
    """

    PASSED = 0
    FINDING = 1
    USAGE = 2
    INVALID = 3
    UNSUPPORTED = 4
    INTERNAL = 5
    INCONCLUSIVE = 6


_GRAVEST_FIRST = (
    ExitCode.INTERNAL,
    ExitCode.INVALID,
    ExitCode.UNSUPPORTED,
    ExitCode.USAGE,
    ExitCode.FINDING,
    ExitCode.INCONCLUSIVE,
    ExitCode.PASSED,
)


def exit_codes(passed: str, finding: str, inconclusive: str = "") -> str:
    """The sentence on exit codes in the help of a command.

    Args:
        passed: meaning of code 0 in this command.
        finding: meaning of code 1; empty for a command that finds nothing wrong.
        inconclusive: meaning of code 6; empty for a command without runs.
    """
    codes = [
        f"0 {passed}",
        *([f"1 {finding}"] if finding else []),
        "2 wrong usage",
        "3 invalid or missing file",
    ]
    codes += [
        "4 unsupported",
        "5 internal error" + " or a system under test that fails" * bool(inconclusive),
    ]
    codes += [f"6 {inconclusive}"] if inconclusive else []
    return f"Exit codes: {', '.join(codes)}. With several, the gravest."


def gravest(codes: Iterable[int]) -> int:
    """The exit code of a command that did several things; 0 for none."""
    return min(
        codes, key=lambda code: _GRAVEST_FIRST.index(ExitCode(code)), default=ExitCode.PASSED
    )


class ToolchainError(Exception):
    """Base of every error that a user can fix.

    Args:
        message: one sentence, what is wrong and what would be right.
        path: the file concerned, where there is one.
        line: 1-based line in that file.
        element: name or path of the XML element concerned, as in the file.

    Example:
        >>> import xosc_toolchain as xt
        >>> try:
        ...     xt.load("missing.xosc")
        ... except xt.ToolchainError as error:
        ...     print(error, int(error.exit_code))
        missing.xosc: no such file 3
    """

    exit_code = ExitCode.INTERNAL

    def __init__(
        self,
        message: str,
        *,
        path: str | PathLike[str] | None = None,
        line: int | None = None,
        element: str | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.path = str(path) if path is not None else None
        self.line = line
        self.element = element

    def __reduce__(self) -> tuple[object, ...]:
        return (_rebuild, (type(self), self.message, self.path, self.line, self.element))

    def __str__(self) -> str:
        place = f"{self.path or ''}{f':{self.line}' if self.line else ''}"
        return ": ".join(
            part for part in (place, self.element, " ".join(self.message.split())) if part
        )


def _rebuild(
    kind: type[ToolchainError],
    message: str,
    path: str | None,
    line: int | None,
    element: str | None,
) -> ToolchainError:
    """Errors cross process borders in batches; keyword arguments need this to be restored."""
    return kind(message, path=path, line=line, element=element)


class UsageError(ToolchainError):
    """The call itself is wrong: an unknown option value, entity or parameter name.

    Example:
        >>> import xosc_toolchain as xt
        >>> try:
        ...     xt.run("xosc/library/cut_in_highway.xosc", parameters={"Gap_m": "5"})
        ... except xt.UsageError as error:
        ...     print(error.message.partition(";")[0], int(error.exit_code))
        there is no parameter 'Gap_m' to assign 2
    """

    exit_code = ExitCode.USAGE


class NotWritten(UsageError):
    """Output that can't be written, as on a full disk or without the right: no fault of the file
    that was worked on."""


class InvalidFile(ToolchainError):
    """A file that is missing, malformed, or breaks its standard.

    Example:
        >>> from pathlib import Path
        >>> import xosc_toolchain as xt
        >>> characters = Path("page.xosc").write_text("<html/>")
        >>> try:
        ...     xt.load("page.xosc")
        ... except xt.InvalidFile as error:
        ...     print(error, int(error.exit_code))
        page.xosc:1: the root element is <html>, OpenSCENARIO or OpenDRIVE is expected 3
    """

    exit_code = ExitCode.INVALID


class Unsupported(ToolchainError):
    """A valid file that asks for something this toolchain does not do, named exactly.

    Example:
        >>> import xosc_toolchain as xt
        >>> try:
        ...     xt.run("xosc/library/cut_in_highway.xosc", sut="sumo", world="kinematic")
        ... except xt.Unsupported as error:
        ...     print(error.message, int(error.exit_code))
        the kinematic world has no driver of its own for 'Ego'; run on SUMO 4
    """

    exit_code = ExitCode.UNSUPPORTED


def reason(error: Exception) -> str:
    """Return a foreign exception as one line: its first line, the missing key, or its type."""
    if isinstance(error, KeyError):
        return f"there is no {error}"
    # Libraries explain themselves over many lines: the first one names the fault.
    return next(iter(str(error).strip().splitlines()), type(error).__name__)


def blame(error: BaseException, module: str) -> str:
    """Return an exception of a plug-in as one line, with file and line of the plug-in's code that
    raised it.

    Args:
        module: name of the plug-in's module.
    """
    # The traceback ends in the import machinery; the error itself has the place.
    if isinstance(error, SyntaxError):
        return f"{type(error).__name__}: {error.msg} ({error.filename}:{error.lineno})"
    # The module has been imported: the class that `module:Class` names is not in it.
    if isinstance(error, AttributeError) and getattr(error.obj, "__name__", None) == module:
        own_classes = [
            name
            for name, value in vars(error.obj).items()
            if isinstance(value, type) and value.__module__ == module
        ]
        return f"it has no class {error.name!r}; {nearest(str(error.name), own_classes)}"
    file = _file_of(module)
    # The last frame of the plug-in's own: what it calls may fail far below.
    own = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    return f"{type(error).__name__}: {error}" + (
        f" ({own[-1].filename}:{own[-1].lineno})" if own else ""
    )


def _file_of(module: str) -> str | None:
    """File of a module, also after a failed import."""
    try:
        spec = sys.modules[module].__spec__ if module in sys.modules else find_spec(module)
    except (ImportError, ValueError):
        return None
    return spec.origin if spec else None


_plugins: dict[str, str] = {}
"""Names of loaded plug-ins for messages, by their modules"""


def note_plugin(module: str, name: str) -> None:
    """Have errors of a module's code told as those of a plug-in.

    Args:
        name: of the plug-in, for messages.
    """
    _plugins[module] = name


def _failed_plugin(error: BaseException) -> str:
    """Return the failure of the plug-in whose code is innermost on the stack of an exception, with
    file and line; empty where no plug-in's is."""
    for frame, _ in reversed(list(traceback.walk_tb(error.__traceback__))):
        module = frame.f_globals.get("__name__")
        if module in _plugins:
            return f"{_plugins[module]} failed: {blame(error, module)}"
    return ""


def describe(error: Exception) -> tuple[str, int]:
    """Error in one line, and its exit code.

    An unexpected error below the code of a plug-in is that of the plug-in, not of the toolchain.
    """
    if isinstance(error, ToolchainError):
        message, code = str(error), error.exit_code
    elif _lacks_memory(error):
        message, code = (
            "this takes more memory than there is, or than the process may have",
            Unsupported.exit_code,
        )
    # A folder that can't be written and the like: the call is at fault, not the toolchain.
    elif isinstance(error, OSError):
        message, code = (
            ": ".join(str(part) for part in (error.strerror or error, error.filename) if part),
            ExitCode.USAGE,
        )
    # After errors of the system, which a plug-in may only be the first to meet.
    elif failed := _failed_plugin(error):
        message, code = failed, ExitCode.USAGE
    else:
        message, code = f"internal error: {type(error).__name__}: {error}", ExitCode.INTERNAL
    return one_line(message), code


def _lacks_memory(error: Exception) -> bool:
    """Whether an error is a shortage of memory, also of the loader of libraries, which says so in
    its message only."""
    # libsumo and torch are mapped when they are imported: under `ulimit -v` that fails first.
    if isinstance(error, ImportError):
        return any(text in str(error) for text in ("failed to map segment", "cannot allocate"))
    if isinstance(error, RuntimeError) and "can't start new thread" in str(error):
        return True
    is_refused = isinstance(error, OSError) and error.errno == errno.ENOMEM
    return is_refused or isinstance(error, MemoryError)


def similar(name: str, names: Iterable[str]) -> str:
    """Return the question for the most similar of `names`; empty where none is."""
    other = most_similar(name, names)
    return f"did you mean {other!r}?" if other else ""


def most_similar(name: str, names: Iterable[str]) -> str:
    """Return the most similar of `names`; empty where none is."""
    names = [name for name in names if name]
    # Bounded: comparing takes time by the square of the lengths, and names come from files.
    close = difflib.get_close_matches(name[:_LONGEST_COMPARED], names[:_MOST_COMPARED], 1)
    return close[0] if close else ""


def guess(name: str, names: Iterable[str]) -> str:
    """Return the question for the most similar of `names`, with a blank after it; empty where none
    is."""
    question = similar(name, names)
    return question and f"{question} "


def like_or_nearest(text: str, names: Iterable[str]) -> str:
    """Return the hint for an unknown text: the names that it is a part of, else as `nearest`."""
    names = [name for name in names if name]
    # Part of a name first: `cut in` is nearer to "highway cut in" than by its letters.
    within = [name for name in names if text and text.casefold() in name.casefold()]
    return (
        f"did you mean {' or '.join(map(repr, within))}?"
        if 0 < len(within) < 5
        else nearest(text, names)
    )


_MOST_NAMES = 100
"""Names that a hint lists at most: more than an index has columns"""


def nearest(name: str, names: Iterable[str]) -> str:
    """Return the hint for an unknown name: the most similar of `names`, or all of them."""
    names = [name for name in names if name]
    return similar(name, names) or (
        f"there are: {', '.join(names[:_MOST_NAMES])}{', …' if len(names) > _MOST_NAMES else ''}"
        if names
        else "there are none"
    )
