"""Mutants of scenarios that must fail: none passes (tests/oracles/mutants.py)."""

from __future__ import annotations

import os
from datetime import date
from pathlib import Path
from random import Random

import pytest

from tests.commands import Command
from tests.oracles.mutants import LONGEST, MUTATIONS, OPTIONS, bases, mutants, written

QUICK = ("ego_without_place", "nothing_starts", "names_exchanged", "no_time", "box_out_of_reach")


def test_the_plain_bases_fail(command: Command, tmp_path: Path) -> None:
    for base in bases(tmp_path)[-4:]:
        answer = command("xosc-run", base.path, *OPTIONS, "--max-time", LONGEST)
        assert answer.code == 1, answer


@pytest.mark.slow
def test_all_bases_fail(command: Command, tmp_path: Path) -> None:
    found = bases(tmp_path)
    assert len({base.path for base in found}) == 30
    for base in found:
        answer = command("xosc-run", base.path, *OPTIONS, "--max-time", LONGEST)
        assert answer.code == 1, (base, answer)


@pytest.mark.parametrize("name", QUICK)
def test_a_mutation_alone_does_not_pass(name: str, command: Command, tmp_path: Path) -> None:
    base = bases(tmp_path / "bases")[-3]
    mutant = written(base, tmp_path, (name,), Random(0))
    assert mutant is not None
    answer = command("xosc-run", mutant.path, *mutant.options)
    assert answer.code != 0, answer


def test_equal_seeds_make_equal_mutants(tmp_path: Path) -> None:
    first, second = (list(mutants(3, 20, tmp_path / name)) for name in "ab")
    assert [mutant.mutations for mutant in first] == [mutant.mutations for mutant in second]
    assert len({mutant.mutations for mutant in first}) > 10
    texts = [[mutant.path.read_text() for mutant in side] for side in (first, second)]
    assert texts[0][:3] == [text.replace("/b/", "/a/") for text in texts[1][:3]]


@pytest.mark.slow
def test_no_mutant_passes(command: Command, tmp_path: Path) -> None:
    """XOSC_MUTANTS=N plays N; the seed is the week, or XOSC_MUTANT_SEED."""
    week = date.today().isocalendar()
    seed = int(os.environ.get("XOSC_MUTANT_SEED", week.year * 100 + week.week))
    count = int(os.environ.get("XOSC_MUTANTS", "90"))
    wrong = []
    for mutant in mutants(seed, count, tmp_path):
        answer = command("xosc-run", mutant.path, *mutant.options)
        if answer.code == 0:
            wrong.append((mutant.path.parent.name, mutant.mutations))
    assert not wrong, f"seed {seed}"
    assert len(MUTATIONS) >= 25
