"""Catalogue references: finding entries, assigning their parameters, putting them in place."""

from __future__ import annotations

from importlib import import_module

import pytest

import xosc
from schemas.catalogs import EXPECTED, KINDS
from schemas.common.errors import InvalidFile
from xosc.resolve import MAX_NESTING

LOCATIONS = "".join(
    f'<{kind}Catalog><Directory path="{kind.lower()}"/></{kind}Catalog>' for kind in KINDS
)
CAR = """
<Vehicle name="car" mass="$mass">
  <ParameterDeclarations>
    <ParameterDeclaration name="mass" parameterType="double" value="1500"/>
    <ParameterDeclaration name="half" parameterType="double" value="${$mass / 2}"/>
  </ParameterDeclarations>
  <Performance maxSpeed="$half"/>
</Vehicle>"""


def reference(name="Cars", entry="car", **assignments):
    items = "".join(
        f'<ParameterAssignment parameterRef="{key}" value="{value}"/>'
        for key, value in assignments.items()
    )
    return (
        f'<CatalogReference catalogName="{name}" entryName="{entry}">'
        f"<ParameterAssignments>{items}</ParameterAssignments></CatalogReference>"
    )


def ego(*args, **kwargs):
    return f'<ScenarioObject name="Ego">{reference(*args, **kwargs)}</ScenarioObject>'


def resolved(path, parameters=None):
    return xosc.resolve(xosc.load(path), parameters).node


def test_the_entry_takes_the_place_of_the_reference_and_knows_its_file(scenario, catalog):
    file = catalog("vehicle/some_name.xosc", CAR, name="Cars")
    root = resolved(scenario(locations=LOCATIONS, entities=ego()))
    car = root.need("Entities", "ScenarioObject", "Vehicle")
    assert (car.get("mass"), car.need("Performance").get("maxSpeed")) == ("1500", "750")
    assert car.where == f"{file}:5"
    assert car.need("Performance").where == f"{file}:10"
    assert root.need("Entities", "ScenarioObject").path.name == "scenario.xosc"
    assert [node.where for node in root.iter("Performance")] == [f"{file}:10"]


@pytest.mark.parametrize("place", EXPECTED)
def test_every_kind_of_entry_has_its_places(scenario, catalog, place):
    kind = EXPECTED[place][-1]
    catalog(f"{kind.lower()}/c.xosc", f'<{kind} name="entry"/>', name="C")
    body = f'<{place} name="p"><!-- c -->{reference("C", "entry")}</{place}>'
    part = resolved(scenario(locations=LOCATIONS, storyboard=body)).need("Storyboard", place)
    assert [node.tag for node in part.children(kind, "CatalogReference")] == [kind]


def test_assignments_set_the_parameters_of_the_entry(scenario, catalog):
    catalog("vehicle/cars.xosc", CAR, name="Cars")
    declared = '<ParameterDeclaration name="m" parameterType="double" value="1000"/>'
    path = scenario(
        locations=LOCATIONS, parameters=declared, entities=ego(mass="${$m * 2}") + ego()
    )
    first, second = resolved(path, {"m": 700}).need("Entities").children("ScenarioObject")
    assert first.need("Vehicle", "Performance").get("maxSpeed") == "700"
    assert second.need("Vehicle", "Performance").get("maxSpeed") == "750"


def test_an_assigned_value_is_a_literal(scenario, catalog):
    entry = """<Vehicle name="car" model3d="$model"><ParameterDeclarations>
        <ParameterDeclaration name="model" parameterType="string" value=""/>
        <ParameterDeclaration name="one" parameterType="int" value="${2 - 1}"/></ParameterDeclarations></Vehicle>"""
    catalog("vehicle/cars.xosc", entry, name="Cars")
    declared = '<ParameterDeclaration name="price" parameterType="string" value="${1 +} $"/>'
    path = scenario(locations=LOCATIONS, parameters=declared, entities=ego(model="$price"))
    assert resolved(path).need("Entities", "ScenarioObject", "Vehicle").get("model3d") == "${1 +} $"


