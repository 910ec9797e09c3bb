"""Search space: the parameters of a logical scenario as a box with a name on each side, and
distances in it.

Source: METHOD.md §3, Table 1. A scenario declares its parameters with constraint groups; the box is
read from there, so that a scenario with other or more parameters (speed of the ego, a jerk, a
second adversary) needs no change of the search.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

import xosc
from generation.space import SpaceChoice
from generation.space.density.roles import NUISANCES, ON_REQUEST, roles_of
from recognition.labels.maneuvers.parameters import DECLARED, Parameter
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import UsageError, nearest
from schemas.expressions import literal
from xosc.document.node import Node
from xosc.resolve.parameters import Assignment, ParameterScope

if TYPE_CHECKING:
    from generation.space.density.marginals import Marginal

DIGITS = 6
"""Decimal digits of values in files."""
_STEP = 10.0**-DIGITS
_WHOLE = ("integer", "int", "unsignedInt", "unsignedShort")
"""Types of whole numbers."""
_MOST_WHOLE = 100_000
"""Whole numbers that a range may hold: they are listed"""
_LISTED = 6
"""Parameters that a message names at most"""
_BY_DEFAULT = SpaceChoice()


@dataclass(frozen=True)
class Space:
    """The box that a search moves in.

    Attributes:
        parameters: its sides, in the order of the columns of every array theta (n, d).
        pinned: what else the scenario declares as literals, with the values that hold in all runs:
            they decide as much as the searched ones do, and belong beside every result.
        choices: the only values of some parameters, ascending: points between stand for the nearest
            one.
        follows: of some of these, values of other parameters that belong to each value; and of the
            parameter itself where its values are the codes of categories.
        constraints: whether values by name keep the scenario's constraints; None where the box says
            it all.
    """

    parameters: tuple[Parameter, ...]
    pinned: Mapping[str, str] = field(default_factory=dict)
    choices: Mapping[str, Sequence[float]] = field(default_factory=dict)
    follows: Mapping[str, Mapping[float, Mapping[str, str]]] = field(default_factory=dict)
    constraints: Callable[[Mapping[str, str]], bool] | None = field(
        default=None, compare=False, repr=False
    )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the declarations."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def low(self) -> FloatArray:
        """Least values (d,)."""
        return np.array([parameter.low for parameter in self.parameters])

    @property
    def high(self) -> FloatArray:
        """Greatest values (d,)."""
        return np.array([parameter.high for parameter in self.parameters])

    def clip(self, theta: FloatArray) -> FloatArray:
        """The nearest points of the box."""
        return np.clip(theta, self.low, self.high)

    def unit(self, theta: FloatArray) -> FloatArray:
        """Points in the unit cube, 0 for least and 1 for greatest values."""
        # No side is of width 0: `_parameter` and `_obstacle` refuse those.
        return (np.asarray(theta) - self.low) / (self.high - self.low)

    def scaled(self, unit: FloatArray) -> FloatArray:
        """Points of the box from those of the unit cube: the inverse of `unit`."""
        return self.low + np.asarray(unit) * (self.high - self.low)

    def draw(self, n: int, rng: np.random.Generator) -> FloatArray:
        """Uniform points (n, d)."""
        return rng.uniform(self.low, self.high, (n, len(self.parameters)))

    def values(self, row: Sequence[float] | FloatArray) -> dict[str, str]:
        """A point (d,) as the scenario's parameters take it, rounded to `DIGITS`."""
        (values,) = self.sets(np.array([row], float))
        return values

    def sets(self, theta: FloatArray) -> list[dict[str, str]]:
        """Points (n, d) as the scenario's parameters take them: `values` of each."""
        names = self.names
        if theta.shape[1] != len(names):
            raise UsageError(f"{theta.shape[1]} values for {len(names)} parameters")
        columns = [self._texts(name, theta[:, place]) for place, name in enumerate(names)]
        # A space of pinned parameters alone still has as many rows.
        if not columns:
            return [{} for _ in theta]
        rows = [dict(zip(names, texts, strict=True)) for texts in zip(*columns, strict=True)]
        for name, follows in self.follows.items():
            for row in rows:
                # Of categories the code itself goes: the parameter is among what follows.
                row.update(follows[float(row[name])])
        return rows

    def point(self, values: Mapping[str, str]) -> FloatArray | None:
        """The point (d,) of values by name, as `values` gives them; None where they are of no
        category, or lack a parameter, or have a word for a number."""
        coordinates = list[float]()
        for name in self.names:
            if coded := self.categories(name):
                # Part of the values: these have those of other parameters too.
                of = [code for code, texts in coded.items() if texts.items() <= values.items()]
                if not of:
                    return None
                coordinates.append(of[0])
            elif _is_number(text := values.get(name, "")):
                coordinates.append(float(text))
            else:
                # Values of another version, which did not search this parameter, or had words.
                return None
        return np.array(coordinates)

    def _texts(self, name: str, values: FloatArray) -> list[str]:
        choices = self.choices.get(name)
        if choices is None:
            return [repr(round(value, DIGITS)) for value in values.tolist()]
        points = np.array(choices)
        # By the middles between choices; nearness to each of thousands would be a table of its own.
        nearest_point = np.searchsorted(0.5 * (points[1:] + points[:-1]), values)
        return [literal(choice) for choice in points[nearest_point].tolist()]

    def categories(self, name: str) -> Mapping[float, Mapping[str, str]]:
        """Values by name that each code of a parameter stands for; none where its values are no
        codes."""
        coded = self.follows.get(name, {})
        return coded if any(name in texts for texts in coded.values()) else {}

    def admits(self, theta: FloatArray) -> BoolArray:
        """Points (n, d) that keep the scenario's constraints beyond the box: (n,)."""
        if self.constraints is None:
            return np.ones(len(theta), bool)
        return np.array(
            [self.constraints({**self.pinned, **self.values(row)}) for row in theta], bool
        )

    def by_name(self, theta: FloatArray) -> dict[str, FloatArray]:
        """The columns of points (n, d), and what is pinned at a number, by name: (n,) each."""
        pinned = {
            name: np.full(len(theta), float(text))
            for name, text in self.pinned.items()
            if _is_number(text)
        }
        return pinned | dict(zip(self.names, theta.T, strict=True))

    @classmethod
    def of(
        cls,
        scenario: str | PathLike[str],
        choice: SpaceChoice = _BY_DEFAULT,
        ego: str = "Ego",
    ) -> Space:
        """The space of a logical scenario: its double parameters that have a lower and an upper
        limit.

        Of those, the ones of the actors are searched, participants that have one of the seven, and
        the speed of the ego, or where that acts, of its leader. Where no participant has one of the
        seven, all but the ego's are. A parameter is a participant's where its name begins with the
        participant's.

        Args:
            scenario: the file.
            choice: what to search of it, and what to pin.
            ego: name of the ego.

        Raises:
            UsageError: a name is not declared, a free one has no limits or is pinned as well, a
                pinned value is not of its type, a range is not that of a number, or nothing is left
                to search.
            Unsupported: the values allowed to a searched parameter are not one interval.
            InvalidFile: the file is malformed, or a pinned value violates its constraints.
        """
        declared = _DeclaredParameters(scenario, choice)
        names = declared.searched(ego)
        follows = declared.follows(names)
        # Parameters that follow a category have its values: their declared ones are not pinned.
        following = {
            name
            for first, values in follows.items()
            for texts in values.values()
            for name in texts
            if name != first
        }
        return cls(
            tuple(declared.side(name) for name in names),
            {
                name: value
                for name, value in declared.literals.items()
                if name not in names and name not in following
            },
            declared.values(names),
            follows,
            # Declared limits make the box; ranges of the user may leave what the constraints allow.
            partial(_admits, list(declared.declared.values())) if choice.marginals else None,
        )


