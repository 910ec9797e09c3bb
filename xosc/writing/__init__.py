"""Writing of scenarios: files by manoeuvres, tags, other versions of the standard.

Modules:

- `files`: new OpenSCENARIO documents from their parts
- `maneuvers`: typed builders of scenarios and catalogues, on scenariogeneration
- `tags`: tags of scenarios: ASAM OpenLABEL as JSON beside the file
- `versions`: conversion between the versions 1.0 to 1.4 of OpenSCENARIO XML: lossless

Example::

    xosc.write(xosc.convert(xosc.load("mine.xosc"), (1, 2)), "older.xosc")
"""
