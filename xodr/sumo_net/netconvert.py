"""Running SUMO's netconvert, which comes with the eclipse-sumo package."""

from __future__ import annotations

import importlib.util
import logging
import os
import sys
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from lxml import etree

from schemas.errors import ToolchainError, Unsupported
from schemas.xml import parse

if TYPE_CHECKING:
    from xodr.sumo_net.plain import PlainNetwork

_log = logging.getLogger(__name__)

TIMEOUT = 120.0
"""Longest time that netconvert may take, in s; a city of some thousand roads takes a few."""

OPTIONS = (
    "--offset.disable-normalization",  # keep the coordinates of the road network
    "--no-turnarounds",  # only the connections of the road network
    "--output.original-names",
    "--precision=4",
    "--seed=42",
)


class NetconvertFailed(Unsupported):
    """netconvert refused its input; the message is netconvert's first complaint."""


@cache
def sumo_home() -> Path:
    """Folder of the eclipse-sumo package.

    Raises:
        ToolchainError: the package is not installed.
    """
    found = importlib.util.find_spec("sumo")
    if found is None or not found.submodule_search_locations:
        raise ToolchainError("SUMO's netconvert is needed: pip install eclipse-sumo")
    return Path(found.submodule_search_locations[0])


def program() -> Path:
    """The netconvert program.

    Raises:
        ToolchainError: it is not there.
    """
    found = sumo_home() / "bin" / ("netconvert.exe" if sys.platform == "win32" else "netconvert")
    if not found.is_file():
        raise ToolchainError("SUMO's netconvert is missing; install eclipse-sumo anew", path=found)
    return found


def netconvert(plain: PlainNetwork, folder: Path) -> etree._Element:
    """Build a SUMO network, with `folder` for the files between; netconvert's warnings go to the log.

    Raises:
        NetconvertFailed: netconvert refuses or takes too long.
    """
    import subprocess

    arguments = [str(program()), *OPTIONS, "--output-file=net.xml", *(["--lefthand"] if plain.left_hand else [])]
    for kind in ("nodes", "edges", "connections"):
        (folder / f"{kind}.xml").write_bytes(etree.tostring(getattr(plain, kind)))
        arguments.append(f"--{kind[:-1]}-files={kind}.xml")
    try:
        done = subprocess.run(
            arguments, cwd=folder, env={**os.environ, "SUMO_HOME": str(sumo_home())}, stdin=subprocess.DEVNULL,
            capture_output=True, timeout=TIMEOUT, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise NetconvertFailed(f"SUMO's netconvert has not finished after {TIMEOUT:.0f} s") from None
    lines = done.stderr.decode(errors="replace").splitlines()
    target = folder / "net.xml"
    if done.returncode != 0 or not target.is_file():
        reason = next((line for line in lines if line.startswith("Error")), f"exit code {done.returncode}")
        raise NetconvertFailed(f"SUMO's netconvert cannot build a network: {reason.removeprefix('Error: ')}")
    for line in lines:
        _log.debug("netconvert: %s", line)
    return parse(target).getroot()
