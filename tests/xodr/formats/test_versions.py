"""OpenDRIVE files in other versions: valid there, with the same roads, and
refused where the roads would be others.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from lxml import etree

import xodr
from schemas.common.errors import ToolchainError, Unsupported, UsageError
from schemas.validate import brief_violations
from schemas.versions.registry import OPENDRIVE, Schema, schema_for
from xodr.formats.maps import files as maps
from xodr.formats.maps.editing.changes import CHANGES, VERSIONS, Version
from xodr.formats.maps.editing.versions import in_version, name_of, version_of

LIBRARY = Path(xodr.__file__).parent / "library"
SHARED = Path(__file__).parents[4] / "shared"
_OFFICIAL = SHARED / "standards" / "opendrive-schemas"
_OLD = {
    (1, 4): _OFFICIAL / "1.4" / "OpenDRIVE_1.4H.xsd",
    (1, 5): _OFFICIAL / "1.5" / "OpenDRIVE_1.5M.xsd",
    (1, 6): _OFFICIAL / "1.6.1" / "opendrive_16_core.xsd",
}

RICH = """<OpenDRIVE xmlns="http://code.asam.net/simulation/standard/opendrive_schema">
<header revMajor="1" revMinor="9" version="1"><license name="MIT" spdxid="MIT"/></header>
<road id="1" length="100" junction="-1" rule="RHT">
<type s="0" type="townArterial" country="DEU"><speed max="50" unit="km/h"/></type>
<planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView>
<elevationProfile/>
<lanes layer="permanent"><laneSection s="0">
<left>
<lane id="2" type="walking"><width sOffset="0" a="2" b="0" c="0" d="0"/></lane>
<lane id="1" type="driving" direction="both"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane>
</left>
<center><lane id="0" type="none"><roadMark sOffset="0" type="edge" color="violet">
<type name="edge" width="0.1"><line length="1" space="0" tOffset="0" sOffset="0" width="0.1" color="black"/></type>
</roadMark></lane></center>
<right>
<lane id="-1" type="bus" direction="standard" advisory="none"><width sOffset="0" a="3" b="0" c="0" d="0"/>
<access sOffset="5" rule="allow"><restriction type="bus"/><restriction type="HOV"/></access>
<access sOffset="20" rule="deny"><restriction type="pedestrian"/><restriction type="autonomousTraffic"/></access>
</lane>
<lane id="-2" type="slipLane" roadWorks="true"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane>
</right>
</laneSection></lanes>
<objects>
<object id="1" s="10" t="6" zOffset="0" type="roadSurface" length="0" temporary="true"><outlines>
<outline id="0" fillType="paint" laneType="walking">
<cornerLocal u="0" v="0" z="0" height="1" id="0"/><cornerLocal u="1" v="0" z="0" height="1" id="1"/>
<cornerLocal u="1" v="1" z="0" height="1" id="2"/></outline>
</outlines><borders><border outlineId="0" type="paint" width="0.1" useCompleteOutline="true"/></borders></object>
<object id="2" s="20" t="6" zOffset="0" type="pole" radius="0.1" height="3" invalidated="true"/>
</objects>
<signals><signal id="s" s="50" t="-7" zOffset="2" dynamic="no" orientation="+" type="274" subtype="-1" country="DEU" length="0.1">
<semantics><speed type="maximum" unit="km/h" value="50"/></semantics></signal></signals>
</road></OpenDRIVE>"""


def schema_of(version: Version) -> Schema:
    """The XSD of a version: an installed one, or the official one beside the checkout."""
    schema = schema_for(OPENDRIVE, version)
    if schema is not None:
        return schema
    if not _OLD[version].exists():
        pytest.skip(f"no XSD of OpenDRIVE {name_of(version)} here")
    return Schema(OPENDRIVE, (*version, 0), _OLD[version])


def faults(content: bytes, version: Version) -> list[str]:
    root = etree.fromstring(content)
    for element in root.iter("{*}*"):
        element.tag = etree.QName(element).localname
    return [each.message for each in brief_violations(root.getroottree(), schema_of(version))]


def rich(tmp_path: Path, *changes: tuple[str, str]) -> Path:
    text = RICH
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "rich.xodr"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("version", VERSIONS, ids=name_of)
def test_a_road_of_all_versions_is_valid_in_each(version: Version, tmp_path: Path) -> None:
    source = rich(tmp_path)
    content, notes = in_version(source, version)
    assert not faults(content, version)
    made = tmp_path / "made.xodr"
    made.write_bytes(content)
    network = xodr.load(made, strict=True)
    assert network.header.version == version
    assert list(network.roads["1"].sections[0].lanes) == [0, 1, 2, -1, -2]
    assert maps.compare(source, made).borders.largest < 1e-9
    assert notes
    _, again = in_version(made, version)
    assert not again


def test_what_is_left_out_is_named_with_its_place_and_number(tmp_path: Path) -> None:
    _, notes = in_version(rich(tmp_path), (1, 7))
    for note in (
        "rich.xodr:9: lane: the type walking is written as sidewalk, the nearest of this version",
        "rich.xodr:29: object: what is not in force is left out",
        "rich.xodr:17: access (and 1 more): it is written once for each restriction",
        "rich.xodr:17: access: left out: this version has no restriction of HOV",
        "rich.xodr:31: signal: length left out: no motion depends on it",
    ):
        assert note in notes


def test_restrictions_of_a_lane_stay_in_order(tmp_path: Path) -> None:
    content, _ = in_version(rich(tmp_path), (1, 7))
    found = etree.fromstring(content).findall(".//lane[@id='-1']/access")
    assert [(each.get("sOffset"), each.get("restriction")) for each in found] == [
        ("5", "bus"), ("20", "pedestrian"), ("20", "autonomousTraffic"),
    ]  # fmt: skip
    oldest, _ = in_version(rich(tmp_path), (1, 4))
    left = etree.fromstring(oldest).findall(".//access")
    assert [each.get("restriction") for each in left] == ["pedestrian", "autonomous traffic"]


@pytest.mark.parametrize(
    ("version", "change", "reason"),
    [
        ((1, 7), ('direction="both"', 'direction="reversed"'),
            "has no lanes whose traffic is reversed"),
        ((1, 4), ('rule="RHT"', 'rule="LHT"'), "has no left-hand traffic"),
        ((1, 8), ('layer="permanent"', 'layer="temporary"'), "has no temporary lanes"),
        ((1, 4), ("</header>", ('<offset x="5" y="0" z="0" '
                               'hdg="0"/></header>')), "place --without-offset"),
        (
            (1, 6),
            ("<elevationProfile/>", ('<lateralProfile><crossfall s="0" a="0.1" b="0" c="0" '
                                    'd="0"/></lateralProfile>')),
            "has no crossfall",
        ),
    ],
    ids=["reversed", "left-hand", "temporary", "offset", "crossfall"],
)  # fmt: skip
def test_what_would_change_roads_or_traffic_is_refused_by_line(
    version: Version, change: tuple[str, str], reason: str, tmp_path: Path
) -> None:
    path = rich(tmp_path, change)
    if "temporary" in change[1]:  # a road needs permanent lanes, too
        text = path.read_text()
        start, end = text.index("<lanes"), text.index("</lanes>") + len("</lanes>")
        lanes = text[start:end]
        path.write_text(text[:start] + lanes.replace("temporary", "permanent") + text[start:])
    with pytest.raises(Unsupported, match=reason) as raised:
        in_version(path, version)
    assert raised.value.path == str(path)
    assert raised.value.line


@pytest.mark.parametrize("version", VERSIONS, ids=name_of)
def test_roads_of_the_library_are_valid_in_all_versions(version: Version, tmp_path: Path) -> None:
    names = ("highway_on_ramp", "roundabout", "intersection_four_way")
    for name in names:
        content, _ = in_version(LIBRARY / f"{name}.xodr", version)
        assert not faults(content, version)


def test_conversion_takes_a_revision(tmp_path: Path) -> None:
    source, target = LIBRARY / "sharp_curve.xodr", tmp_path / "curve.xodr"
    made = maps.convert(source, target, revision="1.4")
    assert made.difference.borders.largest < 1e-9
    assert xodr.load(target).header.version == (1, 4)
    through = maps.convert(target, tmp_path / "curve.osm")
    assert through.difference.borders.largest < 0.05
    maps.convert(tmp_path / "curve.osm", tmp_path / "back.xodr", revision="1.5")
    assert xodr.load(tmp_path / "back.xodr").header.version == (1, 5)


@pytest.mark.parametrize(
    ("target", "revision", "message"),
    [
        ("a.xodr", "2.0", "OpenDRIVE '2.0' is not written, only 1.4, 1.5, 1.6, 1.7, 1.8, 1.9"),
        ("a.xodr", None, "source and target are both opendrive; state the revision to write"),
        ("a.osm", "1.7", "a revision is for OpenDRIVE; this is lanelet2"),
    ],
)
def test_a_revision_without_meaning_is_refused(
    target: str, revision: str | None, message: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=message):
        maps.convert(LIBRARY / "sharp_curve.xodr", tmp_path / target, revision=revision)
    assert not list(tmp_path.iterdir())


def test_each_change_is_for_some_versions_only() -> None:
    for change in CHANGES:
        assert 0 < len(change.lacking) < len(VERSIONS)
        assert set(change.lacking) <= set(VERSIONS)
    assert version_of("1.8") == (1, 8)


@pytest.mark.skipif(not SHARED.exists(), reason="no public roads beside the checkout")
@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS[:4], ids=name_of)
def test_valid_public_roads_are_valid_in_other_versions(version: Version) -> None:
    """Few are not: ids used twice, values that one XSD alone knows, more
    attributes that 1.5 alone asks for.
    """
    schema, valid, made = schema_of(version), 0, 0
    for folder in ("corpora", "wild"):
        for path in sorted((SHARED / folder).rglob("*.xodr")):
            if path.stat().st_size > 1_200_000:
                continue
            try:
                own = version_of(name_of(xodr.load(path).header.version))
                if own not in VERSIONS[:4] or faults(path.read_bytes(), own):
                    continue
                content, _ = in_version(path, version)
            except ToolchainError:
                continue
            made += 1
            valid += not brief_violations(etree.fromstring(content).getroottree(), schema)
    assert made > 80
    assert valid > (0.8 if version == (1, 5) else 0.9) * made
