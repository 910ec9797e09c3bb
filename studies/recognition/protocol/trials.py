"""Inputs of the methods in one round: frozen features of one encoder for each
seed and round, kept on disk.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from recognition.trfe.config import Config, Steps
from recognition.trfe.discovery.candidates import Preprocessing
from recognition.trfe.encoder.config import Architecture, Preset, TrainingSchedule
from recognition.trfe.forest import TREES, VotingForest, grow
from recognition.trfe.forest.known import DELTA, KnownClasses, Labelled, learn
from recognition.trfe.inputs.samples import UNKNOWN, Features, drawn_of_each
from recognition.trfe.inputs.tokens import CHANGES, MOTION_CHANGES, Tokens, changes
from recognition.trfe.training.windows import Split, View, Windows
from recognition.trfe.trfe import TRFE
from schemas.common.array_types import IntArray
from schemas.common.storage import read_object, write_object
from studies.recognition.baselines.clustering.pool import Pool
from studies.recognition.plain import static
from studies.recognition.protocol.pixels import pixel_features
from studies.recognition.protocol.rounds import FIRST, STEP, Round
from studies.recognition.strategies import grow_plain

if TYPE_CHECKING:
    from recognition.trfe.encoder.model import Encoder

_PRETRAINING, _FINETUNING = 100, 100
"""Fewest steps of each training of the encoder."""
MOST_FITTED = 400
"""Training samples of each class that methods are fitted on, as forests of more take hours at paper
scale; the encoder learns from all."""


class Samples(NamedTuple):
    """Features (n, d), labels (n,), and the numbers (n,) of the windows that they are of."""

    features: Features
    labels: IntArray
    rows: IntArray

    def only(self, chosen: NDArray[Any] | slice) -> Samples:
        """Select samples by a mask, index or slice."""
        return Samples(self.features[chosen], self.labels[chosen], self.rows[chosen])


@dataclass(frozen=True, eq=False)
class Trial:
    """One round of one seed.

    Attributes:
        windows: all of them.
        split: the seed's.
        round: which classes are known and new.
        seed: of everything drawn.
        features: (n, d) of all windows in the split, by window number; those of others are 0.
        changes: how many columns, the first ones, are of what changes in a window of tokens.
        tuned: how many of the encoders' columns, which follow, are of the encoder before
            fine-tuning.
        trials: what made it.
    """

    windows: Windows
    split: Split
    round: Round
    seed: int
    features: Features
    changes: int
    tuned: int
    trials: Trials

    @cached_property
    def pretrained_on_all(self) -> Trial:
        """The same by encoders whose pretraining saw windows of all classes,
        also those that are unknown.
        """
        return replace(self.trials, on_all=True).trial(self.split, self.round, self.seed)

    @cached_property
    def beside_inputs(self) -> Trial:
        """The same with the inputs of windows, flattened, in place of features
        of the fine-tuned encoder.
        """
        kept = self.features[:, : self.changes + self.tuned]
        inputs = self.windows.inputs
        features = np.zeros((len(kept), kept.shape[1] + inputs[0].size), dtype=np.float32)
        rows = np.sort(np.concatenate(self.split[:4]))
        features[rows] = np.concatenate([kept[rows], inputs[rows].reshape(len(rows), -1)], axis=1)
        return replace(self, features=features)

    @property
    def pretrained(self) -> Encoder:
        """The encoder of the seed before any fine-tuning."""
        return self.trials.encoder(self.split, _before_all(self.round), self.seed)

    @property
    def encoder(self) -> Encoder:
        """The encoder of the round, fine-tuned to the classes that are known."""
        return self.trials.encoder(self.split, self.round, self.seed)

    @cached_property
    def numbered(self) -> Trial:
        """The same with the numbers of windows (n, 1) in place of features, for
        methods that change what they read of them.
        """
        return replace(self, features=np.arange(len(self.windows), dtype=np.float32)[:, None])

    def tuned_again(
        self, encoder: Encoder, rows: IntArray, labels: IntArray
    ) -> tuple[Encoder, Features]:
        """The encoder fine-tuned to windows with these numbers (n,) and labels (n,), and features
        (all windows, dim) by it.
        """
        return self.trials.tuned_again(self.split, encoder, rows, labels, self.seed)

    @cached_property
    def only_encoded(self) -> Trial:
        """The same with the encoders' features alone."""
        return replace(
            self, features=np.ascontiguousarray(self.features[:, self.changes :]), changes=0
        )

    @cached_property
    def only_tuned(self) -> Trial:
        """The same with features of the fine-tuned encoder alone."""
        return replace(
            self.only_encoded,
            features=np.ascontiguousarray(self.only_encoded.features[:, self.tuned :]),
            tuned=0,
        )

    @cached_property
    def only_changes(self) -> Trial:
        """The same with what changes in windows of tokens alone."""
        return replace(
            self, features=np.ascontiguousarray(self.features[:, : self.changes]), tuned=0
        )

    @cached_property
    def without_roles(self) -> Trial:
        """The same with the changes of motion and gap alone, without the roles of lanes."""
        return replace(
            self,
            features=np.ascontiguousarray(self.features[:, :MOTION_CHANGES]),
            changes=MOTION_CHANGES,
            tuned=0,
        )

    @cached_property
    def map_only(self) -> Trial:
        """The same with what the map alone tells in place of features, see
        `studies.recognition.plain.static`.
        """
        return replace(self, features=static(self.windows.inputs), tuned=0, changes=0)

    @cached_property
    def labelled(self) -> Samples:
        """Training samples of the known classes, of each at most as many as
        methods are fitted on.
        """
        rows = self._rows(self.split.labelled, self.round.known)
        drawn = drawn_of_each(
            self.windows.labels[rows], MOST_FITTED, np.random.default_rng(self.seed)
        )
        return self._samples(rows[np.sort(drawn)])

    @cached_property
    def validation(self) -> Samples:
        """Validation samples of the known classes."""
        return self._samples(self._rows(self.split.validation, self.round.known))

    @cached_property
    def test(self) -> Samples:
        """Test samples of the known and new classes, with their true labels."""
        return self._samples(self._rows(self.split.test, self.round.known + self.round.new))

    @cached_property
    def truth(self) -> IntArray:
        """Labels of the test samples for a method that knows the known classes:
        0 for the new ones.
        """
        return np.where(np.isin(self.test.labels, self.round.known), self.test.labels, UNKNOWN)

    @cached_property
    def stream(self) -> Samples:
        """Samples that arrive without labels in the round: all training samples of the new classes,
        and held-back known ones; mixed."""
        new = self._rows(np.concatenate([self.split.labelled, self.split.stream]), self.round.new)
        rows = np.concatenate([new, self._rows(self.split.stream, self.round.known)])
        return self._samples(
            np.random.default_rng([self.seed, self.round.number]).permutation(rows)
        )

    @cached_property
    def appearing(self) -> Samples:
        """The first samples of new classes in the stream, as many as TRFE's buffer holds: as if
        screening made no mistake.
        """
        return self.stream.only(np.isin(self.stream.labels, self.round.new)).only(
            slice(Preprocessing().capacity)
        )

    @cached_property
    def pool(self) -> Pool:
        """The same for clustering methods."""
        new, known = self.appearing, self.labelled
        inputs = self.windows.inputs[new.rows]
        return Pool(
            new.features, inputs, known.features, known.labels, len(self.round.new), self.config
        )

    @property
    def config(self) -> Config:
        """ProtocolSettings of TRFE in this trial."""
        return Config(seed=self.seed, changes=self.changes, pretrained=self.tuned)

    @cached_property
    def model(self) -> TRFE:
        """TRFE fitted on the known classes."""
        held = self.validation
        return TRFE(self.config).fit(*self.labelled[:2], held.features, held.labels)

    @cached_property
    def known(self) -> KnownClasses:
        """The known classes of `model` under any δ, for what does not look at it."""
        held, forest = self.validation, self.forest
        return learn(
            Labelled(*self.labelled[:2]),
            Labelled(held.features, held.labels),
            replace(self.config, delta=DELTA),
            Steps(grow=lambda *_, **__: forest),
        )

    @cached_property
    def delta(self) -> float:
        """δ of `model`, kept on disk: to choose it takes a forest for each class."""
        path = self.trials.folder(self.seed) / f"delta{self.round.number}.json"
        if not path.exists():
            write_object({"delta": 1.0 - self.model.known.screening.threshold}, path)
        return float(read_object(path, "remove it to have it made again")["delta"])

    @cached_property
    def forest(self) -> VotingForest:
        """The forest of `model`, without the δ that takes a forest for each class to choose."""
        return grow(*self.labelled[:2], trees=TREES, seed=self.seed)

    @cached_property
    def plain_forest(self) -> VotingForest:
        """A forest fitted on the known classes, whose trees see features alone:
        the baselines that vote share it.
        """
        return grow_plain(*self.labelled[:2], trees=TREES, seed=self.seed)

    def _rows(self, rows: IntArray, classes: tuple[int, ...]) -> IntArray:
        return rows[np.isin(self.windows.labels[rows], classes)]

    def _samples(self, rows: IntArray) -> Samples:
        return Samples(self.features[rows], self.windows.labels[rows], rows)


