"""Work of reading and compiling against the number of one repeated construct: not above linear.

Counted are lines that run: they are the same on every machine. Work of C functions is not seen.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from benchmarks.growth import examples, repeatable, write
from runner.judging.execution import prepare
from schemas.common.errors import ToolchainError
from schemas.versions.registry import OPENSCENARIO, schema_for
from tests.runner.files import at_time, car, place, scenario, speed_action, story

COUNTS = (150, 300, 600)
MOST = 2.1
"""Lines of the last 300 for those of 150 before: 2 where growth is linear, 4
where it is quadratic
"""
TraceFunction = Callable[[FrameType, str, object], Any]
_EVENT = story("Lead", [(1, speed_action(5))])

Text = Callable[[int], str]
CONSTRUCTS: dict[str, tuple[str, Text]] = {
    "entities": ("<Entities>", lambda n: car(f"Car{n}")),
    "initial actions": ("<Actions>", lambda n: place("Lead", 150 + n % 9, 10)),
    "stories": ("</Init>", lambda n: _EVENT.replace('name="', f'name="n{n}_')),
    "condition groups": ("<StopTrigger>", lambda n: at_time(1000 + n)),
    "parameters": (
        "<ParameterDeclarations>",
        lambda n: f'<ParameterDeclaration name="P{n}" parameterType="double" value="{n}"/>',
    ),
    "unknown elements": ("<Entities>", lambda n: "<Unknown/>"),
    "unknown attributes": ("<Storyboard", lambda n: f' unknown{n}="1"'),
    "empty entities": ("<Entities>", lambda n: f'<ScenarioObject name="E{n}"/>'),
    "empty private actions": ("<Actions>", lambda n: '<Private entityRef="Lead"/>'),
    "empty stories": ("</Init>", lambda n: f'<Story name="s{n}"/>'),
    "comments": ("<Entities>", lambda n: "<!-- c -->"),
}
"""Place after which a construct is repeated, and its text by number"""


def lines(name: str, number: int, folder: Path) -> int:
    """Lines run for preparing a scenario with a repeated construct, or for refusing it."""
    place_of, text = CONSTRUCTS[name]
    path = scenario(folder, f"s{number}")
    source = path.read_text(encoding="utf-8")
    assert place_of in source
    more = place_of + "".join(map(text, range(number)))
    path.write_text(source.replace(place_of, more, 1), encoding="utf-8")
    found = 0

    def count(_frame: FrameType, event: str, _argument: object) -> TraceFunction:
        nonlocal found
        found += event == "line"  # once for each turn of a loop in one line, too
        return count

    before = sys.gettrace()
    sys.settrace(count)
    try:
        with suppress(ToolchainError):
            prepare(path)
    finally:
        sys.settrace(before)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", CONSTRUCTS)
def test_work_grows_linearly_with_a_repeated_construct(name: str, tmp_path: Path) -> None:
    lines(name, 1, tmp_path)  # imports are no growth
    few, some, many = (lines(name, number, tmp_path) for number in COUNTS)
    assert 0 < many - some <= MOST * (some - few)


def test_elements_that_the_schema_lets_repeat_are_found_and_repeated(tmp_path: Path) -> None:
    schema = schema_for(OPENSCENARIO, (1, 3))
    assert schema is not None
    elements = repeatable(schema.path)
    files = examples(elements)
    assert len(elements) == 70
    assert set(files) == set(elements)
    element = next(each for each in files if each == ("Story", "Act"))
    path = write(files[element], element, 20, tmp_path)
    assert path.read_bytes().count(b"<Act ") >= 21
    prepare(path)
