"""Roads in other formats, read and written.

Modules:

- `commonroad`: lanes of CommonRoad files, read and written
- `geojson`: lanes, borders and marks for geographic information systems, written
- `lanelet2`: Lanelet2 maps as OpenDRIVE, and lanes of Lanelet2 maps
- `maps`: conversion, comparison, cutting and showing of maps; the command `xosc-road`
- `opendrive`: lanes of OpenDRIVE files, read and written
- `sumo`: lanes of SUMO networks, read and written
- `sumo_net`: SUMO networks of OpenDRIVE files

Example::

    sumo_net.build("town.xodr").sumo_lanes
"""
