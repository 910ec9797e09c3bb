"""Data sets of recorded traffic, read into `runner.recording.Recording`.

`open(path)` finds the recordings of every known format in a folder or file; each `Source` reads its own when asked to.
World frame: x, y, z in m, right-handed with z up, headings mathematical, SI units; poses are those of the reference point
(see `recognition.datasets.participants`).
"""

from recognition.datasets.finder import cache_roads, open
from recognition.datasets.source import DataSet, Exclusion, Gap, Report, Source

__all__ = ["DataSet", "Exclusion", "Gap", "Report", "Source", "cache_roads", "open"]