class _DeclaredParameters:
    """Declarations of a scenario, and those of them that are pinned, free, or have a range.

    Args: see `Space.of`.

    Raises:
        UsageError: a name is not declared.
    """

    def __init__(
        self,
        scenario: str | PathLike[str],
        choice: SpaceChoice,
    ) -> None:
        self._scenario, self._default = scenario, choice.default
        self._pinned, self._free, self._ranges = choice.pinned, choice.free, choice.marginals
        node = xosc.load(scenario).node
        self.declared = {
            declaration.get("name"): declaration for declaration in _declarations(node)
        }
        # All three first: a misspelt name would only seem to be left out.
        for name in (*self._pinned, *self._free, *self._ranges):
            if name not in self.declared:
                raise UsageError(
                    f"there is no parameter {name!r}; {nearest(name, self.declared)}", path=scenario
                )
        self._assigned = {
            name: Assignment(value, partial(UsageError, path=scenario), True)
            for name, value in self._pinned.items()
        }
        self._scope = ParameterScope(self.declared.values(), assigned=self._assigned)

    def searched(self, ego: str) -> list[str]:
        """Names of the parameters to search, in the order of their declarations.

        Raises:
            UsageError: one can't be searched, or none is left.
            InvalidFile: a pinned value violates its constraints.
        """
        asked = (*self._free, *self._ranges)
        bounded = [
            name
            for name, declaration in self.declared.items()
            if _bounded(declaration, self._scope)
        ]
        for name in asked:
            limits = self._ranges.get(name)
            reason = _obstacle(name, name in self._pinned, name in bounded, limits, self._scope)
            if reason is not None:
                raise UsageError(
                    f"the parameter {name} can't be searched: it {reason}", path=self._scenario
                )
        # Pinned ones alone: searched ones keep their constraints by the box.
        held = [self.declared[name] for name in self._pinned]
        for violation in ParameterScope(held, self._scope, self._assigned).violations():
            raise violation
        chosen = (_by_default(bounded, ego) if self._default else set()) | {*asked}
        searched = [
            name
            for name in self.declared
            if name in chosen and name not in self._pinned
            if name in bounded or name in self._ranges
        ]
        if not searched:
            raise UsageError(
                "no parameter with a lower and an upper limit is left to search: "
                f"{self._instead()}",
                path=self._scenario,
            )
        return searched

    def _instead(self) -> str:
        """Remedy where nothing is left to search."""
        left = {
            name: value
            for name, value in numbers(self._scenario).items()
            if name not in self._pinned
        }
        if left:
            return f"give limits, as {free_option(left)}"
        return "every number that it declares is pinned"

    @property
    def literals(self) -> dict[str, str]:
        """Values that are declared as literals, or pinned, by name."""
        declared = {
            name: self._scope.own[name].text
            for name, declaration in self.declared.items()
            # An expression follows from others, and is none that a file could pin.
            if "$" not in declaration.get("value")
        }
        return {**declared, **self._pinned}

    def side(self, name: str) -> Parameter:
        """Side of the box of a parameter that is searched."""
        if name in self._ranges:
            return _of_range(name, self._ranges[name])
        return _parameter(self.declared[name], self._scope)

    def values(self, names: Sequence[str]) -> dict[str, Sequence[float]]:
        """The only values of some of the parameters, by name."""
        choices = {
            name: _choices(self._ranges[name], self._scope.own[name].type)
            for name in names
            if name in self._ranges
        }
        return {name: choice for name, choice in choices.items() if choice}

    def follows(self, names: Sequence[str]) -> dict[str, Mapping[float, Mapping[str, str]]]:
        """Values of other parameters that belong to those of some of the searched ones.

        Raises:
            UsageError: another one is not declared, or is searched or pinned itself.
        """
        belonging = {
            name: self._ranges[name].follows
            for name in names
            if name in self._ranges and self._ranges[name].follows
        }
        # Such a value would have two sources, and the one that is written last would win.
        taken = {*self._pinned, *self._free, *self._ranges, *names}
        others = (
            (first, name)
            for first, values in belonging.items()
            for texts in values.values()
            for name in texts
            if name != first
        )
        for first, name in others:
            if name in self.declared and name not in taken:
                continue
            reason = "is searched or pinned itself" if name in self.declared else "is not declared"
            raise UsageError(
                f"the parameter {name} belongs to the values of {first}, and {reason}",
                path=self._scenario,
            )
        return belonging


