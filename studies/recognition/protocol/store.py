"""Results on disk: one small file for each, written whole or not at all, in a folder of one
configuration."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from schemas.common.storage import check_settings, keep, read_object, write_object

_CONFIGURATION, _RESULTS = "configuration.json", "results"
_REMEDY = "remove it to have it made again"


class Key(NamedTuple):
    """Key of a result: kind of experiment, method, seed, round (from 1)."""

    kind: str
    method: str
    seed: int
    round: int


@dataclass(frozen=True)
class Store:
    """Results in a folder."""

    folder: Path

    def check(self, configuration: dict[str, Any]) -> None:
        """Refuse a folder with results of another configuration.

        Args:
            configuration: all of it, or a part.

        Raises:
            UsageError: the folder has another; the differing settings are named.
        """
        check_settings(self.folder / _CONFIGURATION, configuration, "results")

    def open(self, configuration: dict[str, Any]) -> None:
        """Make the folder ready for results of a configuration.

        Raises:
            UsageError: see `check`.
        """
        self.check(configuration)
        write_object(configuration, self.folder / _CONFIGURATION)

    def has(self, key: Key) -> bool:
        """Whether that result is there."""
        return self._path(key).exists()

    def read(self, key: Key) -> dict[str, Any]:
        """The result.

        Raises:
            InvalidFile: it is missing or damaged.
        """
        return read_object(self._path(key), _REMEDY)

    def write(self, key: Key, values: dict[str, Any]) -> None:
        """Keep a result."""
        _write(self._path(key), values)

    def results(self, kind: str) -> Iterator[tuple[Key, dict[str, Any]]]:
        """All results of a kind, sorted by method, seed and round."""
        root = self.folder / _RESULTS / kind
        found = [
            Key(kind, path.parent.name, *_numbers(path))
            for path in root.glob("*/seed*-round*.json")
        ]
        for key in sorted(found):
            yield key, self.read(key)

    def _path(self, key: Key) -> Path:
        return (
            self.folder / _RESULTS / key.kind / key.method / f"seed{key.seed}-round{key.round}.json"
        )


def _write(path: Path, values: dict[str, Any]) -> None:
    keep((json.dumps(values, indent=1) + "\n").encode(), path)


def _numbers(path: Path) -> tuple[int, int]:
    seed, _, number = path.stem.removeprefix("seed").partition("-round")
    return int(seed), int(number)
