"""Checking and loading give one verdict on the values of parameters and
variables, and on catalogue references.
"""

from __future__ import annotations

from itertools import count
from pathlib import Path
from xml.sax.saxutils import quoteattr

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import xosc
from schemas import check
from schemas.common.errors import InvalidFile
from schemas.expressions.values import RULES, TYPES
from tests.xosc.conftest import SCENARIO

ENTRY = "asam.net:xosc:1.0.0:reference_control.catalog_reference_resolvability"
TYPED = "asam.net:xosc:1.0.0:parameters.parameter_declaration_parameter_type_inference"
CONSTRAINED = "xosc.toolchain:xosc:1.1.0:parameters.default_value_obeys_constraints"
ODD = (
    "",
    " ",
    "-5",
    "NaN",
    "nan",
    "1_000",
    "foo",
    "1e400",
    "2.0",
    "2.5",
    "0x1",
    "+7",
    "INF",
    "-INF",
    "True",
    "FALSE",
    "1",
    "2024-05-31T12:00:00",
    "2024-05-31",
    "65536",
    "4294967296",
    " 3 ",
    "1e3",
    "٣",
    "$",
    "a$b",
)

_NUMBERS = count()
texts = st.one_of(
    st.sampled_from(ODD),
    st.integers(-(2**40), 2**40).map(str),
    st.floats(allow_nan=True).map(repr),
    st.datetimes().map(lambda value: value.isoformat()),
    st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs")), max_size=12),
).filter(lambda text: not text.startswith("$") and "\ufffe" not in text and "\uffff" not in text)


def verdict(path: Path, *rules: str) -> tuple[bool, bool]:
    """Whether a check names a fault by one of these rules, and whether loading
    refuses the file when it is strict.

    When it is not, it refuses or repairs what is named, and nothing else.
    """
    named = any(problem.rule in rules and problem.level == "error" for problem in check(path))
    try:
        remarks = {remark.rule for remark in xosc.resolve(xosc.load(path)).remarks}
        assert named == bool(remarks & set(rules)) and remarks <= set(rules)
    except InvalidFile:
        assert named
    try:
        xosc.resolve(xosc.load(path, strict=True), strict=True)
    except InvalidFile:
        return named, True
    return named, False


def write(folder: Path, **parts: str) -> Path:
    empty = dict.fromkeys(("parameters", "declarations", "locations", "road", "entities"), "")
    empty["storyboard"] = "<Init><Actions/></Init><StopTrigger/>"
    path = folder / f"{next(_NUMBERS)}.xosc"
    path.write_text(SCENARIO.format(minor=3, **empty | parts), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("values")


@settings(deadline=None)
@given(st.sampled_from((*TYPES, "integer")), texts)
@example("unsignedInt", "-5")
@example("double", "NaN")
@example("int", "1_000")
@example("dateTime", "foo")
@example("double", "1e400")
@example("int", "2.0")
@example("double", "")
def test_the_value_of_a_parameter(folder, kind, text):
    declaration = f'<ParameterDeclaration name="p" parameterType="{kind}" value={quoteattr(text)}/>'
    named, refused = verdict(write(folder, parameters=declaration), TYPED)
    assert named == refused


@settings(deadline=None)
@given(st.sampled_from(TYPES), texts)
def test_the_initial_value_of_a_variable(folder, kind, text):
    declaration = f'<VariableDeclaration name="v" variableType="{kind}" value={quoteattr(text)}/>'
    named, refused = verdict(
        write(folder, declarations=f"<VariableDeclarations>{declaration}</VariableDeclarations>"),
        TYPED,
    )
    assert named == refused


@settings(deadline=None)
@given(st.sampled_from(TYPES), texts, st.sampled_from(sorted(RULES)), texts)
@example("boolean", "1", "equalTo", "true")
@example("string", "abc", "lessThan", "abd")
def test_the_constraint_of_a_parameter(folder, kind, text, rule, limit):
    constraint = (
        f'<ConstraintGroup><ValueConstraint rule="{rule}" '
        f"value={quoteattr(limit)}/></ConstraintGroup>"
    )
    declaration = (
        f'<ParameterDeclaration name="p" parameterType="{kind}" '
        f"value={quoteattr(text)}>{constraint}</ParameterDeclaration>"
    )
    named, refused = verdict(write(folder, parameters=declaration), TYPED, CONSTRAINED)
    assert named == refused


LOCATION = '<VehicleCatalog><Directory path="{}"/></VehicleCatalog>'
CATALOGS = {  # location element and directory, names of catalogue and entry; whether they are found
    "folder": (LOCATION.format("vehicles"), "Cars", "car", True),
    "file": (LOCATION.format("vehicles/some.xosc"), "Cars", "car", True),
    "moved": (LOCATION.format("../library/vehicles"), "Cars", "car", True),
    "backslash": (LOCATION.format(".\\vehicles"), "Cars", "car", True),
    "named by its file": (LOCATION.format("vehicles"), "some", "car", True),
    "no such catalogue": (LOCATION.format("vehicles"), "Carts", "car", False),
    "no such entry": (LOCATION.format("vehicles"), "Cars", "cart", False),
    "other kind of entry": (LOCATION.format("vehicles"), "Cars", "route", False),
    "other kind of location": (
        LOCATION.format("vehicles").replace("Vehicle", "Route"),
        "Cars",
        "car",
        False,
    ),
    "twice": (LOCATION.format("vehicles"), "Cars", "twin", False),
    "twice the same": (LOCATION.format("vehicles"), "Cars", "clone", True),
}


@pytest.mark.parametrize("case", CATALOGS)
def test_an_entry_of_a_catalogue(scenario, catalog, case):
    locations, name, entry, found = CATALOGS[case]
    catalog(
        "vehicles/some.xosc",
        '<Vehicle name="car"/><Vehicle name="twin"/><Vehicle name="twin" mass="7"/><Route '
        'name="route"/>'
        '<Vehicle name="clone"/><Vehicle name="clone"/>',
        name="Cars",
    )
    reference = f'<CatalogReference catalogName="{name}" entryName="{entry}"/>'
    path = scenario(
        locations=locations, entities=f'<ScenarioObject name="Ego">{reference}</ScenarioObject>'
    )
    assert any(problem.rule == ENTRY and problem.level == "error" for problem in check(path)) == (
        not found
    )
    if found:
        assert xosc.resolve(xosc.load(path)).node.find("Entities", "ScenarioObject", "Vehicle")
    else:
        with pytest.raises(InvalidFile):
            xosc.resolve(xosc.load(path))
