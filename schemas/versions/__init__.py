"""Versions of the standards: the schema of each, official or made from the one before by its
differences.

Modules:

- `differences`: XSDs of versions that no dependency brings
- `registry`: which standard, version and kind a file has, and the official XSD for it

Example::

    schema_for(OPENSCENARIO, (1, 3))  # the XSD
"""
