"""Lookup of road positions from positions in the plane, one by one and as arrays.

Modules:

- `arrays`: reference lines, profiles and lanes evaluated at many places at once
- `geo`: geographic coordinates: latitude and longitude to the world of a road network, and back
- `lanelets`: lanes cut into lanelets with neighbours, predecessors and successors
- `signals`: lanes that a signal holds for, and its stop line
- `placing`: from the world to the road for many positions at once

Example::

    place(network, x, y)  # arrays
"""
