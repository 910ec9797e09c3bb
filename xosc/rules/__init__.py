"""Rules of `xosc-check` for OpenSCENARIO by family: a function each, entered under its uid by `schemas.checks.registry.rule`."""
