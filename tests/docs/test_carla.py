"""The page on scenarios for CARLA lists the criteria that there are."""

from __future__ import annotations

from pathlib import Path

from runner.judging.criteria.criterion import kinds

PAGE = (Path(__file__).parents[2] / "docs" / "carla.md").read_text(encoding="utf-8")


def test_the_page_lists_every_criterion_as_its_module_describes_it() -> None:
    listed = [
        line
        for line in PAGE.splitlines()
        if line.startswith("| ") and line.split("|")[1].strip().casefold() in kinds()
    ]
    expected = []
    for kind in sorted(kinds().values(), key=lambda kind: kind.name):
        parameters = ", ".join(
            f"`{name}`" if usual is None else f"`{name}` ({usual:g})"
            for name, usual in kind.parameters.items()
        )
        expected.append(f"| {kind.name} | {kind.summary} | {parameters} | {kind.unit} |")
    assert [line for line in listed if line in expected] == expected
