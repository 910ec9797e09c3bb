"""Official schemas and semantic rules of OpenSCENARIO and OpenDRIVE: which version a file has, and whether it is sound."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from schemas.checks.checker import check, check_many
    from schemas.checks.problems import Problem

__all__ = ["Problem", "check", "check_many"]


def __getattr__(name: str) -> object:
    """The names above are imported on first use: every floor imports this package, few of them check files."""
    if name in __all__:
        from schemas.checks import checker

        return getattr(checker, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
