"""Reads OpenDRIVE 1.4 to 1.9 into a RoadNetwork: `load(path)`.

Tolerant where public files are sloppy and the meaning is still clear: missing names, empty
attributes, repeated or absent profile records, elements of length 0, links declared by one side
only. What has no meaning is refused with file and line.

Modules:

- `document`: from an OpenDRIVE file to a `RoadNetwork`: header, roads, junctions, controllers
- `elements`: attributes of OpenDRIVE elements as Python values
- `repairs`: repairs of OpenDRIVE files that the reader refuses although what they mean is plain
- `roads`: reads roads: plan view, elevation, lateral profile, links and types; lane sections

Example::

    network = xodr.load("town.xodr")
"""

from xodr.reader.document import load as load
