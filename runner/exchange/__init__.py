"""Runs for other tools, and traces of others.

Modules:

- `exports`: for other tools
- `traces`: recordings from ASAM OSI ground truth: tracks of a trace
- `xosc_export`: the command `xosc-export`

Example::

    xosc-export scenarios --to osi --out traces
"""
