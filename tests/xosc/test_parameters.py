"""Parameters of a scenario: values, scopes, constraints, variables and monitors."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import xosc
from schemas.common.errors import InvalidFile, ToolchainError, UsageError


def parameter(name, value, kind="double", *groups):
    constraints = ""
    for group in groups:
        limits = [f'<ValueConstraint rule="{rule}" value="{limit}"/>' for rule, limit in group]
        constraints += f"<ConstraintGroup>{''.join(limits)}</ConstraintGroup>"
    return (
        f'<ParameterDeclaration name="{name}" parameterType="{kind}" '
        f'value="{value}">{constraints}</ParameterDeclaration>'
    )


def resolved(path, given=None, **options):
    return xosc.resolve(xosc.load(path), given, **options)


def test_references_and_expressions_become_literals(scenario):
    path = scenario(
        parameters=parameter("v", "60.0")
        + parameter("on", "true", "boolean")
        + parameter("n", "3", "integer"),
        storyboard='<a speed="$v" ms="${$v / 3.6}" on="$on" off="${not $on}" lane="${$n - 1}" '
        'text="costs $v"/>',
    )
    attributes = dict(resolved(path).node.need("Storyboard", "a").element.attrib)
    assert float(attributes.pop("ms")) == pytest.approx(60 / 3.6)
    assert attributes == {
        "speed": "60.0",
        "on": "true",
        "off": "false",
        "lane": "2",
        "text": "costs $v",
    }


def test_parameters_have_types_and_values(scenario):
    path = scenario(
        parameters=parameter("v", " 60.0 ")
        + parameter("n", "3.0", "integer")
        + parameter("s", "x", "string")
    )
    parameters = resolved(path).parameters
    assert [(p.type, p.value, p.text) for p in parameters.values()] == [
        ("double", 60.0, "60.0"),
        ("int", 3, "3"),
        ("string", "x", "x"),
    ]


def test_the_document_is_not_changed(scenario):
    document = xosc.load(scenario(parameters=parameter("v", "${1+1}"), storyboard='<a b="$v"/>'))
    xosc.resolve(document)
    assert document.node.need("Storyboard", "a").get("b") == "$v"


def test_defaults_may_depend_on_parameters_in_any_order(scenario):
    path = scenario(
        parameters=parameter("c", "${$b * 2}") + parameter("a", "1") + parameter("b", "${$a + 1}")
    )
    assert resolved(path).parameters["c"].value == 4
    assert resolved(path, {"a": 2}).parameters["c"].value == 6
    assert list(resolved(path).parameters) == ["c", "a", "b"]


def test_a_long_chain_of_parameters_is_no_problem(scenario):
    chain = "".join(parameter(f"p{i}", f"${{$p{i + 1} + 1}}") for i in range(2000)) + parameter(
        "p2000", "0"
    )
    assert resolved(scenario(parameters=chain)).parameters["p0"].value == 2000


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (True, "true"),
        (2, "2"),
        (2.5, "2.5"),
        ("${5 / 2}", "2.5"),
        (float("inf"), "INF"),
        (" 7 ", "7"),
    ],
)
def test_given_values_replace_defaults(scenario, value, text):
    kind = "boolean" if value is True else "double"
    path = scenario(parameters=parameter("p", "0", kind), storyboard='<a b="$p"/>')
    assert resolved(path, {"p": value}).node.need("Storyboard", "a").get("b") == text


def test_a_bad_default_does_not_matter_where_a_value_is_given(scenario):
    path = scenario(parameters=parameter("p", "nonsense"))
    assert resolved(path, {"p": 1}).parameters["p"].value == 1


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"sped": 1}, "no parameter 'sped' to assign; did you mean 'speed'"),
        ({"zzz": 1}, "there are: speed"),
        ({"speed": "fast"}, "speed: 'fast' is not a number"),
        ({"speed": float("nan")}, "'nan' is not a number"),
        ({"speed": "$unknown"}, "no parameter 'unknown'"),
        ({"speed": "${1/0}"}, "divides by zero"),
    ],
)
def test_wrong_given_values_are_usage_errors(scenario, given, message):
    with pytest.raises(UsageError, match=message):
        resolved(scenario(parameters=parameter("speed", "1")), given)


@pytest.mark.parametrize(
    ("declarations", "message"),
    [
        (
            parameter("a", "$b") + parameter("b", "${$c}") + parameter("c", "$a"),
            "depends on itself: a → b → c → a",
        ),
        (parameter("a", "$a"), "a → a"),
        (parameter("a", "1", "decimal"), "'decimal' is not a type"),
        (parameter("a$b", "1"), "without '\\$'"),
        (parameter("a", "${1 +}"), "a value is expected"),
        (parameter("a", "$b"), "no parameter 'b'"),
        ('<ParameterDeclaration parameterType="double" value="1"/>', "'name' is missing"),
        ('<ParameterDeclaration name="a" parameterType="double"/>', "'value' is missing"),
    ],
)
def test_wrong_declarations_are_refused_with_their_line(scenario, declarations, message):
    with pytest.raises(InvalidFile, match=message) as caught:
        resolved(scenario(parameters=declarations))
    assert caught.value.line == 4


def test_the_same_declaration_twice_is_one(scenario):
    path = scenario(parameters=2 * parameter("a", "${1+1}"))
    assert [
        node.get("value") for node in resolved(path).node.need("ParameterDeclarations").children()
    ] == ["2", "2"]


def test_unknown_parameters_are_refused_where_they_are_used(scenario):
    with pytest.raises(
        InvalidFile, match=r"scenario\.xosc:9: a: b='\$x': there is no parameter 'x'"
    ):
        resolved(scenario(storyboard='<a b="$x"/>'))


def test_names_are_texts_and_parameter_references_are_names(scenario):
    path = scenario(
        parameters=parameter("x", "1"),
        storyboard='<a name="${free + text}"/><b parameterRef="$x"/><c name="$x"/>',
    )
    board = resolved(path).node.need("Storyboard")
    names = [next(iter(node.element.attrib.values())) for node in board.children("a", "b", "c")]
    assert names == ["${free + text}", "x", "1"]


def test_an_inner_declaration_hides_an_outer_one_inside_its_element_only(scenario):
    inner = f"<ParameterDeclarations>{parameter('p', '2')}{parameter('q', '${$p + $r}')}</ParameterDeclarations>"
    path = scenario(
        parameters=parameter("p", "1") + parameter("r", "10"),
        storyboard=f'<Story name="s"><Act name="$p"/><Act name="$q"/>{inner}</Story><Story name="t"><Act '
        'name="$p"/></Story>',
    )
    first, second = resolved(path, {"r": 20}).node.need("Storyboard").children("Story")
    assert [act.get("name") for act in first.children("Act")] == ["2", "22"]
    assert second.need("Act").get("name") == "1"
    assert list(resolved(path).parameters) == ["p", "r"]


GROUPS = [
    ([[("greaterThan", "0"), ("lessThan", "10")]], {5: True, 0: False, 10: False}),
    ([[("lessThan", "0")], [("greaterThan", "10")]], {5: False, -1: True, 11: True}),
    ([[("equalTo", "-1")], [("equalTo", "1")]], {1: True, -1: True, 0: False}),
    (
        [[("greaterOrEqual", "$low"), ("lessOrEqual", "${$low + 1}"), ("notEqualTo", "2.5")]],
        {2: True, 3: True, 2.5: False, 4: False},
    ),
]


@pytest.mark.parametrize(("groups", "cases"), GROUPS)
def test_constraints_are_joined_by_and_in_a_group_and_groups_by_or(scenario, groups, cases):
    path = scenario(parameters=parameter("p", "1", "double", *groups) + parameter("low", "2"))
    for value, fine in cases.items():
        if fine:
            assert resolved(path, {"p": value}).parameters["p"].value == value
        else:
            with pytest.raises(InvalidFile, match=f"p = {value} violates its constraint"):
                resolved(path, {"p": value})


def test_a_violation_names_parameter_value_constraint_and_place(scenario):
    path = scenario(
        parameters=parameter(
            "ttc",
            "2",
            "double",
            [("greaterThan", "2.5")],
            [("lessThan", "0"), ("notEqualTo", "-1")],
        )
    )
    with pytest.raises(InvalidFile) as caught:
        resolved(path)
    assert str(caught.value).endswith(
        "scenario.xosc:4: ParameterDeclaration: the parameter ttc = 2 violates its constraint: "
        "(greaterThan 2.5) or (lessThan 0 and notEqualTo -1)"
    )
    assert resolved(path, enforce_constraints=False).parameters["ttc"].value == 2


@pytest.mark.parametrize(
    ("kind", "value", "rule", "limit", "message"),
    [
        ("string", "b", "equalTo", "a", "violates"),
        ("string", "b", "lessThan", "a", "no meaning for the text"),
        ("boolean", "true", "equalTo", "false", "violates"),
        ("boolean", "true", "lessThan", "false", "no meaning for booleans"),
        ("dateTime", "2024-05-31T12:00:00Z", "lessThan", "2024-05-31T12:00:00Z", "violates"),
        ("double", "1", "lessThan", "x", "'x' is not a number"),
        ("double", "1", "below", "2", "'below' is not a rule"),
        ("int", "1", "lessThan", "$no", "no parameter 'no'"),
    ],
)
def test_constraints_of_every_type(scenario, kind, value, rule, limit, message):
    with pytest.raises(InvalidFile, match=message):
        resolved(scenario(parameters=parameter("p", value, kind, [(rule, limit)])))


def test_variables_and_monitors(scenario):
    declarations = """<VariableDeclarations><VariableDeclaration name="v" variableType="int" value="$n"/></VariableDeclarations>
        <MonitorDeclarations><MonitorDeclaration name="m" value="true"/></MonitorDeclarations>"""
    result = resolved(scenario(parameters=parameter("n", "4", "int"), declarations=declarations))
    assert (result.variables["v"].type, result.variables["v"].value) == ("int", 4)
    assert result.monitors == {"m": True}
    with pytest.raises(InvalidFile, match="the variable v: 'x' is not a number"):
        resolved(scenario(declarations=declarations.replace("$n", "x")))


def test_road_files_are_relative_to_the_scenario(scenario):
    road = '<LogicFile filepath="$road"/><SceneGraphFile filepath="..\\models\\a.osgb"/>'
    path = scenario(parameters=parameter("road", "./roads/a.xodr", "string"), road=road)
    result = resolved(path)
    assert result.logic_file == path.parent / "roads/a.xodr"
    assert result.scene_graph_file == path.parent / "../models/a.osgb"
    assert resolved(scenario(road='<LogicFile filepath=""/>')).logic_file is None


values = st.one_of(
    st.text(alphabet="$ab{}()+-*/1.5e ,", max_size=12),
    st.sampled_from(
        ["$a", "$b", "${$a}", "${$b+1}", "1", "true", "INF", "NaN", "${1e308*10}", "$" * 50]
    ),
)


@settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=150, deadline=None
)
@given(
    first=values,
    second=values,
    given=values,
    kind=st.sampled_from(["double", "int", "boolean", "string", "dateTime"]),
)
def test_any_text_is_resolved_for_good_or_refused(scenario, first, second, given, kind):
    path = scenario(
        parameters=parameter("a", first, kind) + parameter("b", second, kind),
        storyboard='<x y="$a" z="${$b}"/>',
    )
    try:
        result = resolved(path, {"a": given})
    except ToolchainError as error:
        assert "\n" not in str(error)
        return
    node = result.node.need("Storyboard", "x")
    assert node.get("y") == result.parameters["a"].text


def test_violations_that_are_not_enforced_are_recorded(tmp_path: Path) -> None:
    path = tmp_path / "limited.xosc"
    path.write_text(
        """<?xml version="1.0" encoding="UTF-8"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" description="limited" author="test"/>
  <ParameterDeclarations>
    <ParameterDeclaration name="Speed" parameterType="double" value="70">
      <ConstraintGroup>
        <ValueConstraint rule="lessOrEqual" value="60"/>
      </ConstraintGroup>
    </ParameterDeclaration>
  </ParameterDeclarations>
  <CatalogLocations/>
  <RoadNetwork/>
  <Entities/>
  <Storyboard>
    <Init>
      <Actions/>
    </Init>
    <StopTrigger/>
  </Storyboard>
</OpenSCENARIO>
""",
        encoding="utf-8",
    )
    document = xosc.load(path)
    (violation,) = xosc.resolve(document, enforce_constraints=False).violations
    assert "Speed = 70" in str(violation)
    assert violation.line == 5
    assert xosc.resolve(document, {"Speed": 50}, enforce_constraints=False).violations == ()


def test_a_constraint_without_a_meaning_is_refused_where_another_group_holds_already(scenario):
    groups = [("lessThan", "2")], [("below", "2")]
    with pytest.raises(InvalidFile, match="'below' is not a rule"):
        resolved(scenario(parameters=parameter("p", "1", "double", *groups)))
