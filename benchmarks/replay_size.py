"""Size of replay pages, processor time to write them, and frames per second that a browser shows,
for 60 s of 20 participants.

    python benchmarks/replay_size.py [--seconds S] [--noise M] [--frames] [--town]

The runs are those of step_cost.py, on a motorway and an intersection. `--noise` adds normally
distributed noise to all positions, as recordings of real traffic have it and runs have not.
`--frames` plays each page in a headless Chromium: how many frames a second it shows depends on what
else the machine does (hence the load), the processor time that the page takes for a frame hardly;
16.7 ms is what 60 frames a second leave. `--town` instead plays a page in three dimensions, drawn
by software at 1280 by 720 pixels, of 50 km² of streets with hills, houses and signs and 200
vehicles.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import tempfile
from functools import partial
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING

import numpy as np
from step_cost import ROADS, write_scenario

import runner
import xodr
from runner.engine.participants.declaration import BoundingBox
from runner.judging.result import RunResult, Verdict
from runner.recording import COLUMNS, Recording, Track
from runner.view.replay.frames import write_animation
from runner.view.replay.player import write_replay

if TYPE_CHECKING:
    from tests.runner.chromium import Browser

PARTICIPANTS = 20
PLAYED = 5
"""Seconds for which frames are counted"""
_COUNT = f"""new Promise(done => {{
  const begin = performance.now(); let frames = 0;
  const next = () => {{
    frames++;
    if (performance.now() - begin < {PLAYED * 1000}) requestAnimationFrame(next); else done(frames);
  }};
  requestAnimationFrame(next);
}})"""


_SIDE, _BLOCK = 7000, 250
"""Side of the town and of its blocks, m"""
_STREET = """<road name="" length="{length}" id="{id}" junction="-1">
<planView><geometry s="0" x="{x}" y="{y}" hdg="{h}" length="{length}"><line/></geometry></planView>
<elevationProfile>{hills}</elevationProfile><lanes><laneSection s="0"><left>{left}</left>
<center><lane id="0" type="none"><roadMark sOffset="0" type="broken"/></lane></center>
<right>{right}</right></laneSection></lanes>
<objects>{objects}</objects><signals>{signals}</signals></road>"""
_LANE = """<lane id="{id}" type="{type}"><width sOffset="0" a="{width}" b="0" c="0" d="0"/>
<roadMark sOffset="0" type="solid"/></lane>"""


def main() -> None:
    """Print a line for each road."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("--seconds", type=float, default=60.0, help="length of the runs")
    arguments.add_argument(
        "--noise", type=float, default=0.05, help="standard deviation of the noise, m"
    )
    arguments.add_argument("--frames", action="store_true", help="play in Chromium as well")
    arguments.add_argument("--town", action="store_true", help="50 km² in three dimensions instead")
    options = arguments.parse_args()
    if options.town:
        _town()
        return
    print(
        f"{PARTICIPANTS} participants, {options.seconds:g} s; load {os.getloadavg()[0]:.1f} on "
        f"{os.cpu_count()} cores"
    )
    with tempfile.TemporaryDirectory() as folder:
        for road in ROADS:
            scenario = write_scenario(Path(folder), road, PARTICIPANTS)
            result = runner.run(scenario, sut=None, world="kinematic", max_time=options.seconds)
            _measure(road, result, Path(folder), options.frames)
            _shake(result, options.noise)
            _measure(f"{road}, noisy", result, Path(folder), options.frames)


