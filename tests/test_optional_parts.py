"""Removing a part that a later version made optional, or that a repair supplies,
changes no trajectory.

Scenarios of the house are sampled, and those of the public libraries where these are at hand.
`XOSC_SAMPLE_SEED` draws others; `python -m benchmarks.optional_parts` tries all.
"""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest

from benchmarks.optional_parts import (
    FORMLESS,
    NEUTRAL,
    SILENT,
    Case,
    cases,
    difference,
    later_optional,
    parts,
)
from schemas.common.xml import parse
from xosc.document import VERSIONS
from xosc.document.repairs.attributes import _DEFAULT_OF
from xosc.document.repairs.elements import _MEANINGS

HERE = Path(__file__).parent
SEED = int(os.environ.get("XOSC_SAMPLE_SEED", "0"))


def sampled(folder: Path, count: int) -> list[Case]:
    """Cases of files drawn from a folder: reading all takes longer than playing some."""
    files = sorted(folder.rglob("*.xosc"))
    drawn = random.Random(SEED).sample(files, min(count, len(files)))
    return random.Random(SEED).sample(found := list(cases(drawn)), min(count, len(found)))


def changes(folder: Path, count: int) -> list[str]:
    """Sentences on sampled cases that change a trajectory."""
    found = sampled(folder, count)
    assert found
    return [f"{case}: {told}" for case in found if (told := difference(case))]


def test_each_kind_of_part_is_tried_or_has_no_form_of_absence() -> None:
    known = NEUTRAL.keys() | SILENT | FORMLESS.keys()
    optional = {part for version in VERSIONS for part in later_optional(version)}
    assert optional <= known
    supplied = {(tag, f"@{name}") for tag, name in (each.split("/") for each in _DEFAULT_OF)}
    # references name these elements, so that a name without letters is another one
    named = {part for part in supplied if part[1] == "@name"}
    assert (supplied | _MEANINGS.keys()) - named <= known | {("TrafficSwarmAction", "@offset")}


def test_a_part_that_says_something_else_is_found(tmp_path: Path) -> None:
    source = HERE / "conformance" / "scenarios" / "SpeedAction.xosc"
    case = Case(source, ("AbsoluteTargetSpeed", "@value"))
    assert next(parts(parse(source).getroot(), case.part), None)
    assert "value" in difference(case)


@pytest.mark.slow
@pytest.mark.parametrize("folder", ["conformance/scenarios", "../xosc/library"])
def test_no_trajectory_of_the_house_changes(folder: str) -> None:
    assert changes(HERE / folder, 40) == []


@pytest.mark.slow
def test_no_trajectory_of_the_public_libraries_changes(corpora: Path) -> None:
    assert changes(corpora, 25) == []
