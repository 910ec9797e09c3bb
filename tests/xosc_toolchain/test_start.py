"""Signals that come while a command is being imported, while it works, and again while it ends."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

from xosc_toolchain.start import MODULES

AT_IMPORT = """
import os, signal, sys

class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), {number})

{before}
sys.meta_path.insert(0, Interrupting())
sys.argv = [{name!r}, "absent.xosc"]
from xosc_toolchain import start
start.{function}()
"""


HANDLED = (
    "for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP): signal.signal(each, "
    "signal.SIG_DFL)"
)
"""Signals as in a terminal: in the background a shell starts commands that ignore SIGINT"""


def interrupted(name: str, number: int, module: str, before: str = HANDLED) -> tuple[int, str, str]:
    """Exit code and output of a command that gets a signal when a module is imported."""
    code = AT_IMPORT.format(
        module=module, number=int(number), name=name, function=name.replace("-", "_"), before=before
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize("name", MODULES)
def test_a_signal_during_the_imports_ends_in_one_line(name: str) -> None:
    assert interrupted(name, signal.SIGTERM, "typer") == (143, "", f"\n{name}: interrupted\n")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_other_signals_do_so_too(number: signal.Signals) -> None:
    assert interrupted("xosc-check", number, "typer") == (
        128 + number,
        "",
        "\nxosc-check: interrupted\n",
    )


@pytest.mark.parametrize("name", ["xosc-check", "xosc-list"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_a_command_works(name: str, number: signal.Signals) -> None:
    assert interrupted(name, number, "lxml") == (128 + number, "", f"\n{name}: interrupted\n")


def test_signals_that_are_ignored_stay_so() -> None:
    ignore = (
        "for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP): signal.signal(each, "
        "signal.SIG_IGN)"
    )
    for number in (signal.SIGINT, signal.SIGHUP):
        code, _, error = interrupted("xosc-check", number, "typer", ignore)
        assert (code, error.count("interrupted")) == (3, 0)