def numbers(scenario: str | PathLike[str]) -> dict[str, str]:
    """Values, as declared, of a scenario's parameters whose type is one of numbers, by name.

    Raises:
        UsageError: there is none. InvalidFile: the file is malformed.
    """
    declared = _declarations(xosc.load(scenario).node)
    values = {
        declaration.get("name"): declaration.get("value")
        for declaration in declared
        if declaration.get("parameterType") in ("double", *_WHOLE)
    }
    if not values:
        raise UsageError(
            "it declares no parameter that is a number: --free LINE@ATTRIBUTE=LOW..HIGH searches "
            "a literal, as 87@value=10..40",
            path=scenario,
        )
    return values


def free_option(declared: Mapping[str, str]) -> str:
    """The option that gives parameters limits, and which there are, by name with their values; for
    messages."""
    told = [f"{name} = {value}" for name, value in declared.items()]
    listed = ", ".join(told[:_LISTED]) + (
        f" and {len(told) - _LISTED} more" if len(told) > _LISTED else ""
    )
    return f"--free {next(iter(declared))}=LOW..HIGH (it declares {listed})"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _declarations(root: Node) -> list[Node]:
    holder = root.find("ParameterDeclarations")
    return holder.children("ParameterDeclaration") if holder is not None else []


def _obstacle(
    name: str, pinned: bool, bounded: bool, limits: Marginal | None, scope: ParameterScope
) -> str | None:
    """Reason for which a parameter can't be searched; None where it can."""
    if pinned:
        return "is pinned"
    if not (bounded or limits is not None):
        return f"has no lower and upper limit; --free {name}=LOW..HIGH gives it some"
    kind = scope.own[name].type
    chosen = limits is not None and bool(limits.choices)
    # Counted from the limits: a list of ten million would be made before it is refused.
    if limits is not None and not chosen and kind in _WHOLE:
        whole = math.floor(limits.high) - math.ceil(limits.low) + 1
        if whole < 2:
            return f"is of whole numbers, and its range holds {'one' if whole == 1 else 'none'}"
        if whole > _MOST_WHOLE:
            return f"is of whole numbers, of which a range may hold {_MOST_WHOLE:,}, not {whole:,}"
    if bounded or chosen or kind == "double" or kind in _WHOLE:
        return None
    return f"is of the type {kind}, not a number; --pin {name}=VALUE gives it one value"


