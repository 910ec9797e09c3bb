"""Edge cases as files: valid, complete in themselves, and with the same verdicts
when they are run again.
"""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import runner
import schemas
import xosc
from generation.search.outcomes import Cases, Episodes, Evaluator, choose
from generation.search.plays import ArrayPlays
from generation.search.settings import Choice
from generation.search.variations import Evidence, Writer, Written
from generation.space import SpaceChoice
from generation.space.density.marginals import marginal
from generation.space.density.models.mixtures import Gaussian
from generation.space.logical.library import ROADS, SCENARIOS
from generation.space.space import Space
from runner.judging.settings import RunSettings
from schemas.common.errors import InvalidFile, UsageError
from xosc.distributions import ProbabilityDistributionSet
from xosc.exports import standard
from xosc.exports.draft import Folder
from xosc.writing.tags import read

CUT_IN = SCENARIOS / "cut_in_highway.xosc"
SPACE = Space.of(CUT_IN, SpaceChoice(pinned={"Ego_Speed_mps": "31.5"}))
RNG = np.random.default_rng(2)
EVIDENCE = Evidence("cas", "random", "ad-rss", 3, 40, 0.05)


@pytest.fixture(scope="module")
def density() -> Gaussian:
    return Gaussian().fit(SPACE.draw(500, np.random.default_rng(1)))


@pytest.fixture(scope="module")
def cases(density: Gaussian) -> Cases:
    theta = SPACE.draw(40, np.random.default_rng(3))
    with Evaluator(CUT_IN, SPACE, processes=1) as evaluate:
        outcomes = evaluate(theta)
        episodes = Episodes(theta, outcomes, outcomes.r_risk + outcomes.collision)
        likelihood = density.log_density(theta)
        return choose(
            SPACE,
            episodes,
            lambda _: (likelihood, np.ones(40, bool)),
            evaluate,
            Choice(6, 0.1, violations=True),
        )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, cases: Cases, density: Gaussian) -> Path:
    """All files of a search, moved after they were written."""
    made, moved = tmp_path_factory.mktemp("made") / "out", tmp_path_factory.mktemp("moved") / "out"
    writer = Writer(CUT_IN, SPACE, made)
    writer.cases(cases, EVIDENCE)
    writer.concrete(cases, EVIDENCE)
    writer.density(density, 5)
    shutil.move(made, moved)
    return moved


def test_parameters_stay_where_catalogues_are_of_another_version(tmp_path: Path) -> None:
    """Entries of catalogues of 1.0 see the scenario's parameters, later ones do
    not: nothing may be worked out for that.
    """
    source = tmp_path / "source"
    standard.export(CUT_IN, "1.3", Folder(source))
    catalogue = source / "catalogs" / "vehicles" / "vehicle_catalog.xosc"
    text = catalogue.read_text().replace('revMinor="3"', 'revMinor="0"')
    catalogue.write_text(re.sub(r'mass="[^"]*"', 'mass="$Mass"', text))
    Writer(source / CUT_IN.name, SPACE, tmp_path / "out")
    written = (
        xosc.load(tmp_path / "out" / CUT_IN.name).node.need("ParameterDeclarations").children()
    )
    assert set(SPACE.names) <= {each.get("name") for each in written}


def test_a_road_whose_name_is_the_value_of_a_parameter_is_taken_along(tmp_path: Path) -> None:
    source = tmp_path / "source"
    standard.export(CUT_IN, "1.3", Folder(source))
    text = (source / CUT_IN.name).read_text()
    road = re.search(r'LogicFile filepath="([^"]*)"', text)
    assert road is not None
    declared = (
        '<ParameterDeclarations><ParameterDeclaration name="Road" parameterType="string" '
        f'value="{road[1]}"/>'
    )
    text = text.replace(road[0], 'LogicFile filepath="$Road"').replace(
        "<ParameterDeclarations>", declared, 1
    )
    (source / CUT_IN.name).write_text(text)
    Writer(source / CUT_IN.name, Space.of(source / CUT_IN.name), tmp_path / "out")
    assert runner.run(tmp_path / "out" / CUT_IN.name, world="kinematic", max_time=0.2).status
    assert len(list((tmp_path / "out").rglob("*.xodr"))) == 1


