"""The criteria that a scenario declares in its stop triggers, as CARLA's scenario_runner reads them."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from runner.criteria.criterion import Kind, kinds
from xosc.dialects.carla import CRITERION_PREFIX, is_criterion

if TYPE_CHECKING:
    from xosc.node import Node

_SEPARATORS = re.compile(r"[\s,;]+")


@dataclass(frozen=True)
class Criterion:
    """A criterion of a scenario.

    Args:
        name: as in the scenario, without `criteria_`.
        kind: None where no criterion has that name.
        parameters: of the kind, by name; None where neither the scenario nor the kind gives a value.
        delay: time (s) from which it is judged.
        where: `file:line` of the condition.
        remark: what the scenario says that has no meaning for it; empty where there is nothing.
    """

    name: str
    kind: Kind | None
    parameters: dict[str, float | None]
    delay: float
    where: str
    remark: str = ""


def declared(storyboard: Node) -> tuple[Criterion, ...]:
    """The criteria in all stop triggers of a Storyboard element.

    Raises:
        InvalidFile: a value of a criterion is not a number, or there are more values than it has parameters.
    """
    conditions = (condition for trigger in storyboard.iter("StopTrigger") for condition in trigger.iter("Condition"))
    return tuple(_read(condition) for condition in conditions if is_criterion(condition))


def _read(condition: Node) -> Criterion:
    name, parameter = (
        condition.get("name").removeprefix(CRITERION_PREFIX),
        condition.need("ByValueCondition", "ParameterCondition"),
    )
    kind, delay = kinds().get(name.casefold()), condition.finite("delay", 0.0)
    if kind is None:
        known = ", ".join(sorted(each.name for each in kinds().values()))
        return Criterion(name, None, {}, delay, condition.where, f"there is no criterion of this name; criteria: {known}")
    reference, text = parameter.get("parameterRef", ""), parameter.get("value", "")
    if not kind.parameters:
        remark = f"{kind.name} has no parameters: value={text!r} is not used" if text.strip() else ""
        return Criterion(kind.name, kind, {}, delay, condition.where, remark)
    values = _values(parameter, kind, reference, text)
    return Criterion(kind.name, kind, kind.parameters | values, delay, condition.where)


def _values(parameter: Node, kind: Kind, reference: str, text: str) -> dict[str, float | None]:
    """Values by parameter: in their order, from the one on that parameterRef names; an empty one with a name means 0."""
    names = list(kind.parameters)
    names = names[names.index(reference) if reference in names else 0 :]
    texts = [one for one in _SEPARATORS.split(text.strip()) if one] or (["0"] if reference else [])
    if len(texts) > len(names):
        raise parameter.invalid(f"value={text!r} has {len(texts)} numbers, {kind.name} takes {', '.join(names)}")
    return {name: _number(parameter, kind, one, text) for name, one in zip(names, texts, strict=False)}


def _number(parameter: Node, kind: Kind, text: str, whole: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not math.isfinite(value):
        raise parameter.invalid(f"value={whole!r} is not a number: {kind.name} takes {', '.join(kind.parameters)}")
    return value