def _of_range(name: str, limits: Marginal) -> Parameter:
    return Parameter(
        name, limits.low, limits.high, name.rpartition("_")[2] if "_" in name else "", ""
    )


def _choices(limits: Marginal, kind: str) -> Sequence[float]:
    """The values of a range that its parameter can have; none where it can have all."""
    if limits.choices or kind == "double":
        return limits.choices
    return [float(value) for value in range(math.ceil(limits.low), math.floor(limits.high) + 1)]


def _admits(declared: Sequence[Node], values: Mapping[str, str]) -> bool:
    assigned = {name: Assignment(value, UsageError, True) for name, value in values.items()}
    return next(ParameterScope(declared, assigned=assigned).violations(), None) is None


def _by_default(bounded: Sequence[str], ego: str) -> set[str]:
    """Names of the actors' parameters and of what recordings tell besides; where there is no actor,
    of all but the ego's.

    Without those that are searched on request only.
    """
    roles = roles_of(bounded, ego=ego)
    bounded = [name for name in bounded if name not in roles or roles[name].role not in ON_REQUEST]
    actors = tuple(f"{role.actor}_" for role in roles.values() if role.actor)
    of_actors = {name for name in bounded if name in roles or name.startswith(actors)}
    # Without roles a name tells nothing but whose it is: the ego's own is left to its system.
    return of_actors or {name for name in bounded if not name.startswith(f"{ego}_")}


def _bounded(declaration: Node, scope: ParameterScope) -> bool:
    """Whether it is a double with limits on both sides in each of its constraint groups."""
    if scope.own[declaration.get("name")].type != "double":
        return False
    groups = declaration.children("ConstraintGroup")
    # By the first letters of less… and greater…: equalTo and notEqualTo limit nothing.
    return bool(groups) and all(
        {"l", "g"} <= {constraint.get("rule")[0] for constraint in group.children()}
        for group in groups
    )


