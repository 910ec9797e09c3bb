"""Rules of `xosc-check` for OpenDRIVE by family, with those on the exact geometry of roads.

Modules:

- `lanes`: lanes of road networks (OpenDRIVE): level, access, borders, widths, links
- `roads`: road networks (OpenDRIVE): ids, links, reference lines, lanes, records and numbers
- `sections`: lanes of OpenDRIVE documents as rules need them: sections by layer, widths

Example::

    xosc-check --rules
"""
