"""The system stops behind a truck that brakes."""

import xosc_toolchain as xt


def test_it_passes_where_nobody_brakes_fails() -> None:
    assert xt.run("highway_lead_brake", sut="none", world="kinematic").verdict.failures
    assert not xt.run("highway_lead_brake", sut="acme", world="kinematic").verdict.failures
