"""Test drives on a SUMO network without a scenario: a vehicle over each connection, and those that
do not get there.

Vehicles depart one after the other, so that none waits for another one; lights are switched off. A
connection fails if SUMO refuses the route, or the vehicle is not on the edge behind the connection
when the time is over.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from lxml import etree

from schemas.common.errors import InvalidFile, ToolchainError
from schemas.common.policy import scratch
from schemas.common.xml import line_of, parse
from xodr.formats.sumo_net.building import sumo_home

_GAP, _LONGEST = 3.0, 600.0
"""Time (s) between departures, and that a drive may take."""
_TIMEOUT = 600.0
_CLASSES = ("passenger", "bus", "emergency", "tram", "rail", "bicycle", "pedestrian")


class ConnectionDrive(NamedTuple):
    """A drive over a connection.

    Attributes:
        source, target: SUMO lanes.
        problem: why it failed; empty where it arrived.
    """

    source: str
    target: str
    problem: str


def drive_connections(net: Path) -> list[ConnectionDrive]:
    """Drive over each connection of a network for vehicles.

    Raises:
        InvalidFile: it is no network, or SUMO does not load it.
        ToolchainError: SUMO does not finish.
    """
    root = parse(net).getroot()
    if root.tag != "net":
        raise InvalidFile(
            "the root element of a SUMO network is net",
            path=net,
            line=line_of(root),
            element=str(root.tag),
        )
    wanted = list(_connections(root))
    if not wanted:
        return []
    arrived, warned = _run(net, wanted)
    return [
        ConnectionDrive(
            source, target, "" if number in arrived else warned.get(number, "it did not arrive")
        )
        for number, (source, target, _) in enumerate(wanted)
    ]


def _connections(root: etree._Element) -> Iterator[tuple[str, str, str]]:
    """Connections: from lane, to lane, and a vehicle class that may use both."""
    lanes = {lane.get("id"): lane for lane in root.iter("lane")}
    for connection in root.iterchildren("connection"):
        source, target = (
            f"{connection.get(end)}_{connection.get(f'{end}Lane')}" for end in ("from", "to")
        )
        # Inner lanes are passed on the way over their connection.
        if source.startswith(":") or source not in lanes or target not in lanes:
            continue
        kind = next(
            (
                name
                for name in _CLASSES[:-1]
                if all(_open(lanes[lane], name) for lane in (source, target))
            ),
            None,
        )
        if kind is not None:
            yield source, target, kind


def _open(lane: etree._Element, kind: str) -> bool:
    allowed, refused = (lane.get(name) for name in ("allow", "disallow"))
    if allowed is not None:
        return allowed == "all" or kind in allowed.split()
    return not (refused is not None and (refused == "all" or kind in refused.split()))


def _run(net: Path, wanted: list[tuple[str, str, str]]) -> tuple[set[int], dict[int, str]]:
    routes = etree.Element("routes")
    for kind in sorted({kind for _, _, kind in wanted}):
        # Drivers without chance, so that each run gives the same answer.
        etree.SubElement(routes, "vType", id=kind, vClass=kind, sigma="0", speedDev="0")
    for number, (source, target, kind) in enumerate(wanted):
        (start, lane), (end, _) = source.rsplit("_", 1), target.rsplit("_", 1)
        vehicle = etree.SubElement(
            routes, "vehicle", id=str(number), type=kind, depart=f"{number * _GAP:g}",
            # At the end of the lane: a long road would take the time for the test.
            departLane=lane, departPos="last",
            departSpeed="0", arrivalPos="max",
        )  # fmt: skip
        etree.SubElement(vehicle, "route", edges=f"{start} {end}")
    program = sumo_home() / "bin" / ("sumo.exe" if os.name == "nt" else "sumo")
    with scratch("xosc-drive-") as folder:
        (folder / "r.rou.xml").write_bytes(etree.tostring(routes))
        command = [
            str(program), "-n", str(net.resolve()), "-r", "r.rou.xml", "--tripinfo-output",
            "trips.xml", "--no-step-log",
            # A vehicle that is stuck must not be moved on, nor removed by a collision, or it would
            # seem to arrive.
            "--ignore-route-errors", "--time-to-teleport", "-1", "--collision.action", "none",
            "--tls.all-off",
            "--end", f"{len(wanted) * _GAP + _LONGEST:g}", "--max-depart-delay", f"{_LONGEST:g}",
        ]  # fmt: skip
        try:
            done = subprocess.run(
                command, cwd=folder, env={**os.environ, "SUMO_HOME": str(sumo_home())},
                stdin=subprocess.DEVNULL,
                capture_output=True, timeout=_TIMEOUT, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            raise ToolchainError(
                f"SUMO has not finished the test drives after {_TIMEOUT:.0f} s", path=net
            ) from None
        text = done.stderr.decode(errors="replace")
        if done.returncode != 0:
            reason = next(
                (line for line in text.splitlines() if line.startswith("Error")),
                f"exit code {done.returncode}",
            )
            raise InvalidFile(
                f"SUMO does not load this network: {reason.removeprefix('Error: ')}", path=net
            )
        trips = folder / "trips.xml"
        ended = parse(trips).getroot().iter("tripinfo")
        # Vaporized vehicles are in the list of trips, too.
        arrived = {int(trip.get("id", "-1")) for trip in ended if not trip.get("vaporized")}
    warned: dict[int, str] = {}
    for line in text.splitlines():
        # Warnings name vehicles in quotes; lanes and edges are not decimal, or beyond the count.
        for part in line.split("'")[1::2]:
            if part.isdecimal() and int(part) < len(wanted):
                warned.setdefault(int(part), line.removeprefix("Warning: ").strip())
    return arrived, warned
