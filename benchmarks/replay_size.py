"""Size of replay pages, processor time to write them, and frames per second that a browser shows, for 60 s of 20 participants.

    python benchmarks/replay_size.py [--seconds S] [--noise M] [--frames]

The runs are those of step_cost.py, on a motorway and an intersection. `--noise` adds normally distributed noise to all positions,
as recordings of real traffic have it and runs have not. `--frames` plays each page in a headless Chromium: how many frames a
second it shows depends on what else the machine does (hence the load), the processor time that the page takes for a frame
hardly; 16.7 ms is what 60 frames a second leave.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING

import numpy as np
from step_cost import ROADS, write_scenario

import runner
from runner.interpreter.result import RunResult
from runner.replay.frames import write_animation
from runner.replay.player import write_replay

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


def main() -> None:
    """Print a line for each road."""
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--seconds", type=float, default=60.0, help="length of the runs")
    arguments.add_argument("--noise", type=float, default=0.05, help="standard deviation of the noise, m")
    arguments.add_argument("--frames", action="store_true", help="play in Chromium as well")
    options = arguments.parse_args()
    print(f"{PARTICIPANTS} participants, {options.seconds:g} s; load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    with tempfile.TemporaryDirectory() as folder:
        for road in ROADS:
            scenario = write_scenario(Path(folder), road, PARTICIPANTS)
            result = runner.run(scenario, sut=None, world="kinematic", max_time=options.seconds)
            _measure(road, result, Path(folder), options.frames)
            _shake(result, options.noise)
            _measure(f"{road}, noisy", result, Path(folder), options.frames)


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
        f"{name:<20} {rows} rows: page {page.stat().st_size / 1e6:.2f} MB in {between - begin:.2f} s{played}; "
        f"GIF {gif.stat().st_size / 1e6:.2f} MB in {end - between:.1f} s"
    )


def _shake(result: RunResult, noise: float) -> None:
    """Add noise to all positions."""
    random = np.random.default_rng(0)
    for track in result.recording.tracks.values():
        for axis in ("x", "y"):
            track.columns[axis] += random.normal(0.0, noise, len(track.columns[axis]))


def _frames(page: Path, folder: Path) -> tuple[float, float]:
    """Frames per second while the page plays, and processor time of its main thread for each, ms."""
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
    return next(each["value"] for each in browser.call("Performance.getMetrics")["metrics"] if each["name"] == "TaskDuration")


if __name__ == "__main__":
    main()
