"""Moments at the stride: of a class, of nothing, or neither."""

from __future__ import annotations

import numpy as np
import pytest

from recognition.labels import Label, Rules, passing
from recognition.scenes import Site
from recognition.trfe.inputs.samples import BACKGROUND
from recognition.trfe.training.windows import events_and_background
from runner.recording import Recording
from schemas.common.array_types import FloatArray
from tests.recognition.driving import STEP, route, site, track
from xodr.builders import four_way_intersection


@pytest.fixture(scope="module")
def crossing(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return site(four_way_intersection(), tmp_path_factory.mktemp("crossing"))


def way(crossing: Site, connecting: str) -> tuple[FloatArray, FloatArray]:
    """Places of a vehicle that drives from the west through the junction at 8 m/s."""
    return route(crossing.network, ("3", 1, 50.0), 8.0, 16.0, (connecting,))


def test_nothing_happens_on_a_straight_way_through_a_junction_that_no_vehicle_crosses(
    crossing: Site,
) -> None:
    recording = Recording([track("ego", *way(crossing, "107"))], STEP, None)
    events, regular = events_and_background(recording, crossing, "r", Rules())
    (passage,) = passing(recording, crossing)["ego"]
    assert not events and passage.uncrossed and 5.0 < passage.start < passage.end
    assert {moment.label for moment in regular} == {BACKGROUND}
    assert any(passage.start <= moment.time <= passage.end for moment in regular)


def test_nothing_is_not_said_of_a_straight_way_that_the_record_cuts(crossing: Site) -> None:
    x, y = way(crossing, "107")
    end = round(7.5 / STEP)
    recording = Recording([track("ego", x[:end], y[:end])], STEP, None)
    _, regular = events_and_background(recording, crossing, "r", Rules())
    (passage,) = passing(recording, crossing)["ego"]
    assert not passage.uncrossed
    assert any(moment.time < passage.start for moment in regular)
    assert not any(passage.start <= moment.time <= passage.end for moment in regular)


def test_a_vehicle_that_waits_in_a_junction_does_nothing_until_its_turn(crossing: Site) -> None:
    x, y = way(crossing, "108")
    inside, held = round(7.0 / STEP), round(10.0 / STEP)
    x, y = (np.insert(values, inside, np.full(held, values[inside])) for values in (x, y))
    events, regular = events_and_background(
        Recording([track("ego", x, y)], STEP, None), crossing, "r", Rules()
    )
    (turn,) = events
    waiting = [moment for moment in regular if 7.5 < moment.time < turn.time]
    assert turn.label is Label.LEFT_TURN
    assert sum(moment.label == BACKGROUND for moment in waiting) >= 3
    assert all(
        abs(moment.time - turn.time) >= 3.0 for moment in waiting if moment.label == BACKGROUND
    )
