"""Lookup of road positions from positions in the plane, one by one and as arrays."""
