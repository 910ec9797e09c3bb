"""Data sets of recorded traffic, read into `runner.recording.Recording`.

`open(path)` finds the recordings of every known format in a folder or file; each `Source` reads its
own when asked to. World frame: x, y, z in m, right-handed with z up, headings mathematical, SI
units; poses are those of the reference point (see `recognition.recordings.source`).

Modules:

- `conditions`: weather, daylight, surface and speed limit of recordings
- `formats`: formats of data sets, one module or package each, found by being here
- `intake`: intake of recordings: report on reading, whether what was recorded is possible
- `motion`: motion of recorded tracks: observations with noise
- `road_sources`: roads of recordings without an OpenDRIVE file: highD's markings
- `rows`: rows of recorded tracks: order, gaps, rates of change, and the tracks made of them
- `source`: data sets of recordings: their sources, reports of what was repaired or left out
- `table`: tables of data sets in CSV, Parquet and JSON

Example::

    recordings.open("highD").sources
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.common.packages import public

if TYPE_CHECKING:
    from recognition.recordings.intake import Check as Check
    from recognition.recordings.intake import Cut as Cut
    from recognition.recordings.intake import Exclusion as Exclusion
    from recognition.recordings.intake import Gap as Gap
    from recognition.recordings.intake import Report as Report
    from recognition.recordings.source import DataSet as DataSet
    from recognition.recordings.source import LightStates as LightStates
    from recognition.recordings.source import SiteRoad as SiteRoad
    from recognition.recordings.source import Source as Source
    from recognition.recordings.source import cache_roads as cache_roads
    from recognition.recordings.source import open as open

__all__ = [
    "Check",
    "Cut",
    "DataSet",
    "Exclusion",
    "Gap",
    "LightStates",
    "Report",
    "SiteRoad",
    "Source",
    "cache_roads",
    "open",
]

_SOURCE = dict.fromkeys(
    ("DataSet", "LightStates", "SiteRoad", "Source", "cache_roads", "open"),
    "recognition.recordings.source",
)
_REPORT = dict.fromkeys(
    ("Check", "Cut", "Exclusion", "Gap", "Report"), "recognition.recordings.intake"
)
__getattr__, __dir__ = public(__name__, _SOURCE | _REPORT)
