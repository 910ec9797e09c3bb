"""Tags: what is written as OpenLABEL and as properties, and read back."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import xosc
from schemas import check
from schemas.common.errors import InvalidFile, Unsupported, UsageError
from xosc.writing import maneuvers as m
from xosc.writing import tags
from xosc.writing.tags import ASAM, OWN, Tag

TAGS = [
    Tag("MotionCutIn", None, ASAM),
    Tag("scenarioName", "one", ASAM),
    Tag("Confidence", 0.75),
    Tag("Known", True),
    Tag("Classes", ("a", "b")),
]


def scenario(path: Path, **properties: str) -> xosc.Document:
    header = m.FileHeader("a test", "a tester", datetime(2000, 1, 1), properties)
    document = m.scenario(
        path, header, road="road.xodr", entities={"Ego": m.vehicle("car", 4, 2, 1.5)}, init={}
    )
    xosc.write(document, path)
    return xosc.load(path)


def held(document: xosc.Document) -> dict[str | None, str | None]:
    return {
        each.get("name"): each.get("value")
        for each in document.root.iterfind("FileHeader/Properties/Property")
    }


def test_openlabel_has_ontologies_types_and_typed_values() -> None:
    content = tags.openlabel(TAGS, "one.xosc", "me")["openlabel"]
    assert content["metadata"] == {
        "schema_version": "1.0.0",
        "tagged_file": "one.xosc",
        "annotator": "me",
    }
    assert content["ontologies"] == {"0": {"uri": ASAM}, "1": {"uri": OWN}}
    by_type = {each["type"]: each for each in content["tags"].values()}
    assert by_type["MotionCutIn"] == {"type": "MotionCutIn", "ontology_uid": "0"}
    assert by_type["Confidence"]["tag_data"] == {"num": [{"type": "value", "val": 0.75}]}
    assert by_type["Known"]["tag_data"] == {"boolean": [{"type": "value", "val": True}]}
    assert by_type["scenarioName"]["tag_data"] == {"text": [{"type": "value", "val": "one"}]}
    assert by_type["Classes"]["tag_data"] == {"vec": [{"type": "values", "val": ["a", "b"]}]}


def test_the_order_of_tags_does_not_matter() -> None:
    assert tags.to_bytes(TAGS, "f", "me") == tags.to_bytes(TAGS[::-1], "f", "me")


def test_a_type_can_be_used_once() -> None:
    with pytest.raises(UsageError, match="the tag Confidence is there twice"):
        tags.openlabel([*TAGS, Tag("Confidence", 0.5)], "f", "me")


VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(),
    st.lists(st.text(), min_size=1).map(tuple),
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.dictionaries(
        st.text(min_size=1), st.tuples(VALUES, st.sampled_from([ASAM, OWN])), max_size=5
    )
)
def test_what_is_written_is_read_back(tmp_path: Path, content: dict) -> None:
    listed = [Tag(name, *rest) for name, rest in content.items()]
    path = tmp_path / "tags.json"
    path.write_bytes(tags.to_bytes(listed, "f", "me"))
    assert {tag.type: tag for tag in tags.read(path)} == {tag.type: tag for tag in listed}


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        "[]",
        '{"openlabel": {"tags": {"0": {"type": "A"}}}}',
        '{"openlabel": {"tags": {"0": 3}}}',
        "[" * 10_000,
    ],
)
def test_what_is_no_openlabel_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "tags.json").write_text(text)
    with pytest.raises(InvalidFile, match=r"tags.json: not readable as OpenLABEL"):
        tags.read(tmp_path / "tags.json")


def test_properties_are_renewed_and_others_stay(tmp_path: Path) -> None:
    document = scenario(tmp_path / "one.xosc", mine="stays", **{"openlabel.Old": "goes"})
    before = (tmp_path / "one.xosc").read_bytes()
    annotated = tags.annotated(document, TAGS)
    expected = {
        "MotionCutIn": "true",
        "scenarioName": "one",
        "Classes": "a; b",
        "Confidence": "0.75",
        "Known": "true",
    }
    assert held(annotated) == {f"openlabel.{name}": value for name, value in expected.items()} | {
        "mine": "stays"
    }
    assert held(tags.annotated(annotated, TAGS[:1])) == {
        "openlabel.MotionCutIn": "true",
        "mine": "stays",
    }
    assert held(document) == {"openlabel.Old": "goes", "mine": "stays"}, (
        "documents are shared: the original is left alone"
    )
    (tmp_path / "road.xodr").write_bytes(
        (Path(xosc.__file__).parents[1] / "xodr/library/highway_straight.xodr").read_bytes()
    )
    xosc.write(annotated, tmp_path / "two.xosc")
    assert not [problem for problem in check(tmp_path / "two.xosc") if problem.level == "error"]
    assert (tmp_path / "one.xosc").read_bytes() == before


def test_a_licence_in_the_header_stays(tmp_path: Path) -> None:
    library = Path(xosc.__file__).parent / "library" / "simple_cut_in.xosc"
    header = tags.annotated(xosc.load(library), TAGS).root.find("FileHeader")
    assert header is not None and [child.tag for child in header] == ["License", "Properties"]


@pytest.mark.parametrize("version", [(1, 0), (1, 1)])
def test_versions_without_properties_are_refused(tmp_path: Path, version: tuple[int, int]) -> None:
    with pytest.raises(Unsupported, match=f"OpenSCENARIO 1.{version[1]} has no Properties"):
        tags.annotated(replace(scenario(tmp_path / "old.xosc"), version=version), TAGS)


def test_files_are_json(tmp_path: Path) -> None:
    assert json.loads(tags.to_bytes(TAGS, "f", "me"))["openlabel"]["metadata"]["tagged_file"] == "f"
