"""Rules for road networks that take exact geometry; `schemas.checks.registry` finds them by the name of this package."""