def _parameter(declaration: Node, scope: ParameterScope) -> Parameter:
    """A side of the box from its declaration."""
    name = declaration.get("name")
    groups = declaration.children("ConstraintGroup")
    if len(groups) > 1:
        raise declaration.unsupported(
            f"the parameter {name} may have values in several intervals, which can't be searched"
        )
    low, high = -np.inf, np.inf
    # The strictest of each side: a group may name several.
    for constraint in groups[0].children():
        rule, value = constraint.get("rule"), float(scope.literal(constraint.get("value")))
        # The box is closed: a strict limit is the least step of values in files away.
        if rule in ("greaterOrEqual", "greaterThan"):
            low = max(low, value + (_STEP if rule == "greaterThan" else 0.0))
        elif rule in ("lessOrEqual", "lessThan"):
            high = min(high, value - (_STEP if rule == "lessThan" else 0.0))
        else:
            raise constraint.unsupported(
                f"the parameter {name} is constrained by {rule}, which is no interval"
            )
    if not low < high:
        raise declaration.invalid(f"no value of the parameter {name} keeps its constraints")
    # Doubles of the standard may be INF.
    if not np.isfinite([low, high]).all():
        raise declaration.unsupported(
            f"the parameter {name} has an infinite limit: --free {name}=LOW..HIGH gives it finite "
            f"ones, --pin {name}=VALUE a value"
        )
    short = name.partition("_")[2]
    meaning = next(
        (parameter.meaning for parameter in DECLARED.values() if parameter.name == short), ""
    )
    return Parameter(name, low, high, name.rpartition("_")[2] if "_" in name else "", meaning)


_ROUNDING = 1e-9
"""By how much the tree looks further than it has to: the distances themselves decide"""


def distinctive(space: Space) -> BoolArray:
    """The parameters (d,) that tell cases apart: all but the nuisances."""
    roles = roles_of(space.names)
    return np.array(
        [name not in roles or roles[name].role not in NUISANCES for name in space.names], bool
    )


def apart(unit: FloatArray, others: FloatArray, least: float) -> BoolArray:
    """Rows (n, d) of the unit cube that are no nearer than `least` to any of others (m, d)."""
    # A root-mean-square distance is the Euclidean one over √d.
    far, reach = np.ones(len(unit), bool), least * np.sqrt(unit.shape[1])
    for start in range(0, len(others), _BLOCK):
        far &= (cdist(unit, others[start : start + _BLOCK]) >= reach).all(axis=1)
    return far


_BLOCK = 4096
"""Points that distances are worked out to at a time: memory does not grow with the runs"""


class KnownRows:
    """Rows of the unit cube that grow in number, and distances from them.

    They are in trees, each greater than the next one, so that adding rows one by one sorts each
    of them anew O(log n) times.
    """

    def __init__(self) -> None:
        self._trees = list[KDTree]()

    def add(self, unit: FloatArray) -> None:
        """Add rows (n, d)."""
        # Trees of like size become one, as digits of a binary counter are carried.
        while len(unit) and self._trees and self._trees[-1].n <= len(unit):
            unit = np.concatenate([self._trees.pop().data, unit])
        if len(unit):
            self._trees.append(KDTree(unit))

    def distances(self, unit: FloatArray, most: float = np.inf) -> FloatArray:
        """Root-mean-square distance (n,) of rows (n, d) from the nearest one; infinite where that
        is further than `most`, or there is none."""
        closest, reach = np.full(len(unit), np.inf), np.sqrt(unit.shape[1])
        for tree in self._trees:
            # A bound a little wider than asked, or rounding would lose rows at the bound itself.
            far = tree.query(unit, distance_upper_bound=most * reach * (1.0 + _ROUNDING))[0]
            closest = np.minimum(closest, np.asarray(far) / reach)
        return closest


def diverse(unit: FloatArray, least: float, most: int | None = None) -> IntArray:
    """Indices of rows (n, d) of the unit cube, each the first one that is no nearer than `least` to
    those before.

    Args:
        most: how many indices at most; None for any number.
    """
    kept, left, tree = list[int](), np.ones(len(unit), bool), KDTree(unit)
    reach = least * np.sqrt(unit.shape[1]) * (1.0 + _ROUNDING)
    for index in range(len(unit)):
        if len(kept) == most:
            break
        if left[index]:
            kept.append(index)
            near = np.array(tree.query_ball_point(unit[index], reach), np.int64)
            # By the same formula as everywhere else: the tree's own distances differ in the last
            # bit.
            left[near] &= np.sqrt(np.square(unit[near] - unit[index]).mean(axis=1)) >= least
    return np.array(kept, np.int64)


def grouped(unit: FloatArray, linked: float) -> IntArray:
    """Labels (n,) of rows (n, d) of the unit cube: groups by single linkage at a root-mean-square
    distance."""
    from scipy.cluster.hierarchy import fcluster, linkage

    if len(unit) < 2:
        return np.zeros(len(unit), np.int64)
    return np.asarray(
        fcluster(linkage(unit, "single"), linked * np.sqrt(unit.shape[1]), "distance"), np.int64
    )
