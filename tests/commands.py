"""The commands of the package as tests call them; the fixture `command` of
tests/conftest.py gives one.
"""

from __future__ import annotations

import signal
from collections.abc import Callable
from typing import NamedTuple

from xosc_toolchain.start import MODULES as SCRIPTS
from xosc_toolchain.start import load

__all__ = ["SCRIPTS", "Answer", "Command", "load", "main"]


class Answer(NamedTuple):
    """Exit code, and what went to standard output and standard error."""

    code: int
    out: str
    err: str


Command = Callable[..., Answer]


def main(name: str) -> Callable[[], None]:
    """The function that is started as a command."""
    function: Callable[[], None] = load(name).main
    return function


def as_of_a_terminal() -> None:
    """Before a process begins: let it end by Ctrl-C, which shells take from what
    they start beside them.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
