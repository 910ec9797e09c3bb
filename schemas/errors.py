"""The exceptions that a user of the toolchain sees, each one clear line.

Every package raises these (or a subclass): what went wrong, where (file and line), and what
would be right. The command lines print `str(error)` and turn the class into an exit code.
"""

from __future__ import annotations

import difflib
import sys
import traceback
from collections.abc import Iterable
from importlib.util import find_spec
from os import PathLike

_MOST_COMPARED, _LONGEST_COMPARED = 300, 100
"""Names beyond this number, and characters beyond that, are not compared: that takes its time."""


class ToolchainError(Exception):
    """Base of every error that a user can fix.

    Args:
        message: one sentence, what is wrong and what would be right.
        path: the file concerned, where there is one.
        line: 1-based line in that file.
        element: name or path of the XML element concerned, as in the file.
    """

    exit_code = 5

    def __init__(
        self, message: str, *, path: str | PathLike[str] | None = None, line: int | None = None, element: str | None = None
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
        return ": ".join(part for part in (place, self.element, " ".join(self.message.split())) if part)


def _rebuild(kind: type[ToolchainError], message: str, path: str | None, line: int | None, element: str | None) -> ToolchainError:
    """Errors cross process borders in batches; keyword arguments need this to be restored."""
    return kind(message, path=path, line=line, element=element)


class UsageError(ToolchainError):
    """The call itself is wrong: an unknown option value, entity or parameter name."""

    exit_code = 2


class InvalidFile(ToolchainError):
    """A file that is missing, malformed, or breaks its standard."""

    exit_code = 3


class Unsupported(ToolchainError):
    """A valid file that asks for something this toolchain does not do, named exactly."""

    exit_code = 4


def reason(error: Exception) -> str:
    """What an exception of others says, in one line: its first, the key that it misses, or else its kind."""
    if isinstance(error, KeyError):
        return f"there is no {error}"
    return next(iter(str(error).strip().splitlines()), type(error).__name__)


def blame(error: BaseException, module: str) -> str:
    """What an exception of a plug-in says, in one line, with the file and line of the plug-in's own code that it came from.

    Args:
        module: name of the plug-in's module.
    """
    if isinstance(error, SyntaxError):
        return f"{type(error).__name__}: {error.msg} ({error.filename}:{error.lineno})"
    file = _file_of(module)
    own = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    return f"{type(error).__name__}: {error}" + (f" ({own[-1].filename}:{own[-1].lineno})" if own else "")


def _file_of(module: str) -> str | None:
    """The file of a module, also of one that could not be imported."""
    try:
        found = sys.modules[module].__spec__ if module in sys.modules else find_spec(module)
    except (ImportError, ValueError):
        return None
    return found.origin if found else None


def describe(error: Exception) -> tuple[str, int]:
    """An error in one line, and the exit code that stands for it."""
    if isinstance(error, ToolchainError):
        message, code = str(error), error.exit_code
    elif isinstance(error, OSError):
        message, code = ": ".join(str(part) for part in (error.strerror or error, error.filename) if part), 2
    elif isinstance(error, MemoryError):
        message, code = "this takes more memory than there is, or than the process may have", Unsupported.exit_code
    else:
        message, code = f"internal error: {type(error).__name__}: {error}", 5
    return one_line(message), code


def one_line(text: str) -> str:
    """Text from files and plug-ins as a terminal may see it: no line breaks, no control characters."""
    return "".join(c if c.isprintable() or "\ud800" <= c <= "\udfff" else " " for c in text)


def nearest(name: str, names: Iterable[str]) -> str:
    """What a message adds about an unknown name: the most similar of `names`, or all of them."""
    names = [each for each in names if each]
    similar = difflib.get_close_matches(name[:_LONGEST_COMPARED], names[:_MOST_COMPARED], 1)
    if similar:
        return f"did you mean {similar[0]!r}?"
    return f"there are: {', '.join(names[:20])}{', …' if len(names) > 20 else ''}" if names else "there are none"
