"""The version of the distribution, from its one place: the installed metadata."""

from functools import cache


@cache
def version() -> str:
    """Version of xosc-toolchain; "unknown" where it is used without being installed."""
    from importlib import metadata

    try:
        return metadata.version("xosc-toolchain")
    except metadata.PackageNotFoundError:
        return "unknown"
