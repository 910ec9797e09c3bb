"""Moments at the stride: of a class, of nothing, or neither."""

from __future__ import annotations

import pytest

from recognition.labels import Rules, passing
from recognition.sites import Site
from recognition.training.windows import events_and_background
from recognition.trfe.samples import BACKGROUND
from runner.recording import Recording
from tests.recognition.driving import STEP, route, site, track
from xodr.builders import four_way_intersection


@pytest.fixture(scope="module")
def crossing(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return site(four_way_intersection(), tmp_path_factory.mktemp("crossing"))


def test_nothing_is_not_said_of_a_way_through_a_junction_that_no_rule_has_a_class_for(crossing: Site) -> None:
    straight = track("ego", *route(crossing.network, ("3", 1, 50.0), 8.0, 16.0, ("107",)))
    recording = Recording([straight], STEP, None)
    events, regular = events_and_background(recording, crossing, "r", Rules())
    (start, end), *others = passing(recording, crossing)["ego"]
    assert not events and not others and 5.0 < start < end
    assert {moment.label for moment in regular} == {BACKGROUND}
    assert any(moment.time < start for moment in regular) and any(moment.time > end for moment in regular)
    assert not any(start <= moment.time <= end for moment in regular)
