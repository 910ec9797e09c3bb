"""Commands that make the results, with the settings of each scale."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import monotonic
from typing import NamedTuple

from schemas.common.errors import ToolchainError

LIBRARY = Path("xosc/library")
_PINNED = ("--pin", "Ego_Speed_mps=30")
"""Parameter of highway cut ins that is not searched: the others are the seven"""
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
_FEW = (
    *("trfe", "random", "mls", "cac", "arpl", "cpn", "mdenet"),
    *("trfe-given-k", "kmeans", "iterative-euclidean", "iterative-autonovel"),
    *("as-published", "no-ucs", "nvp", "no-oc", "strict", "reading-b", "vote-threshold"),
)
"""Rows of tables 3 and 4, of figure 3 and the chain"""
_CURVES = ("delta", "trees")
"""Figure 4 over δ and T"""
_CAPACITIES = ("w125", "w250", "w500", "w1000")
"""Figure 4 over W, which takes more windows than the smallest settings have: all its rows were the
same there"""
_MORE = (
    *("trfe-own-rule", "trfe-tuned", "reading-a", "logistic", "knn"),
    *("logistic-changes", "logistic-without-roles", "knn-changes", "map-only"),
    *("stae-kmeans", "stae-linkage"),
    *("joint", "retrained", "joint-retrained", "as-published-joint"),
)
"""Rows of plain methods, of an autoencoder, which read grids, and of an encoder that learns on"""
_PARTS = (
    *("pooled", "supervised-forest", "all-candidates"),
    *("k-means", "trfe-k-means", "kmeans-axes", "gaussian-mixture", "gaussian-mixture-counted"),
)
"""Rows that differ from TRFE in one part: votes without distances, the similarity, the number of
candidates, and what clusters on its axes"""


OWN_RECORDINGS = "units"
"""Stage that there is with recordings of one's own alone"""


class FailedStage(ToolchainError):
    """A command of a stage that ended with another exit code than 0."""


class Scale(NamedTuple):
    """Settings of all stages.

    Attributes:
        recorded: options of `record`.
        events: most windows of each class.
        seeds: seeds of the protocol.
        budget, searches: runs of each search, and seeds of it.
        grids: preset of the encoder that reads grids, as published.
        rows: methods, variants and curves that are compared.
        densities: whether densities are compared, which takes minutes whatever the settings.
        figures: whether the stages draw pictures of their own; those of the page are made anyway.
    """

    recorded: tuple[str, ...]
    events: int
    seeds: int
    budget: int
    searches: int
    grids: str
    rows: tuple[str, ...]
    densities: bool = False
    figures: bool = False


SCALES = {
    "smallest": Scale(("--scale", "0.02"), 20, 1, 40, 1, "pca", (*_FEW, *_CURVES)),
    "middle": Scale(
        *(
            ("--families", "60", "--seed", "900"),
            100,
            5,
            300,
            5,
            "cpu-rows",
            (*_FEW, *_CAPACITIES, *_CURVES, *_MORE, *_PARTS),
        )
    ),
    "full": Scale(
        *(
            ("--families", "60", "--seed", "900"),
            400,
            5,
            3000,
            5,
            "full-rows",
            (*_FEW, *_CAPACITIES, *_CURVES, *_MORE),
        ),
        densities=True,
        figures=True,
    ),
}
"""Settings by name: `smallest` shows that all of it runs, `middle` has the recordings and the seeds
of `full` with a quarter of the windows and a small encoder of grids, so that it needs no GPU"""


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
        recordings: folder in the formats of highD and INTERACTION, whose manoeuvres are what
            searches start from; None records SUMO's traffic, and takes those that are shipped.
    """
    found, recorded = [], tuple[str, ...]()
    if recordings is None:
        recordings = work / "recordings"
        found.append(Stage("recordings", _recorded(scale, recordings)))
    else:
        units = work / "units.parquet"
        found.append(Stage(OWN_RECORDINGS, _units(recordings, units)))
        recorded = ("--recorded", str(units))
    for name, preset in (("published", scale.grids), ("shipped", "tokens")):
        out = work / name
        found.append(Stage(name, _protocol(scale, recordings, out, preset), out / "tables"))
    if scale.densities:
        out = work / "densities"
        found.append(Stage("densities", _densities(out, recorded), out / "tables"))
    for scenario in ("cut_in_highway", *GEOMETRIES):
        out = work / scenario
        command = _searched(scale, scenario, out, recorded)
        found.append(Stage(scenario, command, out / "tables"))
    return found


def _recorded(scale: Scale, out: Path) -> tuple[str, ...]:
    return ("recognition.xosc_recognize", "record", str(out), *scale.recorded, "-q")


def _units(recordings: Path, out: Path) -> tuple[str, ...]:
    """Manoeuvres of recordings, as parameters."""
    return ("studies.generation", "reconstruction", str(recordings), "--out", str(out))


def _protocol(scale: Scale, recordings: Path, out: Path, preset: str) -> tuple[str, ...]:
    return (
        "studies.recognition",
        "protocol",
        str(recordings),
        *("--out", str(out), "--preset", preset),
        *("--events-per-class", str(scale.events), "--seeds", str(scale.seeds)),
        *("--first-seed", "10", "--quiet", *_without_figures(scale)),
        *(part for name in scale.rows for part in ("--methods", name)),
    )


def _densities(out: Path, recorded: Sequence[str]) -> tuple[str, ...]:
    scenario = (LIBRARY / "cut_in_highway.xosc").as_posix()
    return ("studies.generation", "densities", scenario, "--out", str(out), *_PINNED, *recorded)


def _searched(scale: Scale, scenario: str, out: Path, recorded: Sequence[str]) -> tuple[str, ...]:
    """All methods on highway cut ins (table 5), MCSG as published and draws
    elsewhere (figure 8).
    """
    seven = scenario == "cut_in_highway"
    few = () if seven else ("mcsg", "mcsg-published", "draws")
    return (
        "studies.generation",
        "methods",
        (LIBRARY / f"{scenario}.xosc").as_posix(),
        *("--out", str(out), "--budget", str(scale.budget), "--seeds", str(scale.searches)),
        "--quiet",
        *(_PINNED if seven else ()),
        *recorded,
        "--no-likelihoods",
        *_without_figures(scale),
        *(part for name in few for part in ("--methods", name)),
    )


def _without_figures(scale: Scale) -> tuple[str, ...]:
    return () if scale.figures else ("--no-figures",)


def run(chosen: Sequence[Stage]) -> Iterator[tuple[Stage, float, float]]:
    """Run stages; each is given back with its time (s) and the processor time of its processes.

    Raises:
        FailedStage: commands failed, after all others have run; what they say stands on standard
            error.
    """
    failed = []
    for stage in chosen:
        start, before = monotonic(), _processor_time()
        ended = subprocess.run([sys.executable, "-m", *stage.command], check=False)
        if ended.returncode:
            failed.append(f"the stage {stage.name} ended with exit code {ended.returncode}")
        else:
            yield stage, monotonic() - start, _processor_time() - before
    if failed:
        raise FailedStage("; ".join(failed))


def _processor_time() -> float:
    """Processor time of all child processes that have ended (s)."""
    spent = os.times()
    return spent.children_user + spent.children_system
