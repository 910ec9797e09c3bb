"""What is searched for each recognised class."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from generation.loop.findings import Refused
from generation.loop.inputs import LIBRARY, SearchTarget, of_classes, of_inputs, of_scenario
from generation.pipeline import LEAST
from generation.search.settings import Ask
from generation.space.logical.library import SCENARIOS
from generation.space.space import Space
from recognition.labels.maneuvers.units import OWN, Samples
from tests.runner.files import distribution, scenario


def rows(*titles: str) -> list[dict[str, object]]:
    return [{"class": title, "file": f"{title.replace(' ', '_')}/one.xosc"} for title in titles]


def own(count: int) -> Samples:
    """So many cut-ins as these recordings would have."""
    return (cut_ins := Samples.read(OWN).of_kind("cut_in")).where(
        np.arange(len(cut_ins.theta))[:count]
    )


def test_the_librarys_scenario_of_every_class_can_be_searched() -> None:
    for name in LIBRARY.values():
        path = SCENARIOS / f"{name}.xosc"
        target = of_scenario(path, None)
        assert isinstance(target, SearchTarget), target
        assert len(target.recorded(Space.of(path)).within(Space.of(path)).theta) >= LEAST
        assert target.prior.manoeuvres >= LEAST and not target.prior.own


def test_a_class_without_enough_manoeuvres_of_its_own_is_varied_by_the_library(
    tmp_path: Path,
) -> None:
    (target,) = of_classes(rows("highway cut in"), tmp_path, own(5))
    assert isinstance(target, SearchTarget)
    assert target.scenario == SCENARIOS / "cut_in_highway.xosc"
    assert (target.name, target.title) == ("highway_cut_in", "highway cut in")
    assert not target.prior.own


def test_manoeuvres_of_the_recordings_are_the_density_where_there_are_enough(
    tmp_path: Path,
) -> None:
    (target,) = of_classes(rows("highway cut in"), tmp_path, own(400))
    assert isinstance(target, SearchTarget)
    assert target.prior.own
    assert len(target.recorded(Space.of(target.scenario)).theta) == 400


def test_classes_of_which_nothing_is_recorded_say_so(tmp_path: Path) -> None:
    found = list(
        of_classes(rows("unknown", "roundabout entering", "discovered 01"), tmp_path, None)
    )
    assert [each.title for each in found] == ["unknown", "roundabout entering", "discovered 01"]
    assert all(isinstance(each, Refused) and "nothing is recorded" in each.reason for each in found)


def test_a_scenario_whose_manoeuvre_is_not_known_says_so(tmp_path: Path) -> None:
    path = tmp_path / "mine.xosc"
    path.write_bytes((SCENARIOS / "cut_in_highway.xosc").read_bytes())
    refused = of_scenario(path, None)
    assert isinstance(refused, Refused)
    assert "--kind" in refused.reason and "--density uniform" in refused.reason


def test_options_say_what_to_search_of_the_scenarios_that_declare_what_they_name() -> None:
    ask = Ask(free=("CutIn_Gap_m=2..40", "Nowhere=1..2"), pinned={"Ego_Speed_mps": "30"})
    simple, named = (
        {path: path.stem}
        for path in (SCENARIOS / "simple_cut_in.xosc", SCENARIOS / "cut_in_highway.xosc")
    )
    (target,) = of_inputs(simple, None, ask)
    assert isinstance(target, SearchTarget) and target.asked is not None
    assert list(target.asked.choice.marginals) == ["CutIn_Gap_m"]
    assert target.prior.manoeuvres == 0
    (refused,) = of_inputs(simple, None, Ask())
    assert isinstance(refused, Refused) and "--kind" in refused.reason
    (target,) = of_inputs(named, None, Ask())
    assert isinstance(target, SearchTarget) and target.asked is None


def test_a_scenario_is_searched_by_its_variation_files_where_nothing_else_says_what_is_likely(
    tmp_path: Path,
) -> None:
    template, alone = (
        scenario(tmp_path, "template", stop=1.0),
        scenario(tmp_path, "alone", stop=1.0),
    )
    files = [
        distribution(tmp_path, name, {"Gap": (10, 60, 10)}, of="template")
        for name in ("near", "far")
    ]
    names = {path: path.stem for path in (template, alone, *files)}
    found = {each.title: each for each in of_inputs(names, None, Ask())}
    assert found["template"] == Refused(
        "template", "its variation files are searched in its place: near, far"
    )
    assert (
        isinstance(found["alone"], Refused)
        and "nothing says which values are likely" in found["alone"].reason
    )
    assert all(isinstance(found[path.stem], SearchTarget) for path in files)


def test_variation_files_and_a_scenario_of_which_none_is_searched_do_not_name_each_other(
    tmp_path: Path,
) -> None:
    template = scenario(tmp_path, "template", stop=1.0)
    single = distribution(tmp_path, "single", {"Gap": (10, 10, 1)}, of="template")
    names = {path: path.stem for path in (template, single)}

    def reasons(ask: Ask) -> dict[str, str]:
        return {
            each.title: each.reason
            for each in of_inputs(names, None, ask)
            if isinstance(each, Refused)
        }

    one_value = "it gives each parameter one value, which leaves nothing to search"
    assert (
        reasons(Ask())["single"] == f"{one_value}, and its scenario template is not searched either"
    )
    assert "--density uniform" in reasons(Ask())["template"], "one of them says what can be done"
    names[distribution(tmp_path, "range", {"Gap": (10, 60, 10)}, of="template")] = "range"
    assert reasons(Ask()) == {
        "template": "its variation file is searched in its place: range",
        "single": f"{one_value}; in its place: range"
    }  # fmt: skip
    del names[template], names[tmp_path / "range.xosc"]
    assert reasons(Ask()) == {"single": f"{one_value}: search template.xosc itself"}
