"""A run in SUMO's own window: its network, with all entities moved as recorded.

The runner drives SUMO as a library, which has no window. So the run is played again afterwards, in
sumo-gui over TraCI; SUMO moves no vehicle by itself here.
"""

from __future__ import annotations

import contextlib
import io
import math
import os
import shutil
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from schemas.common.errors import ToolchainError, UsageError
from xodr.formats import sumo_net
from xosc.writing.versions import with_recent

if TYPE_CHECKING:
    from runner.judging.result import RunResult
    from runner.recording import Track

_SHAPES = with_recent(
    {
        "car": "passenger/sedan",
        "van": "delivery",
        "truck": "truck",
        "semitrailer": "truck/trailer",
        "trailer": "truck/trailer",
        "bus": "bus",
        "motorbike": "motorcycle",
        "bicycle": "bicycle",
        "train": "rail",
        "tram": "rail/railcar",
        "pedestrian": "pedestrian",
        "wheelchair": "pedestrian",
    }
)
"""Shape of entities in SUMO by category; the others are plain boxes."""
_EGO, _OTHERS = (230, 80, 20, 255), (60, 110, 190, 255)
_ROUTE = "dock"
_ANYWHERE = 2
"""keepRoute: to be put exactly there, on a road or off it"""
_WINDOW = "1200,700"
_SIGHT = 70.0
"""Initial radius (m) of the view around the ego"""
_GLANCE = 0.2
"""Time between looks whether the window is still open, s"""


def need_display() -> None:
    """Refuse to open a window where there is none to be had.

    Raises:
        UsageError: no display, or no sumo-gui.
    """
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise UsageError(
            "--gui needs a display, and there is none (DISPLAY is not set); --replay makes a page "
            "to look at instead"
        )
    _program()


def _program() -> str:
    import sumo

    home = Path(sumo.__file__).parent
    program = shutil.which("sumo-gui", path=str(home / "bin")) or shutil.which("sumo-gui")
    if program is None:
        raise UsageError("--gui needs sumo-gui, which comes with eclipse-sumo; reinstall that")
    return program


def show(result: RunResult, stay: bool = True) -> None:
    """Play a run in a window, in real time; returns when the window is closed.

    Args:
        stay: keep the window open at the end of the run.

    Raises:
        UsageError: there is no display.
        ToolchainError: sumo-gui does not start.
    """
    import traci

    need_display()
    network = result.recording.network
    net = sumo_net.build(network.path if network is not None else None)
    dt = result.settings["timestep"]
    with tempfile.TemporaryDirectory(prefix="xosc-gui-") as folder:
        view = Path(folder) / "view.xml"
        view.write_text(
            '<viewsettings><scheme name="real world"/></viewsettings>\n',
            encoding="utf-8",
            newline="\n",
        )
        try:
            with contextlib.redirect_stdout(io.StringIO()):  # traci prints its attempts to connect
                traci.start(_arguments(net.path, view, dt), numRetries=20)
            _play(traci, result)
            while stay:
                traci.simulation.getTime()
                time.sleep(_GLANCE)
            traci.close()
        except traci.FatalTraCIError:
            return  # the user has closed the window
        except (traci.TraCIException, OSError) as error:
            raise ToolchainError(f"sumo-gui can't play the run: {error}") from None


def _arguments(net: Path, view: Path, dt: float) -> list[str]:
    return [
        _program(),
        f"--net-file={net}",
        f"--gui-settings-file={view}",
        # SUMO counts time in milliseconds.
        f"--step-length={max(round(dt, 3), 0.001)!r}",
        f"--window-size={_WINDOW}",
        "--start",
        "--quit-on-end",
        # Motion is as recorded: SUMO must not remove who touches or waits.
        "--collision.action=none",
        "--time-to-teleport=-1",
        "--no-step-log",
        "--no-warnings",
    ]


def _play(traci: Any, result: RunResult) -> None:
    """Move all entities step by step; each is in SUMO as long as it was in the run."""
    dt = result.settings["timestep"]
    rows: dict[int, list[tuple[int, int]]] = defaultdict(list)
    tracks = list(result.recording.tracks.values())
    for number, track in enumerate(tracks):
        _declare(traci, number, track, track.name == result.ego)
        for row, moment in enumerate(track.columns["time"].tolist()):
            rows[round(moment / dt)].append((number, row))
    traci.route.add(_ROUTE, [sumo_net.DOCK])
    present: set[int] = set()
    start = time.monotonic()
    # By steps, not times: sums of steps would drift apart from rounded times.
    for tick in range(round(result.end_time / dt) + 1):
        there = dict(rows[tick])
        # Sorted, since sets have no order: the same run looks the same each time.
        for number in sorted(present - there.keys()):
            traci.vehicle.remove(str(number))
        for number in sorted(there.keys() - present):
            traci.vehicle.add(str(number), _ROUTE, f"type{number}", departPos="0", departSpeed="0")
        for number, row in there.items():
            traci.vehicle.moveToXY(
                str(number),
                "",
                -1,
                *_front(tracks[number], row),
                keepRoute=_ANYWHERE,
                matchThreshold=1.0,
            )
        traci.simulationStep()
        # Only after a step SUMO knows where a new vehicle is.
        for number in sorted(there.keys() - present):
            if tracks[number].name == result.ego:
                _watch(traci, str(number))
        present = set(there)
        time.sleep(max(0.0, start + tick * dt - time.monotonic()))


def _declare(traci: Any, number: int, track: Track, ego: bool) -> None:
    """The vehicle type of one participant, with its size and shape."""
    types, name = traci.vehicletype, f"type{number}"
    types.copy("DEFAULT_VEHTYPE", name)
    # `ignoring` may be on every lane: recorded entities are wherever they were.
    types.setVehicleClass(name, "ignoring")
    types.setShapeClass(name, _SHAPES.get(track.category, "unknown"))
    types.setLength(name, max(track.box.length, 0.1))
    types.setWidth(name, max(track.box.width, 0.1))
    types.setColor(name, _EGO if ego else _OTHERS)


def _front(track: Track, row: int) -> tuple[float, float, float]:
    """Middle of the front bumper (m) and SUMO's angle (degrees, clockwise from north) at a row of a
    track."""
    x, y, h = (float(track.columns[name][row]) for name in ("x", "y", "h"))
    ahead, aside = track.box.x + track.box.length / 2, track.box.y
    return (
        x + ahead * math.cos(h) - aside * math.sin(h),
        y + ahead * math.sin(h) + aside * math.cos(h),
        math.degrees(math.remainder(math.pi / 2 - h, math.tau)),
    )


def _watch(traci: Any, vehicle: str) -> None:
    """Let the window follow a vehicle."""
    view = traci.gui.DEFAULT_VIEW
    traci.gui.trackVehicle(view, vehicle)
    x, y = traci.vehicle.getPosition(vehicle)
    traci.gui.setBoundary(view, x - _SIGHT, y - _SIGHT / 2, x + _SIGHT, y + _SIGHT / 2)