def test_the_dollar_sign_before_an_assigned_name_is_dropped(scenario, catalog):
    catalog("vehicle/cars.xosc", CAR, name="Cars")
    path = scenario(locations=LOCATIONS, entities=ego(mass=1).replace('"mass"', '"$mass"'))
    assert resolved(path).need("Entities", "ScenarioObject", "Vehicle").get("mass") == "1"


@pytest.mark.parametrize(
    ("assigned", "message"),
    [
        ({"mass": "heavy"}, r"cars\.xosc:8: .*'/' needs a number, not 'heavy'"),
        ({"mass": "$nothing"}, r"no parameter 'nothing'"),
    ],
)
def test_wrong_assignments_are_refused_where_they_stand(scenario, catalog, assigned, message):
    catalog("vehicle/cars.xosc", CAR, name="Cars")
    with pytest.raises(InvalidFile, match=message):
        resolved(scenario(locations=LOCATIONS, entities=ego(**assigned)))


def test_two_assignments_of_one_parameter_are_refused(scenario, catalog):
    catalog("vehicle/cars.xosc", CAR, name="Cars")
    entities = ego(mass=1, half=2).replace('"half"', '"mass"')
    with pytest.raises(InvalidFile, match="assigned twice"):
        resolved(scenario(locations=LOCATIONS, entities=entities))


def test_constraints_of_an_entry_hold_for_assigned_values(scenario, catalog):
    group = '<ConstraintGroup><ValueConstraint rule="lessThan" value="2000"/></ConstraintGroup>'
    catalog(
        "vehicle/cars.xosc",
        CAR.replace('value="1500"/>', f'value="1500">{group}</ParameterDeclaration>'),
        name="Cars",
    )
    path = scenario(locations=LOCATIONS, entities=ego(mass=2500))
    with pytest.raises(InvalidFile, match=r"cars\.xosc:7: .*mass = 2500 violates"):
        resolved(path)
    assert xosc.resolve(xosc.load(path), enforce_constraints=False)


@pytest.mark.parametrize(
    ("minor", "open_to_the_scenario"), [(0, True), (1, True), (2, False), (3, False)]
)
def test_entries_see_the_scenario_only_in_catalogues_before_1_2(
    scenario, catalog, minor, open_to_the_scenario
):
    file = catalog("vehicle/cars.xosc", '<Vehicle name="car" mass="$m"/>', name="Cars", minor=minor)
    declared = '<ParameterDeclaration name="m" parameterType="double" value="1000"/>'
    path = scenario(locations=LOCATIONS, parameters=declared, entities=ego())
    if open_to_the_scenario:
        assert resolved(path).need("Entities", "ScenarioObject", "Vehicle").get("mass") == "1000"
    else:
        with pytest.raises(InvalidFile, match="there is no parameter 'm'") as caught:
            resolved(path)
        assert caught.value.path == str(file)


def test_entries_may_refer_to_further_entries(scenario, catalog):
    catalog("trajectory/t.xosc", '<Trajectory name="t" closed="${not true}"/>', name="T")
    follow = f"<Event><FollowTrajectoryAction><TrajectoryRef>{reference('T', 't')}</TrajectoryRef></FollowTrajectoryAction></Event>"
    catalog("maneuver/m.xosc", f'<Maneuver name="m">{follow}</Maneuver>', name="M")
    root = resolved(
        scenario(
            locations=LOCATIONS, storyboard=f"<ManeuverGroup>{reference('M', 'm')}</ManeuverGroup>"
        )
    )
    trajectory = root.need("Storyboard", "ManeuverGroup", "Maneuver", "Event").need(
        "FollowTrajectoryAction", "TrajectoryRef", "Trajectory"
    )
    assert trajectory.get("closed") == "false"
    assert trajectory.path.name == "t.xosc"


def truck(name, trailer):
    return (
        f'<Vehicle name="{name}"><Trailer><Trailer '
        f'name="t">{reference("Cars", trailer)}</Trailer></Trailer></Vehicle>'
    )


