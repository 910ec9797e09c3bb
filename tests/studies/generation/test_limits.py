"""Searches by limits, with the margin and without it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from generation.space.logical.library import SCENARIOS
from studies.generation.commands.limits import command


@pytest.mark.slow
def test_recalls_of_searches_by_a_limit_stand_beside_each_other(
    capsys: pytest.CaptureFixture[str],
) -> None:
    scenario = Path(SCENARIOS / "cut_in_highway.xosc")
    command(
        scenario, systems=["cas"], limits=["min_ttc<1", "min_ttc<9"], budget=150, seeds=1,
        pool=2000, timestep=0.1,
    )  # fmt: skip
    told = capsys.readouterr().out.splitlines()
    row = re.fullmatch(r"\| cas, min_ttc<1 \| (\S+)% \| (\S+) \| (\S+) \| (\S+) \|", told[2])
    assert row is not None and 0.5 < float(row[1]) < 2.0
    guided, blind, drawn = map(float, row.groups()[1:])
    assert min(guided, blind) > drawn
    assert told[3].endswith("left out |")  # nearly all find that
    assert told[-2].startswith("| cover, without the margin | ")
    assert told[-1].endswith(" | 1 |")
