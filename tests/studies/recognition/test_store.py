"""Results that survive interruptions, of one configuration to a folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from schemas.common.errors import InvalidFile, UsageError
from studies.recognition.protocol.store import Key, Store

KEY = Key("open-set", "cac", 0, 1)


def test_what_was_written_is_there_again(tmp_path: Path) -> None:
    store = Store(tmp_path / "out")
    store.open({"events": 400})
    assert not store.has(KEY)
    store.write(KEY, {"macro_f1": 0.5})
    again = Store(tmp_path / "out")
    again.open({"events": 400})
    assert again.has(KEY)
    assert again.read(KEY) == {"macro_f1": 0.5}


def test_another_configuration_is_refused_by_the_name_of_the_setting(tmp_path: Path) -> None:
    Store(tmp_path).open({"events": 400, "preset": "cpu"})
    with pytest.raises(UsageError, match=r"other settings \(events\)"):
        Store(tmp_path).open({"events": 100, "preset": "cpu"})


def test_results_come_sorted(tmp_path: Path) -> None:
    store = Store(tmp_path)
    keys = [
        Key("open-set", method, seed, number)
        for method in ("mls", "cac")
        for seed in (10, 2)
        for number in (2, 1)
    ]
    for key in keys:
        store.write(key, {"seed": key.seed})
    assert [key for key, _ in store.results("open-set")] == sorted(keys)
    assert list(store.results("clustering")) == []


def test_drafts_of_an_interrupted_run_are_no_results(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.write(KEY, {})
    (tmp_path / "results/open-set/cac/.seed1-round1.json.77").write_text("{")
    assert len(list(store.results("open-set"))) == 1


def test_damaged_result_is_named(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.write(KEY, {})
    (tmp_path / "results/open-set/cac/seed0-round1.json").write_text('{"macro')
    with pytest.raises(InvalidFile, match=r"seed0-round1\.json:1: .*remove it"):
        store.read(KEY)