def test_entries_that_refer_to_each_other_in_a_circle_are_refused(scenario, catalog):
    catalog("vehicle/cars.xosc", truck("a", "b") + truck("b", "a"), name="Cars")
    with pytest.raises(
        InvalidFile, match=r"in a circle: Vehicle 'a' .* → Vehicle 'b' .* → Vehicle 'a'"
    ):
        resolved(scenario(locations=LOCATIONS, entities=ego("Cars", "a")))


def test_deep_nesting_is_refused(scenario, catalog):
    chain = "".join(truck(f"v{i}", f"v{i + 1}") for i in range(MAX_NESTING + 300)) + truck(
        f"v{MAX_NESTING + 300}", "none"
    )
    catalog("vehicle/cars.xosc", chain, name="Cars")
    with pytest.raises(InvalidFile, match=f"deeper than {MAX_NESTING} levels"):
        resolved(scenario(locations=LOCATIONS, entities=ego("Cars", "v0")))


def test_exponential_growth_is_refused(scenario, catalog, monkeypatch):
    monkeypatch.setattr(import_module("xosc.resolve"), "MAX_INLINED", 1000)
    parts = (f"<Trailer>{2 * reference('Cars', f'v{i + 1}')}</Trailer>" for i in range(30))
    doubling = (
        "".join(f'<Vehicle name="v{i}">{part}</Vehicle>' for i, part in enumerate(parts))
        + '<Vehicle name="v30"/>'
    )
    catalog("vehicle/cars.xosc", doubling, name="Cars")
    with pytest.raises(InvalidFile, match="more than 1000 elements"):
        resolved(scenario(locations=LOCATIONS, entities=ego("Cars", "v0")))


def test_a_missing_directory_matters_only_when_it_is_needed(scenario, catalog):
    catalog("vehicle/cars.xosc", CAR, name="Cars")
    path = scenario(locations=LOCATIONS, entities=ego())
    assert resolved(path)
    path = scenario(
        locations=LOCATIONS, storyboard=f"<RouteRef>{reference('Routes', 'r')}</RouteRef>"
    )
    with pytest.raises(
        InvalidFile, match=r"no catalogue 'Routes'; the directory \S+route .* does not exist"
    ):
        resolved(path)


def test_a_moved_directory_is_found_by_its_name(scenario, catalog):
    catalog("library/vehicle/cars.xosc", CAR, name="Cars")
    path = scenario(locations=LOCATIONS.replace("vehicle", "../elsewhere/vehicle"), entities=ego())
    assert resolved(path).find("Entities", "ScenarioObject", "Vehicle")


def test_a_directory_is_found_by_its_path_in_the_folders_above(scenario, catalog, tmp_path):
    catalog("resources/vehicle/cars.xosc", CAR, name="Cars")
    moved = tmp_path / "scenarios" / "urban" / "moved.xosc"
    moved.parent.mkdir(parents=True)
    locations = '<VehicleCatalog><Directory path="../resources/vehicle"/></VehicleCatalog>'
    moved.write_bytes(scenario(locations=locations, entities=ego()).read_bytes())
    found = xosc.resolve(xosc.load(moved))
    assert found.node.need("Entities", "ScenarioObject", "Vehicle").get("name") == "car"
    (remark,) = [each for each in found.remarks if "catalogs_referenced_by_directory" in each.rule]
    assert str(tmp_path / "resources" / "vehicle") in remark.message


def test_a_location_may_be_a_file(scenario, catalog):
    catalog("vehicle/cars.xosc", CAR, name="Cars")
    path = scenario(locations=LOCATIONS.replace('"vehicle"', '"vehicle/cars.xosc"'), entities=ego())
    assert resolved(path).find("Entities", "ScenarioObject", "Vehicle")


def test_a_catalogue_is_known_by_its_name_and_only_then_by_its_file(scenario, catalog):
    catalog("vehicle/Cars.xosc", '<Vehicle name="car" mass="1"/>', name="Other")
    path = scenario(locations=LOCATIONS, entities=ego())
    assert resolved(path).need("Entities", "ScenarioObject", "Vehicle").get("mass") == "1"
    catalog("vehicle/x.xosc", '<Vehicle name="car" mass="2"/>', name="Cars")
    assert resolved(path).need("Entities", "ScenarioObject", "Vehicle").get("mass") == "2"


