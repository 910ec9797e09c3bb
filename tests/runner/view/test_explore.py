"""Parameters of explored scenarios, borders of failure, and films of points by a warm process."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path

import pytest

import runner.view.explore as explore
from runner.judging.settings import RunSettings
from schemas.common.errors import InvalidFile, UsageError

LIBRARY = Path("xosc/library")
GAP = explore.ExploredParameter("Gap", explore.NUMBER, "20", 0.0, 100.0)
LANES = explore.ExploredParameter("Lanes", explore.WHOLE, "3", 1.0, 9.0)


def fails_below(edge: float, played: list[str]) -> explore.Border:
    def judge(texts: Sequence[str]) -> list[str]:
        played.extend(texts)
        return ["failed" if float(text) < edge else "passed" for text in texts]

    return explore.border(GAP, judge)


def test_ranges_are_those_of_the_variation_else_of_the_constraints() -> None:
    ranges = {
        each.name: (each.value, each.low, each.high)
        for each in explore.Explored.of(LIBRARY / "simple_cut_in_variation.xosc").parameters
    }
    assert ranges["CutIn_Gap_m"] == ("5", 5.0, 35.0)
    assert ranges["Ego_Speed_mps"] == ("27.8", 1.0, 50.0)


@pytest.mark.parametrize(
    ("kind", "value", "constraints", "expected"),
    [
        ("double", "4", "", (explore.NUMBER, 2.0, 6.0, (), False)),
        ("double", "-4", "", (explore.NUMBER, -6.0, -2.0, (), False)),
        ("double", "0", "", (explore.NUMBER, 0.0, 10.0, (), False)),
        ("integer", "3", "", (explore.WHOLE, 1.0, 5.0, (), False)),
        ("double", "$Other", "", (explore.TEXT, 0.0, 0.0, (), True)),
        ("boolean", "true", "", (explore.CHOICE, 0.0, 0.0, ("true", "false"), True)),
        ("string", "van", "equalTo=car equalTo=van",
            (explore.CHOICE, 0.0, 0.0, ("car", "van"), True)),
        ("double", "4", "greaterThan=1 lessThan=5", (explore.NUMBER, 1.0, 5.0, (), True)),
        ("double", "4", "greaterThan=1", (explore.NUMBER, 2.0, 6.0, (), False)),
        ("double", "9", "greaterThan=1 lessThan=5", (explore.NUMBER, 1.0, 9.0, (), True)),
    ],
)  # fmt: skip
def test_kinds_and_ranges_of_declarations(
    kind: str, value: str, constraints: str, expected: tuple[object, ...]
) -> None:
    rules = [tuple(each.split("=")) for each in constraints.split()]
    equal = rules and rules[0][0] == "equalTo"
    limits = tuple((rule,) for rule in rules) if equal else ((tuple(rules),) if rules else ())
    declared = explore.ListedParameter("P", kind, value, limits)  # type: ignore[arg-type]
    found = explore._parameter(declared, value, ())
    assert (found.kind, found.low, found.high, found.choices, found.limited) == expected


def test_values_of_requests_are_checked() -> None:
    explored = explore.Explored.of(LIBRARY / "simple_cut_in.xosc")
    assert explored.values({"CutIn_Gap_m": "7"}) == {"CutIn_Gap_m": "7"}
    for wrong in ([], {"CutIn_Gap": "7"}, {"CutIn_Gap_m": 7}, {"CutIn_Gap_m": "7" * 999}):
        with pytest.raises(UsageError):
            explored.values(wrong)
    with pytest.raises(UsageError, match="CutIn_Gap_m"):
        explore.Explored.of(LIBRARY / "simple_cut_in.xosc", {"CutIn_Gap": "7"})
    with pytest.raises(InvalidFile):
        explore.Explored.of(Path("nowhere.xosc"))


@pytest.mark.parametrize("edge", [0.05, 12.34, 50.0, 99.99])
def test_a_border_is_found_to_a_thousandth_of_the_range(edge: float) -> None:
    played: list[str] = []
    found = fails_below(edge, played)
    assert found.edge is not None and found.borders == 1
    holds, fails = map(float, found.edge)
    assert fails < edge <= holds and holds - fails <= 0.11
    assert len(played) == len(set(played)) <= 20, "no value is played twice"


def test_the_nearest_of_several_borders_is_found_and_none_where_all_is_alike() -> None:
    def judge(texts: Sequence[str]) -> list[str]:
        return ["failed" if 10 < float(t) < 30 or float(t) > 80 else "passed" for t in texts]

    found = explore.border(GAP, judge)
    assert found.borders == 3 and found.edge is not None
    assert 9 < float(found.edge[0]) <= 10 < float(found.edge[1]) < 11 or found.edge[0] > "29"
    assert explore.border(GAP, lambda texts: ["error"] * len(texts)).edge is None
    whole = explore.border(LANES, lambda t: ["failed" if int(x) > 6 else "passed" for x in t])
    assert whole.edge == ("6", "7")
    with pytest.raises(UsageError, match="no number"):
        explore.border(explore.ExploredParameter("P", explore.TEXT, "a"), judge)


@pytest.mark.slow
def test_a_warm_process_plays_points_and_sends_roads_once() -> None:
    films = explore.FilmProcess()
    settings = RunSettings(sut="adas", world="kinematic", max_time=3.0)

    def asked(ground: str = "", **parameters: str) -> dict[str, object]:
        scenario = LIBRARY / "simple_cut_in.xosc"
        return films.film(explore.FilmRequest(scenario, parameters, (settings,), ground))

    try:
        first = asked()
        scene: dict[str, list[object]] = first["scene"]  # type: ignore[assignment]
        assert len(scene["runs"]) == len(scene["roads"]) == 1
        again = asked(str(first["ground"]), CutIn_Gap_m="8")
        assert "roads" not in again["scene"] and again["ground"] == first["ground"]  # type: ignore[operator]
        assert "violates" in str(asked(CutIn_Gap_m="9999")["error"])
        films._process.kill()
        assert "ended" in str(asked().get("error", "ended")), "or it was started anew"
        assert "scene" in asked(), "started anew"
    finally:
        films.close()


@pytest.mark.slow
def test_a_newer_request_takes_the_place_of_an_older_one() -> None:
    films = explore.FilmProcess()
    slow = RunSettings(sut="none", world="kinematic", timestep=0.001, max_time=300.0)
    quick = RunSettings(sut="none", world="kinematic", max_time=0.5)
    scenario, ended = LIBRARY / "simple_cut_in.xosc", list[object]()

    def ask() -> None:
        try:
            ended.append(films.film(explore.FilmRequest(scenario, {}, (slow,))))
        except explore.Superseded as error:
            ended.append(error)

    try:
        films.film(explore.FilmRequest(scenario, {}, (quick,)))
        older = threading.Thread(target=ask)
        older.start()
        while films._number < 2:
            older.join(0.01)
        assert "scene" in films.film(explore.FilmRequest(scenario, {}, (quick,)))
        older.join(20.0)
        assert isinstance(ended[0], explore.Superseded)
    finally:
        films.close()
