"""OSI traces: reading them. `schemas.checks.osi` has the rules that they are checked by."""
