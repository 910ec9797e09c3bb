"""Rules of `xosc-check` by family: each is one function, entered under its uid by `schemas.checks.registry.rule`."""