@dataclass(frozen=True, eq=False)
class Trials:
    """Makes trials; encoders and features are made once and kept in a folder.

    One encoder is pretrained for each seed on training windows of the first known classes, without
    labels. In each round it is fine-tuned further, from the checkpoint of the round before, on the
    labelled windows of the classes known by then. All methods share its features, with those that
    it had before fine-tuning beside them, and of tokens with what changes in a window.

    Attributes:
        windows: all of them. view: theirs. cache: the folder.
        preset: of the encoder; without one, features are those of
            `studies.recognition.protocol.pixels`.
        on_all: pretrain on windows of all classes instead, as an ablation: unknown ones are not
            unseen then.
    """

    windows: Windows
    view: View
    preset: Preset | None
    cache: Path
    on_all: bool = False

    def trial(self, split: Split, round_: Round, seed: int) -> Trial:
        """The trial of a round of a seed."""
        rows = np.sort(np.concatenate(split[:4]))
        before = _before_all(round_)
        parts = [
            self._features(rows, split, one, seed)
            for one in ((before, round_) if self.preset else (before,))
        ]
        tuned = sum(part.shape[1] for part in parts[:-1])
        if isinstance(self.view, Tokens):
            parts = [changes(self.windows.inputs[rows]), *parts]
        made = np.concatenate(parts, axis=1)
        features = np.zeros((len(self.windows), made.shape[1]), dtype=np.float32)
        features[rows] = made
        return Trial(
            self.windows,
            split,
            round_,
            seed,
            features,
            CHANGES if isinstance(self.view, Tokens) else 0,
            tuned,
            self,
        )

    def _features(self, rows: IntArray, split: Split, round_: Round, seed: int) -> Features:
        """Features of windows by the encoder of a round, or by principal
        components, which are the same in all rounds.
        """
        path = self.folder(seed) / f"encoded{round_.number}.npy"
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            draft = path.with_suffix(".draft.npy")
            np.save(draft, self._encode(rows, split, round_, seed))
            draft.replace(path)
        return np.load(path, allow_pickle=False)

    def _encode(self, rows: IntArray, split: Split, round_: Round, seed: int) -> Features:
        from recognition.trfe.encoder.storage import features

        if self.preset is None:
            training = np.sort(np.concatenate([split.labelled, split.stream]))
            return pixel_features(self.windows.inputs[training], self.windows.inputs[rows], seed)
        return features(self.encoder(split, round_, seed), self.windows.select(rows))

    def encoder(self, split: Split, round_: Round, seed: int) -> Encoder:
        """The encoder of a round of a seed; there is none without a preset."""
        from recognition.trfe.encoder.storage import load, save
        from recognition.trfe.encoder.training import finetune, pretrain

        preset = self.preset
        assert preset is not None, "principal components have no encoder"
        place = self.folder(seed) / f"encoder{round_.number}"
        if (place / "encoder.safetensors").exists():
            return load(
                place,
                type(preset.architecture)
                if isinstance(preset.architecture, Architecture)
                else Architecture,
            )
        if round_.number == 0:
            rows = np.sort(np.concatenate([split.labelled, split.stream]))
            training = self.windows.select(
                rows if self.on_all else rows[np.isin(self.windows.labels[rows], round_.known)]
            )
            longer = long_enough(preset.pretraining, len(training), _PRETRAINING)
            made = pretrain(training, preset._replace(pretraining=longer), self.view, seed)
        else:
            before = (
                Round(round_.number - 1, round_.known[:-STEP], ())
                if round_.number > 1
                else _before_all(round_)
            )
            known = self.windows.select(
                split.labelled[np.isin(self.windows.labels[split.labelled], round_.known)]
            )
            longer = long_enough(preset.finetuning, len(known), _FINETUNING)
            made = finetune(self.encoder(split, before, seed), known, longer, seed)
        save(made, place)
        return made

    def tuned_again(
        self, split: Split, encoder: Encoder, rows: IntArray, labels: IntArray, seed: int
    ) -> tuple[Encoder, Features]:
        """See `Trial.tuned_again`; features of windows outside the split are 0."""
        from recognition.trfe.encoder.storage import features
        from recognition.trfe.encoder.training import finetune

        assert self.preset is not None, "principal components have no encoder"
        known = replace(self.windows.select(rows), labels=labels)
        tuned = finetune(
            encoder, known, long_enough(self.preset.finetuning, len(known), _FINETUNING), seed
        )
        used = np.sort(np.concatenate(split[:4]))
        found = np.zeros((len(self.windows), tuned.architecture.dim), dtype=np.float32)
        found[used] = features(tuned, self.windows.select(used))
        return tuned, found

    def folder(self, seed: int) -> Path:
        """The folder of what is kept of a seed."""
        return self.cache / (f"seed{seed}-all" if self.on_all else f"seed{seed}")


def _before_all(round_: Round) -> Round:
    """Before the first round the encoder is only pretrained, on the classes that are known then: it
    has seen no unknown ones.
    """
    return Round(0, round_.known[:FIRST], ())


def long_enough(schedule: TrainingSchedule, windows: int, steps: int) -> TrainingSchedule:
    """The schedule with so many epochs that few windows make as many steps too;
    presets are made for the paper's scale.
    """
    return schedule._replace(
        epochs=max(schedule.epochs, math.ceil(steps * schedule.batch / windows))
    )
