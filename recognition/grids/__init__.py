"""Occupancy grids about an ego: what the encoder sees of a scene (METHOD §1)."""

from recognition.grids.config import CHANNELS, VELOCITY_STEP, Channel, Grid
from recognition.grids.frames import Moments, covered
from recognition.grids.raster import Site, rasterise

__all__ = ["CHANNELS", "VELOCITY_STEP", "Channel", "Grid", "Moments", "Site", "covered", "rasterise"]
