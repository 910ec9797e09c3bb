"""The class that is written on a scenario of the library is the one that the
labelling rules find in a run of it.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import runner
import xosc
from generation.space.logical.library import SCENARIOS
from recognition.labels import Label, LabelledEvent, label
from recognition.scenes import site_at
from xosc.writing.tags import tags_of

TITLES = {
    path: title
    for path in sorted(SCENARIOS.glob("*.xosc"))
    if xosc.load(path).kind == "scenario"
    for title in [next((tag.value for tag in tags_of(path) if tag.type == "Class"), None)]
}
SHOWN = [path for path, title in TITLES.items() if title is not None]
OTHER_VALUES = {"r157_cut_in": {"CutIn_Gap_m": "80"}}
"""By default it ends in a collision less than a second after the cut-in, and a
lane has to be held for a second.
"""


def events(path: Path, folder: Path, sut: str) -> list[LabelledEvent]:
    """What happens to the ego."""
    given = OTHER_VALUES.get(path.stem, {})
    result = runner.run(path, parameters=given, sut=sut, world="kinematic", timestep=0.05)
    road = xosc.load(path).node.need("RoadNetwork", "LogicFile").get("filepath")
    found = label(result.recording.locate(), site_at(path.parent / road, folder=folder), path.stem)
    return [event for event in found if event.ego == "Ego"]


def test_all_17_classes_are_there_and_no_other() -> None:
    assert set(TITLES.values()) == {each.title for each in Label if each is not Label.UNKNOWN} | {
        None
    }


@pytest.mark.parametrize("path", SHOWN, ids=lambda path: path.stem)
def test_a_run_shows_the_class(path: Path, tmp_path: Path) -> None:
    assert TITLES[path] in [event.label.title for event in events(path, tmp_path, "none")]


@pytest.mark.parametrize(
    "path",
    [path for path in SHOWN if TITLES[path] != Label.URBAN_CUT_IN.title],
    ids=lambda path: path.stem,
)
def test_a_run_with_the_collision_avoidance_system_shows_it_as_well(
    path: Path, tmp_path: Path
) -> None:
    """Not so urban cut-ins: rule 9 asks for a TTC below 3 s, which the system
    does not let come about.
    """
    assert TITLES[path] in [event.label.title for event in events(path, tmp_path, "cas")]


@pytest.mark.parametrize(
    "path", [path for path, title in TITLES.items() if title is None], ids=lambda path: path.stem
)
def test_a_scenario_without_a_class_shows_none_but_following(path: Path, tmp_path: Path) -> None:
    assert {event.label for event in events(path, tmp_path, "none")} <= {Label.CAR_FOLLOWING}
