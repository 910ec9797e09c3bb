"""Public scenario libraries, as they are."""

from __future__ import annotations

from schemas import check


def test_every_public_scenario_is_accepted(corpora):
    files = sorted(corpora.rglob("*.xosc"))
    assert len(files) > 100
    assert [str(problem) for file in files for problem in check(file) if problem.level == "error"] == []


def test_every_public_road_is_accepted_or_has_a_clear_reason(corpora):
    for file in sorted(corpora.rglob("*.xodr")):
        for problem in check(file):
            assert problem.line is not None
            assert problem.level == "warning" or problem.rule == "asam.net:xodr:1.4.0:ids.id_unique_in_class"
