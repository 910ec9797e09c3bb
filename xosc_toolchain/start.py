"""Entry points of all commands, which answer signals from their first moment on.

Imports take a part of a second, and several on a busy machine; a signal during them ends the
command as a later one does: one line, and 128 plus its number as exit code. Nothing has been
written by then.
"""

from __future__ import annotations

import gc
import os
import signal
from functools import partial
from importlib import import_module
from types import ModuleType

MODULES = {
    "xosc": "xosc_toolchain.xosc",
    "xosc-list": "xosc.listing.xosc_list",
    "xosc-run": "runner.xosc_run",
    "xosc-replay": "runner.view.xosc_replay",
    "xosc-check": "schemas.xosc_check",
    "xosc-recognize": "recognition.xosc_recognize",
    "xosc-generate": "generation.xosc_generate",
    "xosc-loop": "generation.loop.xosc_loop",
    "xosc-export": "runner.exchange.xosc_export",
    "xosc-road": "xodr.formats.maps.xosc_road",
    "xosc-explore": "xosc_toolchain.xosc_explore",
}
"""The module with the function `main` of each command"""
OFFERED = {
    "triage": "runner.view.rehearsal:",
    "project settings": "xosc_toolchain.settings:",
}
"""Code that commands of lower floors ask for by name; see `schemas.common.packages.offer`"""
_ENDING = ("SIGINT", "SIGTERM", "SIGHUP")
_SIGNALLED = 128
_STANDARD_ERROR = 2


def load(name: str) -> ModuleType:
    """Import a command's module, and offer it what higher floors bring.

    Modules are no garbage: no collection looks for some in them, now or later.
    """
    gc.disable()
    try:
        module = import_module(MODULES[name])
    finally:
        gc.freeze()
        gc.enable()
    from schemas.common.packages import offer  # takes time, in which signals are answered now

    offer(OFFERED)
    return module


def start(name: str) -> None:
    """Import a command and run it."""
    for number in (getattr(signal, name) for name in _ENDING if hasattr(signal, name)):
        if signal.getsignal(number) in (
            signal.SIG_DFL,
            signal.default_int_handler,
        ):  # nohup ignores it
            signal.signal(number, partial(_end, name))
    main = load(name).main
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    main()


def _end(name: str, number: int, _frame: object) -> None:
    """End the process at once: an exception might be caught by a module that is just imported."""
    try:
        os.write(_STANDARD_ERROR, f"\n{name}: interrupted\n".encode())
    finally:  # also where it is closed
        os._exit(_SIGNALLED + number)


xosc = partial(start, "xosc")
xosc_list = partial(start, "xosc-list")
xosc_run = partial(start, "xosc-run")
xosc_replay = partial(start, "xosc-replay")
xosc_check = partial(start, "xosc-check")
xosc_recognize = partial(start, "xosc-recognize")
xosc_generate = partial(start, "xosc-generate")
xosc_loop = partial(start, "xosc-loop")
xosc_export = partial(start, "xosc-export")
xosc_road = partial(start, "xosc-road")
xosc_explore = partial(start, "xosc-explore")
