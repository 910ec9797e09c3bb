"""What runs gave is kept: an interrupted search goes on, and one with another budget, seed or method reuses what is the same.

A search is deterministic given what the simulator answers. So nothing of its own state (networks, populations, generators) has
to be stored: it starts anew, is answered from memory up to where it was, and goes on from there.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from generation.outcomes.evaluator import Evaluate
from generation.outcomes.outcomes import NOTHING, Outcomes
from schemas.errors import InvalidFile
from xodr.array_types import FloatArray


class Memory:
    """An evaluator that remembers.

    Args:
        evaluate: answers what was not asked before.
        path: a JSON line for each point, appended as soon as there is an answer.

    Attributes:
        reused: how many answers came from memory.

    Raises:
        InvalidFile: the file holds something else.
    """

    def __init__(self, evaluate: Evaluate, path: Path) -> None:
        self._evaluate, self._path, self.reused = evaluate, path, 0
        self._known = {tuple(entry["theta"]): entry for entry in _read(path)}

    def __call__(self, theta: FloatArray) -> Outcomes:
        """Outcomes of points (n, d)."""
        rows = [tuple(row) for row in theta.tolist()]
        missing = list(dict.fromkeys(row for row in rows if row not in self._known))
        self.reused += len(rows) - len(missing)
        if missing:
            self._ask(np.array(missing))
        return _outcomes([self._known[row] for row in rows])

    @property
    def everything(self) -> tuple[FloatArray, Outcomes]:
        """All points that are remembered (m, d), and their outcomes."""
        entries = list(self._known.values())
        return np.array([entry["theta"] for entry in entries]), _outcomes(entries)

    def _ask(self, theta: FloatArray) -> None:
        outcomes = self._evaluate(theta)
        columns = {name: getattr(outcomes, name).tolist() for name in NOTHING}
        fresh = [
            {"theta": row, **{name: values[number] for name, values in columns.items()}}
            for number, row in enumerate(theta.tolist())
        ]
        with self._path.open("a", encoding="utf-8") as file:
            file.writelines(json.dumps(entry) + "\n" for entry in fresh)
        self._known |= {tuple(entry["theta"]): entry for entry in fresh}


def _outcomes(entries: list[dict[str, Any]]) -> Outcomes:
    return Outcomes.of(len(entries), **{name: [entry[name] for entry in entries] for name in NOTHING})


def _read(path: Path) -> list[dict[str, Any]]:
    """The entries; a last line that was cut off is removed from the file."""
    if not path.exists():
        return []
    content = path.read_bytes()
    complete = content[: content.rfind(b"\n") + 1]
    if len(complete) < len(content):
        path.write_bytes(complete)
    expected = {"theta", *NOTHING}
    entries = []
    for number, line in enumerate(complete.splitlines(), 1):
        try:
            entry = json.loads(line)
        except ValueError:
            entry = None
        if not isinstance(entry, dict) or set(entry) != expected:
            raise InvalidFile("this is no simulator call; remove the file to begin anew", path=path, line=number)
        entries.append(entry)
    return entries
