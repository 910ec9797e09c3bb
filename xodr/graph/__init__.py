"""Connections of roads and lanes: links, ways, routes, travel along them.

Modules:

- `lane_plan`: lanes to be in, before a turn or an exit
- `links`: links between lanes: at the ends of roads, by road and junction links
- `locate`: from the world to the road: the nearest place on a road network
- `network`: a road network: roads, junctions and signals, positions on them
- `routes`: routes by the standard's strategies
- `travel`: moving along lanes: over lane sections, road borders and through junctions
- `ways`: the graph of a road network: which roads follow each other in which direction

Example::

    xodr.load("town.xodr").locate(10.0, 2.0)  # road, lane, s, t
"""
