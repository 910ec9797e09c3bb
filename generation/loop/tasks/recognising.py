"""Recognition as a stage of the loop: recordings, or runs as recordings, become a catalogue."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from generation.loop.stages.findings import Measured, Recognised
from recognition.catalogue.pipeline import ByRules, build
from recognition.catalogue.stages import CatalogueSettings
from recognition.catalogue.writing.index import rows_of
from recognition.datasets import Source, cache_roads
from recognition.maneuvers.units import Samples, extract_from
from schemas.commands.options import Bar
from schemas.errors import ToolchainError

MODEL = "model"
"""Folder in the output folder with the model as it is after the recordings: the classes discovered in them are known to it"""


def catalogue(paths: Sequence[Path], folder: Path, model: Path | None, bar: Bar, keep: Path | None = None) -> Recognised:
    """Make a catalogue of recordings.

    Args:
        paths: recordings.
        folder: of the catalogue.
        model: folder of the model; None for the rules alone.
        keep: folder for the model as it is afterwards; None to forget it.
    """
    if model is None:
        summary = build(paths, folder, CatalogueSettings(), ByRules, bar)
    else:
        from recognition.catalogue.recognisers.model import load

        recogniser = load(model)
        summary = build(paths, folder, CatalogueSettings(), lambda: recogniser, bar)
        if keep is not None:
            recogniser.keep(keep, waiting=False)  # so that what runs show is not clustered with the unknown of these recordings
    return Recognised(
        classes=dict(sorted(summary.classes.items())),
        states=dict(sorted(Counter(row["state"] for row in rows_of(folder)).items())),
        failures={name: str(error) for name, error in summary.failures.items()},
        edited=summary.edited,
    )


def units(sources: Sequence[Source], path: Path, bar: Bar) -> Measured:
    """Extract the parameters of the recordings' manoeuvres and write them as a table."""
    parts, failures = [], {}
    with bar("measuring manoeuvres", len(sources)) as advance:
        for source in sources:
            try:
                parts.append(extract_from(source, cache_roads()))
            except ToolchainError as error:
                failures[source.name] = str(error)
            advance(1)
    samples = Samples.joined(parts) if parts else None
    if samples is not None:
        samples.write(path)
    kinds = Counter(samples.kinds.tolist()) if samples is not None else Counter()
    return Measured(kinds=dict(sorted(kinds.items())), failures=failures)
