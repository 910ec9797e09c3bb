"""How an interrupted search goes on: its simulator calls are kept as they come, and answer the same search when it is repeated.

A search is deterministic given what the simulator answers. So nothing of its own state (networks, populations, generators) has
to be stored: it starts anew, is answered from memory up to where it was, and goes on from there.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from generation.outcomes.evaluator import Evaluate
from generation.outcomes.outcomes import NOTHING, Outcomes
from schemas.errors import InvalidFile
from xodr.array_types import FloatArray


class Memory:
    """An evaluator that remembers.

    Args:
        evaluate: answers what was not asked before.
        path: a JSON line for each call, appended as soon as there is an answer.

    Raises:
        InvalidFile: the file holds something else.
    """

    def __init__(self, evaluate: Evaluate, path: Path) -> None:
        self._evaluate, self._path = evaluate, path
        self._known = _read(path)
        self._asked = 0

    def __call__(self, theta: FloatArray) -> Outcomes:
        """Outcomes of points (n, d).

        Raises:
            InvalidFile: the remembered search asked for other points here.
        """
        known = self._known[self._asked : self._asked + len(theta)]
        for number, (row, entry) in enumerate(zip(theta.tolist(), known, strict=False), self._asked + 1):
            if entry["theta"] != row:
                raise InvalidFile(
                    "another search asked for this point; remove the file to begin anew", path=self._path, line=number
                )
        if len(known) < len(theta):
            known = known + self._ask(theta[len(known) :])
        self._asked += len(theta)
        return Outcomes.of(len(known), **{name: [entry[name] for entry in known] for name in NOTHING})

    def _ask(self, theta: FloatArray) -> list[dict[str, Any]]:
        outcomes = self._evaluate(theta)
        columns = {name: getattr(outcomes, name).tolist() for name in NOTHING}
        fresh = [
            {"theta": row, **{name: values[number] for name, values in columns.items()}}
            for number, row in enumerate(theta.tolist())
        ]
        with self._path.open("a", encoding="utf-8") as file:
            file.writelines(json.dumps(entry) + "\n" for entry in fresh)
        return fresh


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