def test_roads_that_a_searched_parameter_names_are_all_taken_along(tmp_path: Path) -> None:
    source = tmp_path / "source"
    shutil.copytree(SCENARIOS / "catalogs", source / "catalogs")
    road = (ROADS / "highway_straight.xodr").read_text()
    for name in ("a", "b"):
        (source / "maps" / name).mkdir(parents=True)
        (source / "maps" / name / "road.xodr").write_text(road)
    text = CUT_IN.read_text().replace('"../../xodr/library/highway_straight.xodr"', '"$Road"')
    declared = '<ParameterDeclaration name="Road" parameterType="string" value="maps/a/road.xodr"/>'
    text = text.replace("<ParameterDeclarations>", f"<ParameterDeclarations>{declared}", 1)
    scenario = source / CUT_IN.name
    scenario.write_text(text)
    choices = ProbabilityDistributionSet((("maps/a/road.xodr", 1.0), ("maps/b/road.xodr", 2.0)))
    roads = marginal(choices, "Road")
    assert not isinstance(roads, str)
    space = Space.of(scenario, SpaceChoice(marginals={"Road": roads}))
    out = tmp_path / "out"
    path = Writer(scenario, space, out).density(Gaussian().fit(space.draw(99, RNG)), 5)
    copies = sorted(each.name for each in (out / "roads").iterdir())
    assert copies == ["road.xodr", "road~2.xodr"]
    written = (out / CUT_IN.name).read_text()
    assert 'filepath="$Road"' in written and 'value="roads/road.xodr"' in written
    assert set(re.findall(r'value="(roads/[^"]+)"', path.read_text())) == {
        f"roads/{name}" for name in copies
    }
    shutil.rmtree(source)
    for name in copies:
        assert (
            runner.run(
                out / CUT_IN.name, parameters={"Road": f"roads/{name}"}, world="kinematic"
            ).status
            == "completed"
        )
    assert not schemas.check(out / CUT_IN.name)


def test_all_files_are_valid(folder: Path) -> None:
    files = [*folder.rglob("*.xosc"), *folder.rglob("*.xodr")]
    assert (
        len(files) == 1 + 1 + 6 + 1 + 2 + 1
    )  # scenario, cases, concrete ones, density, catalogues, road
    assert [schemas.check(path) for path in files] == [[]] * len(files)


def test_the_variation_file_leads_to_the_same_verdicts(folder: Path, cases: Cases) -> None:
    found = []
    for scenario, parameters in xosc.variations(folder / "cut_in_highway_edge_cases.xosc"):
        assert parameters["Ego_Speed_mps"] == "31.5"
        found.append(not runner.run(scenario, parameters=parameters).verdict.passed)
    assert found == cases.outcomes.collision.tolist()
    assert any(found)


def test_concrete_scenarios_have_no_parameters_and_lead_to_the_same_verdicts(
    folder: Path, cases: Cases
) -> None:
    files = sorted(folder.glob("*_edge_case_0*.xosc"))
    assert not any(
        b"$" in path.read_bytes() or b"ParameterDeclaration " in path.read_bytes() for path in files
    )
    assert [
        not runner.run(path).verdict.passed for path in files
    ] == cases.outcomes.collision.tolist()


def test_tags_beside_the_files_tell_the_evidence(folder: Path, cases: Cases) -> None:
    told = {
        tag.type: tag.value for tag in read(folder / "cut_in_highway_edge_cases.openlabel.json")
    }
    assert told["SystemUnderTest"] == "cas"
    assert told["Reward"] == tuple(cases.tags()["Reward"])
    assert told["PinnedParameters"] == ("Ego_Speed_mps=31.5",)
    one = {
        tag.type: tag.value
        for tag in read(folder / "cut_in_highway_edge_case_000001.openlabel.json")
    }
    assert one["Verdict"] == cases.tags()["Verdict"][1]
    header = xosc.load(folder / "cut_in_highway_edge_case_000001.xosc").node.need(
        "FileHeader", "Properties"
    )
    assert {"openlabel.Verdict", "openlabel.CarefulDriver"} <= {
        each.get("name") for each in header.children()
    }


