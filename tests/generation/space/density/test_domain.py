"""Operational domains: forms, the ego's speed, what they leave of the foreseeable."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from generation.search.gate import R157_SPEED, Domain
from generation.space import SpaceChoice
from generation.space.density.roles import roles_of
from generation.space.logical.library import SCENARIOS
from generation.space.recorded import of_recordings, of_samples
from generation.space.space import Space
from runner.judging.settings import RunSettings
from schemas.common.errors import UsageError

CUT_IN = SCENARIOS / "cut_in_highway.xosc"
SPACE = Space.of(CUT_IN)
ROAD = SCENARIOS.parent.parent / "xodr" / "library" / "highway_straight.xodr"


def domain(*texts: str, scenario: Path = CUT_IN, space: Space = SPACE) -> Domain:
    return Domain.of(texts, scenario, space, roles_of((*space.names, *space.pinned)), RunSettings())


def test_the_regulation_limits_the_egos_speed_whoever_acts() -> None:
    assert domain("r157").limits == {"Ego_Speed_mps": (0.0, R157_SPEED)}
    change = SCENARIOS / "lane_change_left_highway.xosc"
    assert "Ego_StartSpeed_mps" in domain("r157", scenario=change, space=Space.of(change)).limits


def test_limits_of_one_parameter_meet() -> None:
    found = domain("r157", "Ego_Speed_mps=15..50", "CutIn_Gap_m=10..60")
    assert found.limits == {"Ego_Speed_mps": (15.0, R157_SPEED), "CutIn_Gap_m": (10.0, 60.0)}
    assert str(found) == "Ego_Speed_mps 15 to 36.1111, CutIn_Gap_m 10 to 60"
    assert str(domain()) == "not limited" and not domain()


def test_what_is_outside_is_not_foreseeable() -> None:
    prior = of_samples(of_recordings(None, "cut_in"), SPACE).prior(SPACE, "gaussian")
    theta = prior.sample(400, np.random.default_rng(0))
    limited = prior.within(partial(domain("Ego_Speed_mps=0..30").holds, SPACE))
    inside = theta[:, SPACE.names.index("Ego_Speed_mps")] <= 30.0
    np.testing.assert_array_equal(limited.foreseeable(theta), prior.foreseeable(theta) & inside)
    assert limited.foreseeable(theta).sum() < prior.foreseeable(theta).sum()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("fast", "r157, road or NAME=LOW..HIGH is expected"),
        ("Ego_Speed_mps=30..20", "r157, road or NAME=LOW..HIGH is expected"),
        ("Ego_Sped_mps=0..20", "there is no number 'Ego_Sped_mps'; did you mean 'Ego_Speed_mps'"),
    ],
)
def test_wrong_limits_are_named(text: str, said: str) -> None:
    with pytest.raises(UsageError, match=r"--domain") as error:
        domain(text)
    assert said in str(error.value)


def test_a_pinned_value_outside_is_refused() -> None:
    pinned = Space.of(CUT_IN, SpaceChoice(pinned={"Ego_Speed_mps": "40"}))
    with pytest.raises(UsageError, match=r"Ego_Speed_mps is pinned at 40, outside 0 to 36\.1"):
        domain("r157", space=pinned)


def test_roads_give_their_speed_limit() -> None:
    limit = next(float(each.attrib["max"]) for each in ElementTree.parse(ROAD).iter("speed"))
    low, high = domain("road").limits["Ego_Speed_mps"]
    assert low == 0.0 and high == pytest.approx(limit if limit < 60.0 else limit / 3.6, rel=1e-6)


def test_roads_without_a_limit_are_named(tmp_path: Path) -> None:
    (tmp_path / "road.xodr").write_text(re.sub(r"<speed [^>]*/>", "", ROAD.read_text()))
    text = CUT_IN.read_text().replace("../../xodr/library/highway_straight.xodr", "road.xodr")
    text = text.replace('path="catalogs', f'path="{SCENARIOS}/catalogs')
    (tmp_path / "cut_in.xosc").write_text(text)
    with pytest.raises(UsageError, match="its roads have no speed limit"):
        domain("road", scenario=tmp_path / "cut_in.xosc")
