"""A trace as what a run leaves behind, so that replays show it."""

from __future__ import annotations

from pathlib import Path

from runner.interpreter.result import Cause, RunResult, Verdict
from runner.recording import Recording
from runner.traces.reading import read
from runner.traces.roads import road_of
from schemas.common.storage import cache_folder, writing
from schemas.osi_traces import SUFFIXES
from xodr.reader import load


def is_trace(path: Path) -> bool:
    """Whether a path is that of a trace, by its name."""
    return path.suffix.lower() in SUFFIXES and not path.is_dir()


def load_trace(path: Path, road: Path | None = None) -> RunResult:
    """The recording of an OSI trace, as a run in which nothing was tested.

    Args:
        road: the OpenDRIVE file; by default what the trace has (`runner.traces.roads.road_of`). A trace without one has a plane.

    Raises:
        InvalidFile: the trace is damaged, or its map is no OpenDRIVE.
        Unsupported: its messages hold no ground truth.
        UsageError: its lanes make no road map.
    """
    found, folder = read(path), cache_folder("roads")
    remarks = list(found.remarks)
    if road is None:
        with writing("the road", folder):
            made = road_of(path, found, folder)
        remarks += made.notes if made is not None else ["the trace has no road: a plane"]
        road = made.path if made is not None else None
    recording = found.recording
    tracks = list(recording.tracks.values())
    ends = [float(track.columns["time"][-1]) for track in tracks]
    return RunResult(
        scenario=path,
        parameters={},
        status="completed",
        end_time=max(ends, default=0.0),
        verdict=Verdict(causes=(Cause("no-event", "a recorded trace: nothing was tested"),)),
        remarks=tuple(f"remark: {each}" for each in remarks),
        ego=found.ego,
        sut="none",
        settings={"timestep": recording.timestep, "seed": 0, "world": "recorded", "max_time": None},
        events=[],
        recording=Recording(tracks, recording.timestep, load(road) if road is not None else None),
    )
