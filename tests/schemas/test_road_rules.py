"""Every rule on lanes, layers, junctions and curves of road networks passes a sound file and
catches its fault, at its line.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

import schemas
from schemas.checks import Problem
from schemas.checks.registry import all_rules

MODULE = "xodr.rules.lanes"
CURVES = (
    "elem_asc_order",
    "length_match",
    "arclength_range",
    "valid_parameters",
    "avoid_redundant_info",
)
TOUCHING = (
    "road.geometry.contact_point",
    "lane_smoothness.contact_point_no_horizontal_gaps",
    "junctions.cross_path.lane_linkage",
)

W = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'
N = '<width sOffset="0" a="3.50" b="0" c="0" d="0"/>'


def _lane(number: int, width: str, before: str, after: str) -> str:
    """A lane on a line of its own; before and after are the layers of the lanes
    of the same id that it links.
    """
    links = "".join(
        f'<{tag} id="{number}" layer="{layer}"/>'
        for tag, layers in (("predecessor", before), ("successor", after))
        for layer in layers.split()
    )
    return f'<lane id="{number}" type="driving" level="false"><link>{links}</link>{width}</lane>\n'


def _section(s: float, width: str, before: str, after: str, length: str = "") -> str:
    lanes = "".join(_lane(number, width, before, after) for number in (-1, -2))
    center = '<center><lane id="0" type="none" level="false"/></center>'
    return f'<laneSection s="{s}"{length}>{center}\n<right>\n{lanes}</right></laneSection>\n'


def _road(
    number: int,
    start: float,
    length: float,
    shape: str,
    lanes: str,
    link: str = "",
    junction: int = -1,
) -> str:
    geometry = f'<geometry s="0" x="{start}" y="0" hdg="0" length="{length}">{shape}</geometry>'
    return (
        f'<road name="" length="{length}" id="{number}" junction="{junction}" '
        f'rule="RHT">\n<link>{link}</link>\n'
        f"<planView>{geometry}\n</planView>\n{lanes}</road>\n"
    )


def _to(tag: str, number: int, contact: str) -> str:
    return f'<{tag} elementType="road" elementId="{number}" contactPoint="{contact}"/>\n'


P, T, LENGTH = "permanent", "temporary", ' length="30"'
CURVE = '<paramPoly3 aU="0" bU="{b}" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0" pRange="{range}"/>'
WORKS = (
    f'<lanes layer="{P}">\n{_section(0, W, "", f"{P} {T}")}{_section(40, W, P, P)}{_section(70, W, f"{P} {T}", P)}</lanes>\n'
    f'<lanes layer="{T}">\n{_section(40, N, P, P, LENGTH)}</lanes>\n'
)
BORDERS = "".join(
    f'<lane id="{number}" type="driving" level="false"><border sOffset="0" a="{t}" b="0" c="0" '
    'd="0"/></lane>\n'
    for number, t in ((-1, -3.5), (-2, -7))
)
SOUND = (
    '<?xml version="1.0"?>\n<OpenDRIVE>\n<header revMajor="1" revMinor="9"/>\n'
    + _road(1, 0, 100, "<line/>", WORKS, _to("successor", 2, "start"))
    + _road(2, 100, 50, CURVE.format(b=50, range="normalized"),
        f"<lanes>{_section(0, W, P, '')}</lanes>\n",
            _to("predecessor", 1, "end") + '<successor elementType="junction" elementId="5"/>')
    + _road(3, 160, 50, CURVE.format(b=1, range="arcLength"),
            '<lanes><laneSection s="0"><center><lane '
            f'id="0"/></center><right>\n{BORDERS}</right></laneSection></lanes>\n',
            '<predecessor elementType="junction" elementId="5"/>')
    + _road(10, 150, 10, "<line/>", f"<lanes>{_section(0, W, '', '')}</lanes>\n",
            _to("predecessor", 2, "end") + _to("successor", 3, "start"), 5)
    + '<junction id="5" name="">\n<connection id="0" incomingRoad="2" connectingRoad="10" '
      'contactPoint="start">\n'
    '<laneLink from="-1" to="-1"/></connection>\n<crossPath id="0" crossingRoad="10" '
    'roadAtStart="2" roadAtEnd="3">\n'
    '<startLaneLink s="50" from="-1" to="-1"/><endLaneLink s="0" from="-1" '
    'to="-1"/></crossPath>\n</junction>\n</OpenDRIVE>\n'
)  # fmt: skip


class Fault(NamedTuple):
    """Replacements that break a rule."""

    rule: str
    edits: tuple[tuple[str, str], ...]


def _edited(text: str, *pairs: tuple[str, str]) -> str:
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def _fault(rule: str, *texts: str) -> Fault:
    """The texts are an old one, its new one, the next old one, …"""
    return Fault(rule, tuple(zip(texts[::2], texts[1::2], strict=True)))


INNER, OUTER = (_lane(number, W, P, "") for number in (-1, -2))
"""The lanes of road 2"""
TEMPORARY = _lane(-2, N, P, P)
OPENS = INNER.replace('a="3.5" b="0"', 'a="0" b="0.07"')
BEFORE = _section(0, W, "", f"{P} {T}")
BACK, ONE = _to("predecessor", 2, "end"), _to("predecessor", 1, "end")
WHOLE = '<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry>'
HALF = '<geometry s="{s}" x="{s}" y="{y}" hdg="0" length="50"><line/></geometry>\n'
FIRST, SECOND = HALF.format(s=0, y=0), HALF.format(s=50, y=0)
NO_LANES = '<laneSection s="0"><center><lane id="0"/></center></laneSection>'
ACCESS = '<access sOffset="0" rule="{}"/>'
WORKS_AT = f'<laneSection s="40"{LENGTH}>'
ENTERED = '<connection id="{}" incomingRoad="{}" connectingRoad="10" contactPoint="{}">'

FAULTS = [
    _fault("level_true_one_side", INNER, INNER.replace('"false"', '"true"')),
    _fault("no_mix_of_deny_or_allow", W, W + ACCESS.format("deny") + ACCESS.format("allow")),
    _fault("overlap_with_inner_lanes", 'a="-7" b="0"', 'a="-7" b="0.1"'),
    _fault(
        "lanes_across_lane_sections",
        INNER,
        INNER.replace(f'<predecessor id="-1" layer="{P}"/>', ""),
    ),
    _fault("zero_width_at_start", INNER, OPENS),
    _fault("zero_width_at_end", BEFORE, BEFORE.replace('a="3.5" b="0"', 'a="4" b="-0.1"', 1)),
    _fault("new_lane_appear", INNER, OPENS),
    _fault("layer_limits", '<lanes layer="temporary">', '<lanes layer="permanent">'),
    _fault("layer_mandatory_permanent", _section(0, W, P, ""), NO_LANES),
    _fault(
        "center_lane_permanent",
        '<laneSection s="0"><center><lane id="0"/></center>',
        '<laneSection s="0">',
    ),
    _fault("length_only_temporary", '<laneSection s="70">', '<laneSection s="70" length="30">'),
    _fault("lane_phys_attr_temporary", N, N + '<height sOffset="0" inner="1" outer="1"/>'),
    _fault("lanesec_length_limit_road", LENGTH, ' length="61"'),
    _fault("new_lanesec_link_temp_to_perm", '<laneSection s="40"', '<laneSection s="41"'),
    _fault("temporary_layer_section_link_permanent", TEMPORARY, _lane(-2, N, P, "")),
    _fault(
        "lane_group_width_temporary",
        WORKS_AT,
        f'<laneOffset s="0" a="-1.1" b="0" c="0" d="0"/>{WORKS_AT}',
    ),
    _fault("connect_road_no_incoming_road", 'incomingRoad="2"', 'incomingRoad="10"'),
    _fault(
        "one_connection_element",
        "</junction>",
        ENTERED.format(1, 3, "end") + "</connection></junction>",
        '"9"',
        '"7"',
    ),
    _fault(
        "one_link_to_incoming",
        "</connection>",
        "</connection>" + ENTERED.format(1, 2, "start") + "</connection>",
    ),
    _fault("start_along_linkage", BACK, ONE),
    _fault("end_opposite_linkage", ENTERED.format(0, 2, "start"), ENTERED.format(0, 2, "end")),
    _fault("is_junction_needed", '<predecessor elementType="junction" elementId="5"/>', ONE),
    _fault("elem_asc_order", WHOLE, SECOND + FIRST),
    _fault("parampoly3.length_match", 'bU="50"', 'bU="50.1"'),
    _fault("arclength_range", 'bU="1"', 'bU="1.01"'),
    _fault("paramPoly3.valid_parameters", 'aU="0" bU="1"', 'aU="1" bU="1"'),
    _fault("avoid_redundant_info", WHOLE, FIRST + SECOND),
    _fault("road.geometry.contact_point", 'x="100" y="0"', 'x="100" y="0.5"'),
    _fault(
        "cross_path.lane_linkage",
        '<startLaneLink s="50" from="-1"',
        '<startLaneLink s="50" from="-2"',
    ),
    _fault("contact_point_no_horizontal_gaps", WHOLE, FIRST + HALF.format(s=50, y=0.02)),
]


def check(tmp_path: Path, text: str) -> list[Problem]:
    """Problems of a road network, without the one that no XSD of its version may be at hand."""
    path = tmp_path / "road.xodr"
    path.write_text(text, encoding="utf-8")
    return [problem for problem in schemas.check(path) if "not validated" not in problem.message]


def test_the_sound_file_has_no_problem(tmp_path) -> None:
    assert check(tmp_path, SOUND) == []


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.rule)
def test_rule_catches_its_fault(tmp_path, fault) -> None:
    text = _edited(SOUND, *fault.edits)
    found = [problem for problem in check(tmp_path, text) if problem.rule.endswith(fault.rule)]
    assert found
    assert all(problem.line and problem.element for problem in found)


def test_every_rule_of_lanes_curves_and_gaps_has_a_fault() -> None:
    uids = [
        rule.uid
        for rule in all_rules()
        if rule.check.__module__ == MODULE or rule.uid.endswith(CURVES + TOUCHING)
    ]
    assert [uid for uid in uids if not any(uid.endswith(fault.rule) for fault in FAULTS)] == []


def test_gaps_of_old_files_are_warnings(tmp_path) -> None:
    text = _edited(SOUND, ('x="100" y="0"', 'x="103" y="0"'), ('revMinor="9"', 'revMinor="4"'))
    found = {
        problem.level for problem in check(tmp_path, text) if problem.rule.endswith("contact_point")
    }
    assert found == {"warning"}