def test_one_name_may_be_spread_over_files_but_an_entry_must_be_unique(scenario, catalog):
    catalog("vehicle/a.xosc", CAR, name="Cars")
    catalog("vehicle/b.xosc", '<Vehicle name="van"/>', name="Cars")
    path = scenario(locations=LOCATIONS, entities=ego() + ego("Cars", "van"))
    assert len(list(resolved(path).iter("Vehicle"))) == 2
    catalog("vehicle/c.xosc", '<Vehicle name="car" mass="7"/>', name="Cars")
    with pytest.raises(
        InvalidFile, match=r"more than one entry is meant: .*a\.xosc:5\) and .*c\.xosc:4"
    ):
        resolved(path)


def test_unknown_names_are_answered_with_the_nearest(scenario, catalog):
    catalog("vehicle/cars.xosc", CAR, name="Cars")
    catalog("vehicle/broken.xosc", "").write_text("<broken")
    with pytest.raises(
        InvalidFile,
        match=r"no catalogue 'Carts', did you mean 'Cars'\?;.* not readable: \S+broken\.xosc:1",
    ):
        resolved(scenario(locations=LOCATIONS, entities=ego("Carts")))
    with pytest.raises(
        InvalidFile,
        match=r"'Cars' has no Vehicle or Pedestrian or MiscObject 'cat', did you mean 'car'",
    ):
        resolved(scenario(locations=LOCATIONS, entities=ego("Cars", "cat")))


def test_an_entry_of_another_kind_is_not_the_entry(scenario, catalog):
    catalog("vehicle/cars.xosc", CAR, name="Cars")
    path = scenario(
        locations=LOCATIONS.replace("controller", "vehicle"),
        storyboard=f"<ObjectController>{reference()}</ObjectController>",
    )
    document = xosc.resolve(xosc.load(path))
    assert [
        node.tag for node in document.node.need("Storyboard", "ObjectController").children()
    ] == ["Controller"]
    assert any(
        "has no Controller 'car', there are none" in remark.message for remark in document.remarks
    )


@pytest.mark.parametrize(
    ("locations", "body", "message"),
    [
        (
            "",
            ego(),
            "CatalogLocations has no VehicleCatalog or PedestrianCatalog or MiscObjectCatalog",
        ),
        (
            LOCATIONS,
            f"<Entities>{reference()}</Entities>",
            "no catalogue entry can stand in Entities",
        ),
        (LOCATIONS, ego().replace("</C", f"{reference()}</C"), "can stand in CatalogReference"),
        (
            LOCATIONS,
            '<ScenarioObject><CatalogReference entryName="car"/></ScenarioObject>',
            "'catalogName' is missing",
        ),
        ("<VehicleCatalog/>", ego(), "Directory is missing"),
        ("<VehicleCatalog><Directory/></VehicleCatalog>", ego(), "'path' is missing"),
        (
            f'<VehicleCatalog><Directory path="{"x" * 5000}"/></VehicleCatalog>',
            ego(),
            "can't be read",
        ),
    ],
)
def test_malformed_references_are_refused(scenario, catalog, locations, body, message):
    catalog("vehicle/cars.xosc", CAR, name="Cars")
    with pytest.raises(InvalidFile, match=message):
        resolved(scenario(locations=locations, entities=body))


def test_a_changed_catalogue_is_read_again(scenario, catalog):
    path = scenario(locations=LOCATIONS, entities=ego())
    catalog("vehicle/cars.xosc", '<Vehicle name="car" mass="1"/>', name="Cars")
    assert resolved(path).need("Entities", "ScenarioObject", "Vehicle").get("mass") == "1"
    catalog("vehicle/cars.xosc", '<Vehicle name="car" mass="20"/>', name="Cars")
    assert resolved(path).need("Entities", "ScenarioObject", "Vehicle").get("mass") == "20"
