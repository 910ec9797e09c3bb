"""`xosc-recognize train`: a model, its card, and that it recognises recordings."""

from __future__ import annotations

import json
import re
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from recognition import xosc_recognize
from recognition.catalogue.pipeline import SHIPPED
from recognition.labels import Label
from recognition.trfe.encoder.config import PRESETS, Preset, TokenArchitecture, TrainingSchedule
from recognition.trfe.encoder.model import Encoder, untrained
from recognition.trfe.forest.known import title_of
from recognition.trfe.forest.screening import EvtScreening
from recognition.trfe.inputs.samples import BACKGROUND
from recognition.trfe.inputs.tokens import FEATURES, Tokens
from recognition.trfe.storage import load
from recognition.trfe.training.card import CARD, LIMITS, decision, scope
from recognition.trfe.training.windows import Windows
from recognition.trfe.trfe import TRFE
from tests.recognition import motorway

CLASSES = (Label.FREE_CRUISE, Label.CUT_IN)


def windows(folder: Path, recordings: int = 8, of_each: int = 12) -> Path:
    """Windows of two classes that are told apart by where others are."""
    random = np.random.default_rng(0)
    labels = np.tile(np.repeat(CLASSES, of_each), recordings).astype(np.int64)
    inputs = random.normal(0.0, 0.2, (len(labels), *Tokens().shape)).astype(np.float16)
    inputs[labels == Label.CUT_IN, 1, :, FEATURES.index("lanes_left")] += 1.0
    inputs[:, 5:] = np.nan
    names = np.repeat([f"r{number}" for number in range(recordings)], len(CLASSES) * of_each)
    Windows(inputs, labels, names, names, np.arange(len(labels), dtype=float)).save(folder)
    return folder


def call(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["xosc-recognize", *map(str, arguments)])
    with pytest.raises(SystemExit) as end:
        xosc_recognize.main()
    return int(end.value.code or 0)


def delta(model: TRFE) -> float:
    assert isinstance(model.known.screening, EvtScreening)
    return model.known.screening.delta


