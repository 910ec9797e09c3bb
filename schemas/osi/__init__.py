"""OSI traces: reading them. `schemas.checks.osi` has the rules that they are checked by.

Modules:

- `traces`: traces of OSI messages

Example::

    Trace(Path("run.osi"))
"""
