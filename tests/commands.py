"""The commands of the package as tests call them; the fixture `command` of tests/conftest.py gives one."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import NamedTuple

from xosc_toolchain.start import MODULES as SCRIPTS


class Answer(NamedTuple):
    """Exit code, and what went to standard output and standard error."""

    code: int
    out: str
    err: str


Command = Callable[..., Answer]


def main(name: str) -> Callable[[], None]:
    """The function that is started as a command."""
    function: Callable[[], None] = import_module(SCRIPTS[name]).main
    return function
