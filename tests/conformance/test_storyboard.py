"""The storyboard's own elements."""

from __future__ import annotations

import pytest

from tests.conformance.support import events, run


def test_a_maneuver_group_that_starts_again_has_its_events_in_standby() -> None:
    """`Short` is complete from 1 s on; the group's second execution begins after 2 s, and `Short`
    in it half a second later.
    """
    result = run("ManeuverGroup")
    assert [e.time for e in events(result, "startTransition", "Twice")] == pytest.approx([0.0, 2.0])
    assert [e.time for e in events(result, subject="Short")] == pytest.approx(
        [0.51, 1.0, 2.51, 3.0]
    )
    (over,), (again,) = (
        events(result, "startTransition", name) for name in ("AllOver", "AllAgain")
    )
    assert over.time == pytest.approx(1.01)
    assert again.time == pytest.approx(2.01)
