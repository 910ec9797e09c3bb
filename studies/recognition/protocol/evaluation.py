"""All experiments of an evaluation, one result after the other; what is there
already is not made again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from recognition.trfe.encoder.config import preset
from recognition.trfe.inputs.grids import Grid
from recognition.trfe.inputs.samples import BACKGROUND
from recognition.trfe.training import Unit
from recognition.trfe.training.windows import (
    Split,
    View,
    Windows,
    fingerprint,
    source_of,
    split,
    windows_at,
)
from studies.recognition.ablations import CHAINED, VARIANTS
from studies.recognition.experiments import clustering, open_set, open_world, sensitivity
from studies.recognition.protocol import pixels
from studies.recognition.protocol.presets import PRESETS
from studies.recognition.protocol.rounds import Round, rounds
from studies.recognition.protocol.store import Key, Store
from studies.recognition.protocol.trials import Trial, Trials

EXPERIMENTS: dict[str, tuple[str, ...]] = {
    "open-set": tuple(open_set.TITLES),
    "clustering": tuple(clustering.TITLES),
    "open-world": tuple(VARIANTS),
    "chain": CHAINED,
    "sensitivity": ("delta", "trees"),
    "probe": ("encoder",),
}
"""Kinds of experiments with the names of what each compares."""
_OF_GRIDS = ("stae-kmeans", "stae-linkage")
"""Methods that need grids."""
_OF_TOKENS = (
    open_set.MAP_ONLY,
    open_set.ONLY_CHANGES,
    open_set.WITHOUT_ROLES,
    *open_set.PLAIN,
    open_set.ONLY_ENCODED,
    open_set.ON_ALL,
    open_set.ENCODED_ON_ALL,
    *open_set.END_TO_END,
)
"""Methods that need tokens."""
_OF_ENCODERS = tuple(name for name, variant in VARIANTS.items() if variant.learns)
"""Variants that need an encoder."""


@dataclass(frozen=True)
class ProtocolSettings:
    """Settings that make results comparable: only results of the same settings share a folder.

    Attributes:
        events_per_class: to which classes are thinned; None takes all.
        preset: of the encoder, or `pca`, see `studies.recognition.protocol.pixels`.
        unit: what is never divided between training and test.
        view: what is drawn of each window.
    """

    events_per_class: int | None = 400
    preset: str = "cpu"
    unit: Unit = "recording"
    view: View = field(default_factory=Grid)


class Evaluation:
    """An evaluation in a folder.

    Args:
        path: windows or recordings.
        out: folder of results and caches.
        settings: what makes results comparable.

    Raises:
        InvalidFile: nothing to evaluate on.
        UsageError: the folder holds results of other settings or windows.
    """

    def __init__(self, path: Path, out: Path, settings: ProtocolSettings) -> None:
        chosen = None if settings.preset == pixels.PRESET else preset(settings.preset, PRESETS)
        self.settings, self.store, self.cache = settings, Store(out), out / "cache"
        configuration = {**asdict(settings), "recordings": source_of(path)}
        self.store.check(configuration)
        self.windows: Windows = windows_at(
            path, self.cache / "windows", settings.view, settings.events_per_class
        )
        self.store.open({**configuration, "windows": fingerprint(self.windows)})
        self._splits: dict[int, Split] = {}
        self._trials = Trials(self.windows, settings.view, chosen, self.cache)

    def split(self, seed: int) -> Split:
        """The split of a seed."""
        if seed not in self._splits:
            self._splits[seed] = split(
                self.windows, seed, self.settings.unit, self.settings.events_per_class
            )
        return self._splits[seed]

    def rounds(self, seed: int) -> list[Round]:
        """The rounds of a seed, over the classes that are in every part of its split."""
        labels = np.unique(self.windows.labels[self.split(seed).test])
        return rounds(labels[labels != BACKGROUND].tolist())

    def trial(self, seed: int, number: int) -> Trial:
        """The trial of a round (from 1) of a seed."""
        return self._trials.trial(self.split(seed), self.rounds(seed)[number - 1], seed)

    def pending(
        self, seeds: int, kinds: Sequence[str], names: Sequence[str] | None = None, first: int = 0
    ) -> list[Key]:
        """Results that are not there yet, in the order in which `run` makes them.

        Args:
            seeds: how many, from the first.
            kinds: some of `EXPERIMENTS`.
            names: of methods and variants; all by default.
        """
        skipped = _OF_TOKENS if isinstance(self.settings.view, Grid) else _OF_GRIDS
        if self.settings.preset == pixels.PRESET:
            skipped = (*skipped, *_OF_ENCODERS)
        keys = [
            Key(kind, name, seed, one.number)
            for seed in range(first, first + seeds)
            for one in self.rounds(seed)
            for kind in kinds
            for name in EXPERIMENTS[kind]
            if (names is None or name in names) and name not in skipped
        ]
        return [key for key in keys if not self.store.has(key)]

    def run(self, pending: Sequence[Key]) -> Iterator[Key]:
        """Make results; each is given back when it is on disk."""
        trial: Trial | None = None
        for key in pending:
            if self.store.has(key):  # a chain makes the results of all its rounds
                yield key
                continue
            if trial is None or (trial.seed, trial.round.number) != (key.seed, key.round):
                trial = self.trial(key.seed, key.round)
            for made, values in self._measure(key, trial):
                self.store.write(made, values)
            yield key

    def _measure(self, key: Key, trial: Trial) -> list[tuple[Key, dict[str, Any]]]:
        """Results of an experiment. They differ in what they take, and the report has a table for
        each: no kinds by module.
        """
        match key.kind:
            case "open-set":
                values = open_set.measure_open_set(key.method, trial)
            case "clustering":
                values = clustering.measure_clustering(key.method, trial)
            case "open-world":
                values = open_world.measure_open_world(key.method, trial)
            case "chain":
                links = open_world.measure_chain(
                    key.method, self.trial(key.seed, 1), self.rounds(key.seed)
                )
                return [(key._replace(round=number), link) for number, link in enumerate(links, 1)]
            case "sensitivity":
                values = (
                    sensitivity.measure_delta
                    if key.method == "delta"
                    else sensitivity.measure_trees
                )(trial)
            case _:
                values = sensitivity.measure_probe(trial, self.settings.view)
        return [(key, values)]
