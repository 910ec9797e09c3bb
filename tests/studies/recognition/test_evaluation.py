"""The whole protocol on made-up features: resumed, repeated, refused, reported."""

from __future__ import annotations

import csv
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from recognition.trfe.encoder.config import Preset, TokenArchitecture, TrainingSchedule
from recognition.trfe.encoder.model import Encoder, untrained
from recognition.trfe.inputs.grids import Grid
from recognition.trfe.inputs.samples import Features
from recognition.trfe.inputs.tokens import CHANGES, MOTION_CHANGES, Tokens, changes
from recognition.trfe.training.windows import Split, Windows
from schemas.common.array_types import IntArray
from schemas.common.errors import UsageError
from studies.recognition.ablations import VARIANTS
from studies.recognition.baselines.open_set.logistic import Logistic
from studies.recognition.experiments import open_set
from studies.recognition.experiments.open_world import begin
from studies.recognition.learning import LearningTRFE
from studies.recognition.protocol.command import protocol
from studies.recognition.protocol.evaluation import Evaluation, ProtocolSettings
from studies.recognition.protocol.processes import run_beside
from studies.recognition.protocol.rounds import Round
from studies.recognition.protocol.trials import Trial, Trials
from studies.recognition.report.report import write_report
from studies.recognition.report.tables import comparison

GRID = Grid(length=8.0, width=4.0)
CLASSES = [1, 2, 3, 4, 5, 7, 8, 9]
KINDS = ["open-set", "clustering", "open-world", "chain", "sensitivity"]
NAMES = ["trfe", "mls", "vote-threshold", "random", "kmeans"]


