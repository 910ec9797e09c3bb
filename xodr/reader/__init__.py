"""Reads OpenDRIVE 1.4 to 1.9 into a RoadNetwork: `load(path)`.

Tolerant where public files are sloppy and the meaning is still clear: missing names, empty
attributes, repeated or absent profile records, elements of length 0, links declared by one side
only. What has no meaning is refused with file and line.
"""

from xodr.reader.document import load as load
