"""Judged figures of the results of recognition are counted from the reviewers' verdict files, and
their intervals are Wilson's."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterable

import pytest
from scipy.stats import binomtest

from tests.docs.test_figures import ROOT, rows, sections

PAGE = ROOT / "docs" / "recognition-results.md"
VERDICTS = ROOT / "docs" / "verdicts"
NINTH, TWELFTH = "Precision and recall on sites never seen", "By sensor and kind of road"
_COUNTS = re.compile(r"(?:(\d+), )?(\d+) of (\d+)")
_INTERVAL = re.compile(r"(\d+) to (\d+)(?=[, %])")
Row = dict[str, str]
Counts = list[tuple[int, ...]]


def read(name: str) -> list[Row]:
    with (VERDICTS / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def both(name: str) -> list[list[Row]]:
    """Rows of the first and the second reviewer of the ninth draw."""
    return [read(f"ninth/{name}-{reviewer}.csv") for reviewer in (1, 2)]


def right(
    reviews: Iterable[list[Row]], sources: tuple[str, ...] = (), where: str = ""
) -> tuple[int, ...]:
    """Findings of some sources that are right, by reviewer, and all of them; by default of all."""
    found = [
        [
            row["verdict"] == "right"
            for row in rows
            if where in ("", row["set"]) and (not sources or row["source"] in sources)
        ]
        for rows in reviews
    ]
    return (*(sum(one) for one in found), len(found[0]))


def recalled(
    events: list[Row], *found: Callable[[set[str]], bool], where: str = ""
) -> tuple[int, ...]:
    """Events that each of these has found, and all that are listed."""
    listed = [row for row in events if row["class"] and where in ("", row["set"])]
    by = [set(row["found_by"].split()) for row in listed]
    return (*(sum(map(one, by)) for one in found), len(listed))


def of_rules(by: set[str]) -> bool:
    return bool(by & {"both", "rules"})


def of_model(by: set[str]) -> bool:
    return bool(by & {"both", "model"})


def of_ninth() -> dict[str, Counts]:
    precision, (first, second) = both("precision"), both("recall")
    finders = {
        "rules": (("both", "rules"), of_rules),
        "model": (("both", "model"), of_model),
        "both agree": (("both",), lambda by: "both" in by),
        "rules alone": (("rules",), lambda by: "rules" in by),
        "model alone": (("model",), lambda by: "model" in by),
    }
    found: dict[str, Counts] = {
        title: [
            right(precision, sources),
            recalled(first, finder),
            recalled(second, finder),
        ]
        for title, (sources, finder) in finders.items()
    }
    plain = [recalled(events, lambda by: "baseline" in by) for events in (first, second)]
    found["plain baseline (lane numbers, headings)"] = plain
    for title, where in (
        ("Waymo streets (25)", "Waymo streets"),
        ("mirrored into left-hand traffic (8)", "Waymo streets mirrored"),
        ("one highD motorway", "highD motorway"),
    ):
        found[title] = [
            *(recalled(events, of_rules, of_model, where=where) for events in (first, second)),
            right(precision, ("both", "rules"), where),
        ]
    return found


def of_twelfth() -> dict[str, Counts]:
    precision, recall = read("twelfth/precision.csv"), read("twelfth/recall.csv")
    strata = {
        "motorway with ramps": "NGSIM US-101",
        "signalised": "NGSIM Lankershim, Peachtree",
        "junction": "TAF-BW k729",
        "vehicle, left- and right-hand traffic": "nuScenes",
        "vehicle": "Waymo streets",
        "drone": "inD Heckstrasse, drone",
        "roundabouts": "own roundabouts",
    }
    return {
        title: [
            right([precision], where=name),
            recalled(recall, of_rules, where=name),
        ]
        for title, name in strata.items()
    }


def wilson(good: int, of: int) -> tuple[int, int]:
    """Interval of a share, in whole percent."""
    interval = binomtest(good, of).proportion_ci(method="wilson")
    return round(100 * interval.low), round(100 * interval.high)


def complaints(text: str, expected: dict[str, Counts]) -> list[str]:
    """Rows of tables that say other counts than the files, or other intervals than theirs."""
    found, seen = [], set[str]()
    for title, *cells in rows(text):
        name = title if title in expected else title.partition(":")[0]
        if name not in expected:
            continue
        seen.add(name)
        counts, said = list[tuple[int, ...]](), list[tuple[int, ...]]()
        for cell in cells:
            these = [tuple(int(one) for one in each if one) for each in _COUNTS.findall(cell)]
            counts += these
            said += these
            intervals = [(int(low), int(high)) for low, high in _INTERVAL.findall(cell)]
            *goods, of = said[-1] if said else (0,)
            wanted = list(dict.fromkeys(wilson(good, of) for good in goods))
            if intervals and intervals not in (wanted, wanted[:1]):
                found.append(f"{title}: {intervals}, not {wanted}")
        # Equal counts of two are said once.
        told, right_ones = (
            [(*dict.fromkeys(goods), of) for *goods, of in one] for one in (counts, expected[name])
        )
        if told != right_ones:
            found.append(f"{title}: {told}, not {right_ones}")
    return found + [f"no row {name}" for name in expected.keys() - seen]


def section(title: str) -> str:
    return next(one.text for one in sections(PAGE) if one.title == title)


@pytest.mark.parametrize(("title", "expected"), [(NINTH, of_ninth), (TWELFTH, of_twelfth)])
def test_judged_figures_are_those_of_the_verdicts(
    title: str, expected: Callable[[], dict[str, Counts]]
) -> None:
    found = complaints(section(title), expected())
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("title", "expected", "old", "new"),
    [
        (NINTH, of_ninth, "30, 28 of 32", "31, 28 of 32"),
        (NINTH, of_ninth, "(75 to 93 %)", "(76 to 93 %)"),
        (NINTH, of_ninth, "12, 6 of 16", "12, 6 of 17"),
        (NINTH, of_ninth, "| model alone", "| the model alone"),
        (TWELFTH, of_twelfth, "| 13 of 15 |", "| 12 of 15 |"),
    ],
)
def test_stale_counts_and_intervals_are_complained_of(
    title: str, expected: Callable[[], dict[str, Counts]], old: str, new: str
) -> None:
    text = section(title)
    assert old in text
    assert complaints(text.replace(old, new), expected())


def test_leading_sentences_sum_the_verdicts_up() -> None:
    text = " ".join(section(TWELFTH).split())
    every = list(of_twelfth().values())
    (good, of), (found, events) = (
        tuple(map(sum, zip(*(row[column] for row in every), strict=True))) for column in (0, 1)
    )
    for count, total in ((good, of), (found, events)):
        low, high = wilson(count, total)
        assert re.search(rf"{count} of {total} [\w ]+ \({low} to {high} %;", text), (count, total)
    first, second = of_ninth()["rules"][1:]
    shares = " and ".join(f"{100 * hit / of:.0f}" for hit, of in (first, second))
    assert f"find {shares} % of the events" in " ".join(section(NINTH).split())
