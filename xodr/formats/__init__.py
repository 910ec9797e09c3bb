"""Roads in other formats, read and written.

Modules:

- `lanelet2`: Lanelet2 maps as OpenDRIVE
- `sumo_net`: SUMO networks of OpenDRIVE files

Example::

    sumo_net.build("town.xodr").sumo_lanes
"""
