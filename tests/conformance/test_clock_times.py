"""Times of trajectories by a clock, such as UNIX seconds."""

from __future__ import annotations

from pathlib import Path

import pytest

import runner
from tests.conformance.support import at, track
from tests.runner.files import scenario, story

FIRST = 1_690_000_000


def played(folder: Path, domain: str, offset: float) -> runner.RunResult:
    vertices = "".join(
        f'<Vertex time="{FIRST + second}"><Position><WorldPosition x="{100 + 10 * second}" '
        'y="-1.75" z="0" h="0"/>'
        "</Position></Vertex>"
        for second in range(4)
    )
    follow = (
        "<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>"
        '<Trajectory name="t" '
        f'closed="false"><ParameterDeclarations/><Shape><Polyline>{vertices}</Polyline></Shape>'
        f'</Trajectory></TrajectoryRef><TimeReference><Timing domainAbsoluteRelative="{domain}" '
        f'offset="{offset:.0f}" '
        'scale="1"/></TimeReference><TrajectoryFollowingMode followingMode="position"/>'
        "</FollowTrajectoryAction></RoutingAction></PrivateAction>"
    )
    path = scenario(folder, stories=story("Lead", [(0.0, follow)]), stop=2.5)
    return runner.run(path, sut=None, timestep=0.01, world="kinematic")


@pytest.mark.parametrize(
    ("domain", "offset", "told"),
    [("absolute", -FIRST, False), ("absolute", 0, True), ("relative", 0, True)],
)
def test_unix_seconds_are_counted_from_the_first(
    tmp_path: Path, domain: str, offset: float, told: bool
) -> None:
    result = played(tmp_path, domain, offset)
    assert at(track(result, "Lead"), 2.0, "x") == pytest.approx(120.0, abs=1e-3)
    assert any("those of a clock" in remark for remark in result.remarks) == told