@pytest.mark.slow
def test_a_model_is_trained_and_recognises(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tiny = Preset(
        TokenArchitecture(dim=32, depth=1, heads=2),
        TrainingSchedule(1, 64, 1e-3),
        TrainingSchedule(8, 32, 3e-3),
    )
    monkeypatch.setitem(PRESETS, "tokens", tiny)
    given = windows(tmp_path / "windows")
    code = call(monkeypatch, "train", given, "--out", tmp_path / "model", "--events-per-class", 96)
    assert code == 0
    card = (tmp_path / "model" / "README.md").read_text()
    assert capsys.readouterr().out == card + "\n"
    assert (
        "| highway free cruise |" in card
        and "| highway cut in |" in card
        and "100.0% right" in card
    )
    model = load(tmp_path / "model")
    assert (
        f"{model.config.trees} trees vote on 64 features of 2 encoders" in card
        and f"δ = {delta(model):.2g}." in card
    )
    assert all(
        f"\n## {title}\n" in card for title in ("How it decides", "Limits of use", "Licence")
    )
    motorway.write_motorway(tmp_path / "in")
    code = call(
        monkeypatch, tmp_path / "in", "--out", tmp_path / "out", "--model", tmp_path / "model"
    )
    assert code == 0
    rows = json.loads((tmp_path / "out" / "index.json").read_text())["scenarios"]
    assert {row["state"] for row in rows} <= {"known", "unknown", "discovered"}
    assert {row["nearest_class"] for row in rows} <= {label.title for label in CLASSES}
    assert all(0.0 <= row["confidence"] <= 1.0 for row in rows)
    assert {row["sorted_by"] for row in rows} == {
        "rules"
    } and "sorted by the rules" in capsys.readouterr().err
    assert all(row["class"] == row["rule_class"] for row in rows if row["rule_class"])


@pytest.mark.slow
def test_an_encoder_is_pretrained_on_recordings_without_labels_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tiny = Preset(
        TokenArchitecture(dim=8, depth=1, heads=2),
        TrainingSchedule(1, 64, 1e-3),
        TrainingSchedule(1, 64, 1e-3),
    )
    monkeypatch.setitem(PRESETS, "tokens", tiny)
    given, seen = windows(tmp_path / "windows"), []

    def pretrain(windows: Windows, preset: Preset, view: Tokens, seed: int, **_: object) -> Encoder:
        seen.append(windows)
        return untrained(preset.architecture, view)

    monkeypatch.setattr("recognition.trfe.encoder.training.pretrain", pretrain)
    motorway.write_motorway(tmp_path / "real")
    options = ("--events-per-class", 96, "--pretrain-on", tmp_path / "real", "--quiet")
    assert call(monkeypatch, "train", given, "--out", tmp_path / "model", *options) == 0
    assert "pretrained on real too" in (tmp_path / "model" / CARD).read_text()
    (together,) = seen
    names = set(together.recordings.tolist())
    assert names & set(Windows.load(given).recordings.tolist()) and any(
        name.startswith("real") for name in names
    )
    assert (
        call(
            monkeypatch,
            "train",
            given,
            "--out",
            tmp_path / "other",
            *options,
            "--encoders",
            tmp_path / "model",
        )
        == 2
    )
    assert "--pretrain-on" in capsys.readouterr().err


@pytest.mark.slow
def test_reviewers_verdicts_train_beside_the_rules_labels(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tiny = Preset(
        TokenArchitecture(dim=8, depth=1, heads=2),
        TrainingSchedule(1, 64, 1e-3),
        TrainingSchedule(1, 64, 1e-3),
    )
    monkeypatch.setitem(PRESETS, "tokens", tiny)
    given, table = windows(tmp_path / "windows"), tmp_path / "verdicts.csv"
    motorway.write_motorway(tmp_path / "real")
    rows = (
        "real/01,1,6.0,highway cut in,right",
        "real/01,3,6.0,highway cut in,right",
        "real/01,1,2.0,left lane change,right",
    )
    table.write_text("\n".join(("recording,vehicle,time,class,verdict", *rows)) + "\n")
    options = ("--events-per-class", 96, "--quiet", "--reviewed", tmp_path / "real")
    assert call(monkeypatch, "train", given, "--out", tmp_path / "model", *options) == 2
    assert "--reviewed and --verdicts belong together" in capsys.readouterr().err
    assert call(monkeypatch, "train", given, "--out", tmp_path / "plain", *options[:3]) == 0
    assert (
        call(
            monkeypatch, "train", given, "--out", tmp_path / "model", *options, "--verdicts", table
        )
        == 0
    )
    assert "and 2 windows of reviewers' verdicts on real" in " ".join(
        (tmp_path / "model" / CARD).read_text().split()
    )
    plain, model = (load(tmp_path / name).known.fitted.labels for name in ("plain", "model"))
    assert sorted([*plain.tolist(), Label.CUT_IN, Label.CUT_IN]) == sorted(model.tolist())


def test_a_faulty_table_of_verdicts_is_named_before_windows_are_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    motorway.write_motorway(tmp_path / "real")
    table, out = tmp_path / "verdicts.csv", tmp_path / "model"
    table.write_text("recording,vehicle,time,class,verdict\nreal/01,1,6.0,left turn,right\n")
    options = ("--reviewed", tmp_path / "real", "--verdicts", table)
    assert call(monkeypatch, "train", tmp_path / "real", "--out", out, *options) == 3
    assert "verdicts.csv:2: column class: 'left turn' is none of " in capsys.readouterr().err
    assert not out.exists()


def test_the_card_of_the_shipped_model_is_its_own() -> None:
    text, model = (SHIPPED / CARD).read_text(), load(SHIPPED)
    card = " ".join(text.split())
    assert " ".join(decision(model).split()) in card and f"δ = {delta(model):.2g}." in card
    assert (
        all(" ".join(limit.split()) in card for limit in [scope(model), *LIMITS.split("\n- ")])
        and "Apache-2.0" in card
    )
    assert not miscounted(text, model)
    for old, new in (("| 56 |", "| 57 |"), ("| 176 |", "| 250 |"), ("| 3360 |", "| 749 |")):
        assert old in text and miscounted(text.replace(old, new), model)


def miscounted(card: str, model: TRFE) -> list[str]:
    """Classes of which a card says that other numbers of windows trained the model than it holds:
    at most 250 of a class (`--forest-samples 250` of its command), thrice as many of nothing."""
    assert "--forest-samples 250 " in card and model.known.forest.neighbours is not None
    said = {
        title: int(count) for title, count in re.findall(r"^\| ([a-z ]+) \| (\d+) \|$", card, re.M)
    }
    held = Counter(model.known.forest.neighbours.labels.tolist())
    return [
        title_of(label)
        for label in model.known.classes.tolist()
        if held[label] != min(said.get(title_of(label), 0), 750 if label == BACKGROUND else 250)
    ]


def test_windows_that_are_kept_are_of_the_recordings_that_are_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache = tmp_path / "cache"
    for name in ("01", "02", "02"):
        motorway.write_motorway(tmp_path / name, name)
        assert (
            call(
                monkeypatch, "train", tmp_path / name, "--out", tmp_path / "model", "--cache", cache
            )
            == 2
        )
    kept = [Windows.load(path.parent) for path in cache.rglob("windows.parquet")]
    assert sorted("".join(np.unique(one.recordings)) for one in kept) == ["01/01", "02/02"]


def test_a_seed_below_zero_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        call(
            monkeypatch,
            "train",
            windows(tmp_path / "windows"),
            "--out",
            tmp_path / "model",
            "--seed",
            -1,
        )
        == 2
    )
    assert "--seed" in capsys.readouterr().err


def test_an_interruption_is_said_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("recognition.trfe.training.windows.windows_at", interrupted)
    monkeypatch.setattr("recognition.recorder.record", lambda *_, **__: interrupted())
    for command in (
        ["train", windows(tmp_path / "windows"), "--out", tmp_path / "model"],
        ["record", tmp_path / "records"],
    ):
        assert call(monkeypatch, *command) == 130
        assert capsys.readouterr().err == f"\nxosc-recognize {command[0]}: interrupted\n"


def test_too_few_recordings_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        call(
            monkeypatch,
            "train",
            windows(tmp_path / "windows", recordings=2),
            "--out",
            tmp_path / "model",
        )
        == 2
    )
    assert "no class has enough recordings" in capsys.readouterr().err