def test_the_stochastic_file_draws_what_the_density_does(folder: Path, density: Gaussian) -> None:
    drawn = [
        parameters for _, parameters in xosc.variations(folder / "cut_in_highway_density.xosc")
    ]
    assert len(drawn) == 100
    theta = np.array([[float(values[name]) for name in SPACE.names] for values in drawn])
    wanted = density.sample(5000, np.random.default_rng(0))
    wanted = wanted[((wanted >= SPACE.low) & (wanted <= SPACE.high)).all(axis=1)]
    np.testing.assert_allclose(
        SPACE.unit(theta).mean(axis=0), SPACE.unit(wanted).mean(axis=0), atol=0.1
    )


def test_categories_are_written_with_their_shares(tmp_path: Path) -> None:
    scenario = SCENARIOS / "unsignalised_left_turn_t_junction.xosc"
    words = marginal(ProbabilityDistributionSet((("car", 1.0), ("truck", 3.0))), "Oncoming_Model")
    assert not isinstance(words, str)
    space = Space.of(scenario, SpaceChoice(marginals={"Oncoming_Model": words}, default=False))
    codes = np.repeat([[0.0], [1.0]], [10, 30], axis=0) + np.linspace(-0.1, 0.1, 40)[:, None]
    density = Gaussian().fit(codes)
    path = Writer(scenario, space, tmp_path).density(density, 5)
    drawn = [values["Oncoming_Model"] for _, values in xosc.variations(path)]
    assert set(drawn) == {"car", "truck"} and 50 < drawn.count("truck") < 95


def test_the_same_cases_give_the_same_bytes_and_others_are_not_written_over_them(
    folder: Path, cases: Cases
) -> None:
    path = folder / "cut_in_highway_edge_cases.xosc"
    before = path.read_bytes()
    Writer(CUT_IN, SPACE, folder).cases(cases, EVIDENCE)
    assert path.read_bytes() == before
    with pytest.raises(UsageError, match="in the way"):
        Writer(CUT_IN, SPACE, folder).cases(cases, Evidence("aeb", "random", "ad-rss", 3, 40, 0.05))
    assert json.loads(path.with_suffix(".openlabel.json").read_text())["openlabel"]["tags"]


def test_other_files_are_replaced_where_that_is_asked_for(tmp_path: Path, cases: Cases) -> None:
    path = Writer(CUT_IN, SPACE, tmp_path).cases(cases, EVIDENCE)
    before = path.read_bytes()
    path.write_bytes(before + b"<!-- mine -->")
    assert Writer(CUT_IN, SPACE, tmp_path, overwrite=True).cases(cases, EVIDENCE) == path
    assert path.read_bytes() == before


def test_files_that_were_edited_are_withdrawn_where_that_is_asked_for(
    tmp_path: Path, cases: Cases
) -> None:
    path, written = (
        Writer(CUT_IN, SPACE, tmp_path).cases(cases, EVIDENCE),
        Written(tmp_path, CUT_IN.stem),
    )
    written.note()
    path.write_bytes(path.read_bytes() + b"<!-- mine -->")
    written.withdraw()
    assert path.exists()
    written.withdraw(changed=True)
    assert not path.exists() and (tmp_path / CUT_IN.name).exists()


def test_a_road_in_a_folder_that_is_asked_for_is_played_and_taken_along(tmp_path: Path) -> None:
    source, elsewhere = tmp_path / "source" / CUT_IN.name, tmp_path / "elsewhere"
    standard.export(CUT_IN, "1.3", Folder(source.parent))
    elsewhere.mkdir()
    (road,) = source.parent.rglob("*.xodr")
    road.rename(elsewhere / road.name)
    with pytest.raises(InvalidFile, match="--road-path"):
        ArrayPlays(source, SPACE)
    settings = RunSettings(road_path=(str(elsewhere),))
    middle = (SPACE.low + SPACE.high)[np.newaxis] / 2.0
    assert ArrayPlays(source, SPACE, settings)(middle).executed.all()
    Writer(source, SPACE, tmp_path / "out", settings)
    assert runner.run(tmp_path / "out" / CUT_IN.name, world="kinematic", max_time=0.2).status
