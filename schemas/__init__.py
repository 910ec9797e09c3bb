"""Official schemas and semantic rules of OpenSCENARIO and OpenDRIVE: which version a file has, and
whether it is sound."""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.common.packages import public

if TYPE_CHECKING:
    from schemas.checks import Problem as Problem
    from schemas.checks.checker import check as check
    from schemas.checks.checker import check_many as check_many

    __version__: str
else:
    __getattr__, __dir__ = public(
        __name__,
        {
            "Problem": "schemas.checks",
            "check": "schemas.checks.checker",
            "check_many": "schemas.checks.checker",
        },
    )

__all__ = ["Problem", "check", "check_many"]
