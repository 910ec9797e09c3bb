"""Processor time of reading and compiling against the number of one repeated construct: not above linear."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from time import process_time

import numpy as np
import pytest

from runner.judging.execution import prepare
from schemas.common.errors import ToolchainError
from tests.runner.files import at_time, car, place, scenario, speed_action, story

COUNTS = (500, 1000, 2000, 4000)
STEEPEST = 1.4
"""Exponent b of time = a n^b from which on growth is not linear; n log n has 1.15 here"""
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


def seconds(name: str, number: int, folder: Path) -> float:
    """Processor time (s) of preparing a scenario with a repeated construct, or of refusing it; the least of two."""
    place_of, text = CONSTRUCTS[name]
    times = []
    for attempt in range(2):
        path = scenario(folder, f"s{number}_{attempt}")
        source = path.read_text(encoding="utf-8")
        assert place_of in source
        more = place_of + "".join(map(text, range(number)))
        path.write_text(source.replace(place_of, more, 1), encoding="utf-8")
        start = process_time()
        with suppress(ToolchainError):
            prepare(path)
        times.append(process_time() - start)
    return min(times)


def exponent(name: str, folder: Path) -> float:
    """Exponent of the growth of the time above that of a scenario without the construct."""
    seconds(name, 1, folder)  # imports are no growth
    base = seconds(name, 2, folder)
    times = [max(seconds(name, number, folder) - base, 1e-3) for number in COUNTS]
    return float(np.polyfit(np.log(COUNTS), np.log(times), 1)[0])


@pytest.mark.slow
@pytest.mark.parametrize("name", CONSTRUCTS)
def test_time_grows_linearly_with_a_repeated_construct(name: str, tmp_path: Path) -> None:
    found = [exponent(name, tmp_path)]
    if min(found) > STEEPEST:  # once more, as other processes disturb caches
        found.append(exponent(name, tmp_path / "again"))
    assert min(found) <= STEEPEST
