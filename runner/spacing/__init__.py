"""Distances, closing speeds and regions in the coordinate systems of the standard."""