def _town() -> None:
    """Frames per second of each camera in a town, and the simplification that the page reports."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        result, page = _traffic(_write_town(folder / "town.xodr")), folder / "town.html"
        begin = process_time()
        write_replay([result], page)
        print(
            f"town: page {page.stat().st_size / 1e6:.2f} MB in {process_time() - begin:.1f} s; "
            f"load {os.getloadavg()[0]:.1f}"
        )
        sys.path.append(str(Path(__file__).parents[1]))
        from tests.runner.chromium import Browser

        with Browser(folder / "profile", graphics=True) as browser:
            for kind in ("chase", "driver", "free"):
                browser.open(page, "t=0&view=" + kind)
                browser.run(f"document.querySelector('.stage').style = '{_WHOLE}'")
                if kind == "free":
                    for _ in range(12):
                        browser.press("e")  # up, to see more
                browser.press(" ")
                browser.run(_COUNT)  # while the page finds out what it can draw
                frames = float(browser.run(_COUNT)) / PLAYED
                print(
                    f"  {kind}: {frames:.0f} frames/s "
                    f"{browser.text('.told span') or 'nothing simplified'}"
                )


_WHOLE = "position:fixed;inset:0;width:1280px;height:720px;z-index:9"


def _write_town(path: Path) -> Path:
    """Streets along x and y with pavements, hills, a house and a sign at each block."""
    sides = (("driving", 3.5), ("shoulder", 2.0), ("sidewalk", 2.5))
    left, right = (
        "".join(
            _LANE.format(id=sign * number, type=kind, width=width)
            for number, (kind, width) in enumerate(sides, 1)
        )
        for sign in (1, -1)
    )
    roads = []
    for index in range(_SIDE // _BLOCK + 1):
        for along, (x, y, h) in enumerate(
            ((0, index * _BLOCK, 0.0), (index * _BLOCK, 0, math.pi / 2))
        ):
            places = range(_BLOCK // 2, _SIDE, _BLOCK)
            hills = "".join(
                f'<elevation s="{s}" a="{10 * (s // 500 % 2)}" b="0" '
                f'c="{(3 - 6 * (s // 500 % 2)) * 4e-5}" '
                f'd="{(-2 + 4 * (s // 500 % 2)) * 8e-8}"/>'
                for s in range(0, _SIDE, 500)
            )
            houses = "".join(
                f'<object id="{s}" type="building" s="{s}" t="25" length="30" width="18" '
                f'height="{6 + s % 7 * 3}"/>'
                for s in places
            )
            signs = "".join(
                f'<signal id="{2 * index + along}-{s}" s="{s}" t="-7" orientation="+" '
                'dynamic="no" type="274" zOffset="2"/>'
                for s in places
            )
            values = {
                "id": 2 * index + along,
                "x": x,
                "y": y,
                "h": h,
                "length": _SIDE,
                "hills": hills,
            }
            roads.append(
                _STREET.format(**values, left=left, right=right, objects=houses, signals=signs)
            )
    path.write_text(
        f'<OpenDRIVE><header revMajor="1" revMinor="6"/>{"".join(roads)}</OpenDRIVE>',
        encoding="utf-8",
    )
    return path


def _traffic(town: Path) -> RunResult:
    """A minute of 200 vehicles at 10 m/s, spread over the streets along x."""
    network, time = xodr.load(town), np.arange(0.0, 60.0, 0.05)
    tracks = []
    for number in range(200):
        street = number % (_SIDE // _BLOCK + 1)
        s = 10.0 * time + (number * 977) % (_SIDE - 700)
        x, y, z, *_ = np.array([network.road(str(2 * street)).pose(place, -1.75) for place in s]).T
        columns = dict.fromkeys(COLUMNS, np.zeros(len(time))) | {
            "time": time,
            "x": x,
            "y": y,
            "z": z,
        }
        columns |= {
            "speed": np.full(len(time), 10.0),
            "road_id": np.full(len(time), str(2 * street), object),
        }
        tracks.append(
            Track(
                f"V{number}",
                "vehicle",
                "car",
                BoundingBox(1.4, 0.0, 0.75, 4.6, 1.9, 1.5),
                partial(dict, columns),
            )
        )
    recording = Recording(tracks, 0.05, network)
    settings = {"timestep": 0.05, "seed": 0}
    return RunResult(
        town, {}, "completed", 60.0, Verdict(), (), "V0", "none", settings, [], recording
    )


def _measure(name: str, result: RunResult, folder: Path, frames: bool) -> None:
    rows = sum(len(track.columns["time"]) for track in result.recording.tracks.values())
    page, gif = folder / "replay.html", folder / "replay.gif"
    begin = process_time()
    write_replay([result], page)
    between = process_time()
    write_animation([result], gif)
    end = process_time()
    played = ", {:.0f} frames/s of {:.1f} ms".format(*_frames(page, folder)) if frames else ""
    print(
        f"{name:<20} {rows} rows: page {page.stat().st_size / 1e6:.2f} MB in "
        f"{between - begin:.2f} s{played}; "
        f"GIF {gif.stat().st_size / 1e6:.2f} MB in {end - between:.1f} s"
    )


def _shake(result: RunResult, noise: float) -> None:
    """Add noise to all positions."""
    random = np.random.default_rng(0)
    for track in result.recording.tracks.values():
        for axis in ("x", "y"):
            track.columns[axis] += random.normal(0.0, noise, len(track.columns[axis]))


def _frames(page: Path, folder: Path) -> tuple[float, float]:
    """Frames per second while the page plays, and processor time of its main
    thread for each, ms.
    """
    sys.path.append(str(Path(__file__).parents[1]))
    from tests.runner.chromium import Browser

    with Browser(folder / "profile") as browser:
        browser.call("Performance.enable", timeDomain="threadTicks")
        browser.open(page)
        browser.press(" ")
        begin = _busy(browser)
        frames = float(browser.run(_COUNT))
        return frames / PLAYED, 1000.0 * (_busy(browser) - begin) / frames


def _busy(browser: Browser) -> float:
    """Processor time (s) that the page's main thread has taken."""
    return next(
        each["value"]
        for each in browser.call("Performance.getMetrics")["metrics"]
        if each["name"] == "TaskDuration"
    )


if __name__ == "__main__":
    main()
