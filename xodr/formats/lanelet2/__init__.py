"""Lanelet2 maps as OpenDRIVE: `convert` a file, or `build` or `write` a road map from lanelets of
any origin."""

from xodr.formats.lanelet2.conversion import Built, Conversion, build, convert, write
from xodr.formats.lanelet2.lanelet import Lanelet, LaneletNeighbour

__all__ = ["Built", "Conversion", "Lanelet", "LaneletNeighbour", "build", "convert", "write"]
