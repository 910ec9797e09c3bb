"""Lanelet2 files as lanelets: OSM elements, projection, tags, regulations, and what a map leaves implicit."""
