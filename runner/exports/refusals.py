"""Refusals of runs by name: where in the scenario it says what a target cannot say."""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.errors import Unsupported
from xosc.document import load

if TYPE_CHECKING:
    from runner.interpreter.result import RunResult


def unsupported(result: RunResult, entity: str | None, message: str) -> Unsupported:
    """An Unsupported, to be raised by the caller, at the ScenarioObject of an entity or else at the scenario's root."""
    root = load(result.scenario).node
    places = [node for node in root.iter("ScenarioObject") if node.get("name", None) == entity]
    return (places or [root])[0].unsupported(message)
