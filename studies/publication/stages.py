"""Commands that make the results, with the settings of each scale."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import monotonic
from typing import NamedTuple

from schemas.common.errors import ToolchainError

LIBRARY = Path("xosc/library")
GEOMETRIES = (
    "cut_in_narrow_road",
    "cut_in_sharp_curve",
    "cut_in_t_junction",
    "cut_in_four_way_intersection",
    "diverging_highway",
    "merging_highway",
    "congestion_highway",
)
"""Logical scenarios of figure 8: the four geometries, then diverging, merging and congestion"""
_ABLATED = (
    "trfe",
    "as-published",
    "no-ucs",
    "nvp",
    "no-oc",
    "strict",
    "reading-b",
    "vote-threshold",
)
_CAPACITIES = ("w125", "w250", "w500", "w1000")


class FailedStage(ToolchainError):
    """A command of a stage that ended with another exit code than 0."""


class Scale(NamedTuple):
    """Settings of all stages.

    Attributes:
        record: share of the own recordings that is made.
        events: most windows of each class.
        seeds: seeds of the protocol.
        budget, searches: runs of each search, and seeds of it.
        grids: preset of the encoder that reads grids, as published.
        open_set, clustering: rows that are compared; all where there are none.
    """

    record: float
    events: int
    seeds: int
    budget: int
    searches: int
    grids: str
    open_set: tuple[str, ...] = ()
    clustering: tuple[str, ...] = ()


SCALES = {
    "smallest": Scale(
        record=0.02,
        events=20,
        seeds=1,
        budget=40,
        searches=1,
        grids="pca",
        open_set=("trfe", "random", "mls", "cac", "arpl", "cpn", "mdenet"),
        clustering=(
            "trfe",
            "trfe-given-k",
            "random",
            "kmeans",
            "iterative-euclidean",
            "iterative-autonovel",
        ),
    ),
    "full": Scale(record=1.0, events=400, seeds=5, budget=3000, searches=5, grids="cpu"),
}
"""Settings by name: `smallest` shows that all of it runs, `full` is what is reported"""


class Stage(NamedTuple):
    """A command and what it leaves.

    Attributes:
        name: of the stage, and of the folder of its results.
        command: what follows `python -m`.
        tables: folder of its tables (CSV), in the working folder; None where it leaves none.
    """

    name: str
    command: tuple[str, ...]
    tables: Path | None = None


def stages(scale: Scale, work: Path, recordings: Path | None = None) -> list[Stage]:
    """All stages in the order in which they need each other.

    Args:
        scale: the settings.
        work: folder of all that the stages make.
        recordings: folder in the formats of highD and INTERACTION; None records SUMO's traffic.
    """
    found = []
    if recordings is None:
        recordings = work / "recordings"
        found.append(Stage("recordings", _recorded(scale, recordings)))
    for name, preset in (("published", scale.grids), ("shipped", "tokens")):
        out = work / name
        found.append(Stage(name, _protocol(scale, recordings, out, preset), out / "tables"))
    for scenario in ("cut_in_highway", *GEOMETRIES):
        out = work / scenario
        found.append(Stage(scenario, _searched(scale, scenario, out), out / "tables"))
    return found


def _recorded(scale: Scale, out: Path) -> tuple[str, ...]:
    return ("recognition.xosc_recognize", "record", str(out), "--scale", f"{scale.record:g}", "-q")


def _protocol(scale: Scale, recordings: Path, out: Path, preset: str) -> tuple[str, ...]:
    rows = (*scale.open_set, *scale.clustering, *_ABLATED, *_CAPACITIES, "delta", "trees")
    chosen = dict.fromkeys(rows) if scale.open_set else ()
    return (
        "studies.recognition",
        "protocol",
        str(recordings),
        *("--out", str(out), "--preset", preset),
        *("--events-per-class", str(scale.events), "--seeds", str(scale.seeds)),
        *("--first-seed", "10", "--quiet"),
        *(part for name in chosen for part in ("--methods", name)),
    )


def _searched(scale: Scale, scenario: str, out: Path) -> tuple[str, ...]:
    """All methods on highway cut ins (table 5), MCSG as published and draws elsewhere (figure 8)."""
    seven = scenario == "cut_in_highway"
    few = () if seven else ("mcsg", "mcsg-published", "draws")
    return (
        "studies.generation",
        "methods",
        (LIBRARY / f"{scenario}.xosc").as_posix(),
        *("--out", str(out), "--budget", str(scale.budget), "--seeds", str(scale.searches)),
        "--quiet",
        *(("--pin", "Ego_Speed_mps=30") if seven else ()),
        *(part for name in few for part in ("--methods", name)),
    )


def run(chosen: Sequence[Stage]) -> Iterator[tuple[Stage, float]]:
    """Run stages; each is given back with its time (s).

    Raises:
        FailedStage: a command fails; what it says stands on standard error.
    """
    for stage in chosen:
        start = monotonic()
        ended = subprocess.run([sys.executable, "-m", *stage.command], check=False)
        if ended.returncode:
            raise FailedStage(f"the stage {stage.name} ended with exit code {ended.returncode}")
        yield stage, monotonic() - start