@pytest.fixture(scope="module")
def windows(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Windows of twelve recordings, whose features would tell their classes."""
    labels = np.tile(np.repeat(CLASSES, 8), 12)
    recordings = np.repeat([f"recording {number:02}" for number in range(12)], 8 * len(CLASSES))
    grids = np.zeros((len(labels), *GRID.shape), dtype=np.uint8)
    folder = tmp_path_factory.mktemp("windows")
    egos = np.arange(len(labels)).astype(np.str_)
    Windows(
        grids, labels.astype(np.int64), recordings, egos, np.arange(len(labels), dtype=float)
    ).save(folder)
    return folder


@pytest.fixture(autouse=True)
def encoder(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Clouds in the place of the encoder's features; the rounds for which they were asked."""
    asked: list[int] = []

    def features(self: Trials, rows: IntArray, split: Split, round_: Round, seed: int) -> Features:
        asked.append(round_.number)
        noise = np.random.default_rng([seed, round_.number]).standard_normal((len(rows), 12))
        centres = np.stack(
            [5.0 * np.random.default_rng(label).standard_normal(12) for label in range(20)]
        )
        return (centres[self.windows.labels[rows]] + noise).astype(np.float32)

    monkeypatch.setattr(Trials, "_encode", features)
    return asked


def run(
    windows: Path, out: Path, seeds: int = 1, names: list[str] = NAMES, kinds: list[str] = KINDS
) -> Evaluation:
    evaluation = Evaluation(windows, out, ProtocolSettings(None, view=GRID))
    for _ in evaluation.run(evaluation.pending(seeds, kinds, names)):
        pass
    write_report(evaluation, out)
    return evaluation


def table(out: Path, name: str) -> list[list[str]]:
    with (out / "tables" / f"{name}.csv").open(newline="") as file:
        return list(csv.reader(file))


def test_classes_that_lie_apart_are_recognised_and_found(windows: Path, tmp_path: Path) -> None:
    evaluation = Evaluation(windows, tmp_path, ProtocolSettings(None, view=GRID))
    first = [
        key for key in evaluation.pending(1, KINDS, NAMES) if key.round == 1
    ]  # a chain is one of all rounds
    for _ in evaluation.run(
        [key for key in first if (key.kind, key.method) != ("open-world", "trfe")]
    ):
        pass
    write_report(evaluation, tmp_path)
    open_set = {row[0]: float(row[1]) for row in table(tmp_path, "open-set")[1:]}
    clustering = {row[0]: float(row[1]) for row in table(tmp_path, "clustering")[1:]}
    chain = {row[0]: float(row[1]) for row in table(tmp_path, "chain")[1:]}
    ((_, open_world, *_),) = table(tmp_path, "open-world")[1:]
    assert open_set["**TRFE**"] > 0.8 > 0.5 > open_set["random"]
    assert clustering["k-means on features, given K"] > 0.95 > 0.8 > clustering["random"]
    assert chain["**TRFE**"] > 0.6
    assert float(open_world) > 0.6


def test_interrupted_evaluation_goes_on_and_ends_in_the_same_bytes(
    windows: Path, tmp_path: Path, encoder: list[int]
) -> None:
    names, kinds = ["vote-threshold", "random", "kmeans"], ["open-set", "clustering", "sensitivity"]
    run(windows, tmp_path / "whole", 2, names, kinds)
    asked = len(encoder)
    evaluation = Evaluation(windows, tmp_path / "parts", ProtocolSettings(None, view=GRID))
    pending = evaluation.pending(2, kinds, names)
    making = evaluation.run(pending)
    for _ in range(3):
        next(making)
    making.close()
    assert (
        len(
            Evaluation(windows, tmp_path / "parts", ProtocolSettings(None, view=GRID)).pending(
                2, kinds, names
            )
        )
        == len(pending) - 3
    )
    run(windows, tmp_path / "parts", 2, names, kinds)
    for name in ("report.md", "results.csv", "tables/open-set.csv"):
        assert (tmp_path / "parts" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    assert len(encoder) == 2 * asked  # features of each round and seed are made once


def test_seeds_beside_each_other_end_in_the_same_bytes_as_one_after_the_other(
    windows: Path, tmp_path: Path
) -> None:
    names, settings, written = (
        ["mls", "vote-threshold", "kmeans"],
        ProtocolSettings(None, view=GRID),
        [],
    )
    for processes in (1, 3):
        out = tmp_path / str(processes)
        evaluation = Evaluation(windows, out, settings)
        pending = evaluation.pending(2, ["open-set", "clustering"], names)
        assert list(run_beside(windows, out, settings, pending, processes))[-1] == len(pending)
        written.append([(key, evaluation.store.read(key)) for key in pending])
    assert written[0] == written[1]  # with more processes than seeds, rounds and kinds too


def test_what_clustering_looks_at_is_the_same_under_any_delta(
    windows: Path, tmp_path: Path
) -> None:
    trial = Evaluation(windows, tmp_path, ProtocolSettings(None, view=GRID)).trial(0, 1)
    chosen, any_delta = trial.model.known, trial.known
    seen = trial.test.features
    assert (chosen.forest.vote(seen).counts == any_delta.forest.vote(seen).counts).all()
    assert (chosen.prototypes.ratio(seen) == any_delta.prototypes.ratio(seen)).all()
    assert trial.delta == chosen.screening.delta


def test_a_process_that_dies_is_reported(
    windows: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Trials, "_encode", lambda *_: os._exit(1))
    settings = ProtocolSettings(None, view=GRID)
    pending = Evaluation(windows, tmp_path, settings).pending(2, ["open-set"], ["random"])
    with pytest.raises(UsageError, match="--jobs"):
        list(run_beside(windows, tmp_path, settings, pending, 2))


def test_other_settings_and_other_windows_are_refused_in_the_same_folder(
    windows: Path, tmp_path: Path
) -> None:
    run(windows, tmp_path / "out", names=["random"])
    with pytest.raises(UsageError, match=r"other settings \(events_per_class\)"):
        Evaluation(windows, tmp_path / "out", ProtocolSettings(50, view=GRID))
    Windows.load(windows).select(slice(0, 400)).save(tmp_path / "fewer")
    with pytest.raises(UsageError, match=r"other settings \(windows\)"):
        Evaluation(tmp_path / "fewer", tmp_path / "out", ProtocolSettings(None, view=GRID))


def of_tokens(folder: Path) -> Trial:
    """The first round on windows of tokens."""
    view, labels = Tokens(), np.tile(np.repeat(CLASSES, 2), 8)
    inputs = np.random.default_rng(0).standard_normal((len(labels), *view.shape)).astype(np.float16)
    recordings, egos = (
        np.repeat(np.arange(8), 2 * len(CLASSES)).astype(np.str_),
        np.arange(len(labels)).astype(np.str_),
    )
    Windows(inputs, labels, recordings, egos, np.arange(len(labels), dtype=float)).save(
        folder / "windows"
    )
    return Evaluation(
        folder / "windows", folder, ProtocolSettings(None, "tokens", view=view)
    ).trial(0, 1)


def test_methods_see_what_changes_in_tokens_beside_what_encoders_read(tmp_path: Path) -> None:
    trial = of_tokens(tmp_path)
    seen, rows = trial.labelled.features, trial.labelled.rows
    assert (seen[:, : trial.changes] == changes(trial.windows.inputs[rows])).all()
    assert (trial.config.changes, trial.config.pretrained, seen.shape[1]) == (
        CHANGES,
        12,
        CHANGES + 2 * 12,
    )
    assert (
        trial.only_encoded.labelled.features == seen[:, CHANGES:]
    ).all() and not trial.only_encoded.config.changes
    assert (trial.only_tuned.labelled.features == seen[:, CHANGES + 12 :]).all()
    assert (trial.only_changes.labelled.features == seen[:, :CHANGES]).all()
    assert (
        trial.without_roles.labelled.features == seen[:, :MOTION_CHANGES]
    ).all() and MOTION_CHANGES < CHANGES
    inputs = trial.beside_inputs.labelled.features[:, CHANGES + 12 :]
    assert (inputs == trial.windows.inputs[rows].reshape(len(rows), -1)).all()


def test_plain_methods_look_at_what_changes_alone(tmp_path: Path) -> None:
    trial = of_tokens(tmp_path)
    widths = {name: open_set.seen_by(name, trial).test.features.shape[1] for name in open_set.PLAIN}
    assert widths == {
        "logistic-changes": CHANGES,
        "logistic-without-roles": MOTION_CHANGES,
        "knn-changes": CHANGES,
    }
    fitted, held = (
        part._replace(features=part.features[:, :CHANGES])
        for part in (trial.labelled, trial.validation)
    )
    alone = Logistic(0).fit(fitted.features, fitted.labels, held.features, held.labels)
    assert open_set.measure_open_set("logistic-changes", trial)["threshold"] == alone.threshold


def test_pretraining_sees_known_classes_alone_unless_all_are_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []

    def pretrain(windows: Windows, preset: Preset, view: Tokens, seed: int) -> Encoder:
        seen.append(np.unique(windows.labels).tolist())
        return untrained(preset.architecture, view)

    monkeypatch.setattr("recognition.trfe.encoder.training.pretrain", pretrain)
    trial = of_tokens(tmp_path)
    for one in (trial, trial.pretrained_on_all, trial):  # the third is the first again, from disk
        assert one.pretrained.view == Tokens()
    assert seen == [CLASSES[:2], CLASSES]


def test_windows_of_another_grid_are_refused(windows: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="not of the shape"):
        Evaluation(windows, tmp_path, ProtocolSettings(None))


def test_grids_have_the_chosen_channels(windows: Path, tmp_path: Path) -> None:
    with pytest.raises(
        UsageError, match=re.escape(f"not of the shape {Grid(channels=('others', 'area')).shape}")
    ):
        protocol(windows, tmp_path, channels=["area", "others"])


@pytest.mark.parametrize(
    ("option", "word"),
    [
        ({"scale": "huge"}, "scale"),
        ({"methods": ["magic"]}, "method"),
        ({"experiments": ["magic"]}, "experiment"),
        ({"channels": ["magic"]}, "channel"),
    ],
)
def test_unknown_choices_are_named_with_the_known_ones(
    tmp_path: Path, option: dict[str, object], word: str
) -> None:
    with pytest.raises(UsageError, match=f"there is no {word}"):
        protocol(tmp_path, tmp_path / "out", **option)  # type: ignore[arg-type]


def test_reported_seeds_are_others_than_those_of_development(windows: Path, tmp_path: Path) -> None:
    evaluation = Evaluation(windows, tmp_path, ProtocolSettings(None, view=GRID))
    keys = evaluation.pending(3, ["open-set"], ["trfe", "trfe-own-rule", "random"], first=10)
    assert {key.seed for key in keys} == {10, 11, 12}
    for _ in evaluation.run([key for key in keys if key.round == 1]):
        pass
    write_report(evaluation, tmp_path)
    header, *rows = table(tmp_path, "open-set")
    p = {row[0]: row[header.index("p")] for row in rows}
    assert p["**TRFE**"] == "–" and float(p["random"]) < 0.05
    assert "seeds 10, 11, 12" in (tmp_path / "report.md").read_text()


def test_rows_are_compared_by_the_figure_that_is_tested() -> None:
    rounds = {
        name: {seed: {1: {"a": a + seed, "b": b + seed % 2}} for seed in range(4)}
        for name, a, b in (("trfe", 0.0, 0.0), ("other", 0.0, 2.0))
    }
    rounds["other"][0][1]["b"] = 2.5
    for tested, different in (("a", False), ("b", True)):
        *_, (*_, seeds, p) = comparison(rounds, {}, {"a": "A", "b": "B"}, tested)[1]
        assert seeds == "4" and (p != "–" and float(p) < 0.01) == different


def test_the_encoder_learns_on_with_what_is_discovered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trial = of_tokens(tmp_path)
    small = Preset(TokenArchitecture(12, 1, 2, frame=8), *2 * (TrainingSchedule(1, 64, 1e-2),))
    monkeypatch.setattr("studies.recognition.learning._EPOCHS", 2)
    trial = replace(trial, trials=replace(trial.trials, preset=small, cache=tmp_path / "small"))
    trial = trial.trials.trial(trial.split, trial.round, trial.seed)
    made = begin(VARIANTS["joint-retrained"], trial)
    assert isinstance(made, LearningTRFE)
    plain = begin(VARIANTS["trfe"], trial)
    seen = trial.numbered
    rows = seen.stream.rows
    assert (made.encode(seen.stream.features) == trial.features[rows]).all()
    assert (
        made.recognise(seen.test.features).labels == plain.recognise(trial.test.features).labels
    ).all()
    made.buffer.add(trial.features[rows], rows)
    found = made.discover()
    new = np.where(np.isin(trial.windows.labels[rows], trial.round.new[:1]), 101, 0)
    made.expand(found._replace(labels=new))
    assert 101 in made.known.classes
    before, after = trial.features, made.features
    tuned = trial.changes + trial.tuned
    assert (after[:, :tuned] == before[:, :tuned]).all()
    assert (after[rows, tuned:] != before[rows, tuned:]).any()
    assert made.encoder.classes == tuple(made.known.classes)
    assert not np.isin(made.buffer.keys, rows[new > 0]).any()
    assert (made.buffer.inputs == after[made.buffer.keys]).all()
