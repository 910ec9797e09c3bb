"""The commands of the package as tests call them; the fixture `command` of tests/conftest.py gives one."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

SCRIPTS: dict[str, str] = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]["scripts"]
"""Module and function of each command by its name"""


class Answer(NamedTuple):
    """Exit code, and what went to standard output and standard error."""

    code: int
    out: str
    err: str


Command = Callable[..., Answer]


def main(name: str) -> Callable[[], None]:
    """The function that is started as a command."""
    module, _, function = SCRIPTS[name].partition(":")
    return getattr(import_module(module), function)
