"""The logical scenarios of the library, made from a table of manoeuvres and one of road geometries.

`python -m studies.library` writes them into `xosc/library` and `xodr/library`.
"""

from generation.space.logical.library import maneuver_scenarios, write

__all__ = ["maneuver_scenarios", "write"]
