"""Profiles of test protocols, a module each, called by its name with hyphens: it assigns `SUMMARY`
and `PROFILE`."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from schemas.common.errors import UsageError, nearest
from schemas.common.packages import described

if TYPE_CHECKING:
    from runner.judging.assessment.protocol import AssessmentProfile


def profiles() -> dict[str, str]:
    """A line about each profile, by name; none is loaded."""
    return {
        name.replace("_", "-"): str(line) for name, line in described(__name__, "SUMMARY").items()
    }


def profile(name: str) -> AssessmentProfile:
    """The profile of that name.

    Raises:
        UsageError: there is none.
    """
    if name not in profiles():
        raise UsageError(
            f"there is no assessment {name!r}; {nearest(name, profiles())}; protocols: "
            f"{', '.join(profiles())}"
        )
    found: AssessmentProfile = import_module(f"{__name__}.{name.replace('-', '_')}").PROFILE
    return found
