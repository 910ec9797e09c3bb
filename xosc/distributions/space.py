"""The parameter space that a distribution file spans over its scenario: counted, reached into,
walked, sampled and chosen from.

Nothing here enumerates a space in order to reach into it: a place in a deterministic space is a
number in mixed radix, and a stochastic test run depends on its number alone."""

from __future__ import annotations

import math
import os
import random
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain, islice
from pathlib import Path

from schemas.catalogs import referred
from schemas.common.errors import InvalidFile, UsageError, nearest
from schemas.common.storage import digest
from schemas.common.terminal.files import named
from schemas.common.terminal.text import many
from schemas.expressions import ExpressionError, references
from schemas.expressions.values import meant, quoted, type_named
from xosc.distributions.deterministic import Deterministic, ParameterValueDistribution
from xosc.distributions.values import text
from xosc.document import Document, load
from xosc.document.node import Node
from xosc.resolve.parameters import Assignment, ParameterScope

MAX_REJECTIONS = 10_000
"""Number of samples in a row outside the constraints end the search for one inside."""

MAX_EXCLUDED = 20_000
"""Number of variations in a row outside the constraints (a few seconds) end an enumeration, which
could go on for years."""

_REMEMBERED = 10_000
"""Number of answers on values that are kept."""

Variation = tuple[Path, dict[str, str]]
"""A scenario and values of its parameters."""


class ParameterSpace:
    """The variations of a scenario.

    Args:
        path: a ParameterValueDistribution file, or a scenario, which is its own only variation.

    Attributes:
        scenario: the scenario's path.
        distribution: what the file says, None for a scenario.
        size: number of variations, those outside the scenario's constraints included.
        node: the ParameterValueDistribution element, where there is one.

    Raises:
        InvalidFile: a file is malformed, or the scenario does not declare a distribution's
            parameter.
        Unsupported: a user-defined distribution has no plug-in.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        document = load(path)
        self.distribution: ParameterValueDistribution | None = None
        self.scenario = document.path
        # A scenario is its own only variation, so that callers need no case for it.
        self.size = 1
        if document.kind == "distribution":
            self._read(document)
        elif document.kind != "scenario":
            raise document.node.invalid(
                "a scenario or a ParameterValueDistribution is expected, this is a catalog"
            )

    def _read(self, document: Document) -> None:
        self.node = node = document.node.need("ParameterValueDistribution")
        self.distribution = ParameterValueDistribution.read(node)
        self.size = self.distribution.definition.size
        self.scenario = Path(
            os.path.normpath(referred(document.path, self.distribution.scenario_file))
        )
        if not os.path.isfile(self.scenario):  # unlike Path.is_file it takes names of any length
            raise node.need("ScenarioFile").invalid(f"the scenario {self.scenario} does not exist")
        try:
            scenario = load(self.scenario)
        except InvalidFile as error:
            error.message += f"; {node.need('ScenarioFile').where} refers to this file"
            raise
        if scenario.kind != "scenario":
            raise node.need("ScenarioFile").invalid(
                f"{self.scenario} is a {scenario.kind}, a scenario is expected"
            )
        self._declarations = {
            declaration.get("name"): declaration for declaration in _declarations(scenario)
        }
        self._types = _types(self._declarations)
        self._places = dict(_places(node))
        for name, place in self._places.items():
            if name not in self._declarations:
                message = (
                    f"{scenario.path.name} declares no parameter {quoted(name)}; "
                    f"{nearest(name, self._declarations)}"
                )
                raise place.invalid(message)
        self._constrained = _groups(_constrained(self._declarations))
        # Values of one group meet many values of the others, with the same answer.
        self._keeps = lru_cache(_REMEMBERED)(self._group_keeps)
        self._check = lru_cache(_REMEMBERED)(self._check_type)

    @property
    def varying(self) -> set[str]:
        """Names of the parameters that may differ between variations."""
        if self.distribution is None:
            return set()
        definition = self.distribution.definition
        several = definition.distributions if isinstance(definition, Deterministic) else ()
        # Of stochastic ones nothing is known before a draw: all may vary.
        single = {name for part in several if part.size == 1 for name in part.parameter_names}
        return self._places.keys() - single

    def variation(self, index: int) -> Variation:
        """The variation at an index from 0; the last listed distribution varies fastest."""
        if not 0 <= index < self.size:
            raise UsageError(
                f"there is no variation {index}, the last of {self.size} is {self.size - 1}"
            )
        return self.scenario, self._assignment(index, None)

    def draw(self, index: int, seed: float) -> Variation:
        """The random variation with that number: from a deterministic space any with the same
        probability."""
        if self.distribution is not None and isinstance(
            self.distribution.definition, Deterministic
        ):
            # A generator for each number: a draw does not depend on those before it.
            index = random.Random(f"{float(seed)}/{index}").randrange(self.size)
        return self.scenario, self._assignment(index, seed)

    def admits(self, parameters: dict[str, str]) -> bool:
        """Whether values keep the scenario's parameter constraints.

        Raises:
            InvalidFile: a value is not of its parameter's type, or a constraint has no value.
        """
        if self.distribution is None or not self._constrained:
            return True
        # All groups are asked: a value that is not of its type is an error in any case.
        kept = [
            self._keeps(number, tuple(map(parameters.get, group)))
            for number, group in enumerate(self._constrained)
        ]
        return all(kept)

    def _group_keeps(self, number: int, values: tuple[str | None, ...]) -> bool:
        """Whether values, in their order, keep the constraints of a group; None where the default
        counts."""
        group = self._constrained[number]
        assigned = {
            name: self._assigned(name, value)
            for name, value in zip(group, values, strict=True)
            if value is not None
        }
        return next(ParameterScope(group.values(), None, assigned).violations(), None) is None

    def _assignment(self, index: int, seed: float | None) -> dict[str, str]:
        if self.distribution is None:
            return {}
        definition = self.distribution.definition
        if isinstance(definition, Deterministic):
            values = definition.assignment(index)
        else:
            values = {
                name: self._written(name, value)
                for name, value in definition.assignment(index, seed).items()
            }
        # Here, not at the start of the run: the error names the line of this file that gives the
        # value.
        for name, value in values.items():
            self._check(name, value)
        return values

    def _check_type(self, name: str, value: str) -> None:
        """Refuse, at its place in this file, a value that is not of its parameter's type."""
        try:
            meant(type_named(self._types[name]), value)
        except ValueError as error:
            raise self._places[name].invalid(
                f"the value of the parameter {name}: {error}"
            ) from None

    def _written(self, name: str, value: str | float) -> str:
        """A drawn number as its parameter's type: the nearest integer for the integer types."""
        if isinstance(value, str):
            return value
        # `round` of an infinite draw would raise; the type's check refuses it at its place.
        whole = self._types[name] not in ("double", "string") and math.isfinite(value)
        return text(round(value) if whole else value)

    def _assigned(self, name: str, value: str) -> Assignment:
        return Assignment(value, self._places[name].invalid)


class Variations(Iterator[Variation]):
    """The variations of a space in order, made one by one.

    Attributes:
        index: number in the space of the last one.
        excluded: how many have been left out so far because they violate the scenario's
            constraints.
    """

    def __init__(self, space: ParameterSpace, enforce_constraints: bool = True) -> None:
        self.index = -1
        self.excluded = 0
        self._space = space
        self._enforce = enforce_constraints
        self._next = 0

    def __next__(self) -> Variation:
        for _ in range(MAX_EXCLUDED):
            if self._next >= self._space.size:
                raise StopIteration
            variation = self._space.variation(self._next)
            self.index = self._next
            self._next += 1
            if not self._enforce or self._space.admits(variation[1]):
                return variation
            self.excluded += 1
        raise self._space.node.invalid(
            f"{MAX_EXCLUDED} variations in a row violate the constraints of {self._space.scenario}"
        )


def variations(path: str | os.PathLike[str], enforce_constraints: bool = True) -> Variations:
    """The scenario and parameter values of each variation that a distribution file lists or draws,
    lazily.

    Source: OpenSCENARIO XML 1.3.1, section on parameter value distributions: deterministic
    distributions are combined as a cartesian product (the last listed varies fastest here); a
    stochastic one gives its number of test runs.

    Args:
        path: the distribution file, or the name of a shipped one; a scenario gives itself, without
            parameter values.
        enforce_constraints: leave out what violates the scenario's constraint groups; `.excluded`
            counts that.

    Raises:
        InvalidFile: a file is malformed, the scenario does not declare a distribution's parameter,
            or, while iterating, a value is not of its parameter's type or practically nothing in
            the space keeps the constraints.
        Unsupported: a user-defined distribution has no plug-in.

    Example:
        >>> import xosc_toolchain as xt
        >>> found = list(xt.variations("xosc/library/simple_cut_in_variation.xosc"))
        >>> len(found)
        8
        >>> path, parameters = found[0]
        >>> path.name, parameters["CutIn_Gap_m"]
        ('simple_cut_in.xosc', '5')
    """
    return Variations(ParameterSpace(named(Path(path))), enforce_constraints)


def sample(
    path: str | os.PathLike[str], number: int, seed: float = 0, enforce_constraints: bool = True
) -> Iterator[Variation]:
    """Random variations, with replacement, the same for the same seed.

    Raises:
        UsageError: practically nothing in the space keeps the constraints.
        ToolchainError: see `variations`.

    Example:
        >>> import xosc
        >>> variation = "xosc/library/simple_cut_in_variation.xosc"
        >>> for path, parameters in xosc.sample(variation, 2, seed=1):
        ...     print(path.name, parameters["CutIn_Gap_m"])
        simple_cut_in.xosc 15
        simple_cut_in.xosc 5
    """
    # It becomes part of a text, and `nan` would be a seed like others.
    if not math.isfinite(seed):
        raise UsageError(f"the seed must be a finite number, not {seed}")
    return islice(_drawn(ParameterSpace(path), seed, enforce_constraints), number)


def _drawn(space: ParameterSpace, seed: float, enforce_constraints: bool) -> Iterator[Variation]:
    # Counted in a row: a space of which few sets keep the constraints still yields these.
    index = rejections = 0
    while rejections < MAX_REJECTIONS:
        variation = space.draw(index, seed)
        index += 1
        if not enforce_constraints or space.admits(variation[1]):
            rejections = 0
            yield variation
        else:
            rejections += 1
    raise UsageError(
        f"none of {MAX_REJECTIONS} samples satisfies the constraints of {space.scenario}"
    )


def _declarations(scenario: Document) -> list[Node]:
    declarations = scenario.node.find("ParameterDeclarations")
    return declarations.children("ParameterDeclaration") if declarations is not None else []


def _types(declarations: dict[str, Node]) -> dict[str, str]:
    """The type of each parameter; where it is an expression, that of the parameters' defaults."""
    types = {name: declaration.get("parameterType") for name, declaration in declarations.items()}
    if any("$" in kind for kind in types.values()):
        return {
            name: parameter.type
            for name, parameter in ParameterScope(declarations.values()).own.items()
        }
    return types


def _places(node: Node) -> Iterator[tuple[str, Node]]:
    """Yield each parameter with the element that gives its values."""
    for place in node.iter("DeterministicSingleParameterDistribution", "StochasticDistribution"):
        yield place.get("parameterName"), place
    for place in node.iter("ParameterAssignment"):
        yield place.get("parameterRef"), place


def _constrained(declarations: dict[str, Node]) -> dict[str, Node]:
    """Declarations with constraints, and the declarations that these depend on."""
    needed: dict[str, Node] = {}
    pending = [
        name for name, declaration in declarations.items() if declaration.find("ConstraintGroup")
    ]
    while pending:
        name = pending.pop()
        if name in needed or name not in declarations:
            continue
        needed[name] = declarations[name]
        # What a constraint compares with decides as well, though it has none itself.
        pending.extend(_needs(declarations[name]))
    return needed


def _needs(declaration: Node) -> Iterator[str]:
    """Names of the parameters that a declaration's value and constraints depend on."""
    for node in declaration.iter("ParameterDeclaration", "ValueConstraint"):
        try:
            yield from references(node.get("value"))
        except ExpressionError as error:
            raise node.invalid(error.message) from None


def _groups(constrained: dict[str, Node]) -> list[dict[str, Node]]:
    """The declarations in groups that do not depend on each other, in their order."""
    groups: list[set[str]] = []
    for name, declaration in constrained.items():
        joined = {name, *_needs(declaration)}
        # A declaration that several groups depend on makes one group of them.
        apart = [group for group in groups if group.isdisjoint(joined)]
        groups = [*apart, joined.union(*(group for group in groups if group not in apart))]
    return [{name: node for name, node in constrained.items() if name in group} for group in groups]


_MOST_NUMBERED = 10**18
_SPAN = re.compile(r"(\d+)(?:-(\d+))?")


@dataclass(frozen=True)
class Selection:
    """Parameter sets of each variation file: by default every one. A scenario, which is no
    variation file, is always chosen.

    Args:
        only: numbers of parameter sets as first and last, from 0; empty for all.
        sample: how many sets are drawn; None for all. Where a file has fewer, it is all of them.
        seed: of the draws.

    Raises:
        UsageError: both are given.
    """

    only: tuple[tuple[int, int], ...] = ()
    sample: int | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if self.only and self.sample is not None:
            raise UsageError("--only and --sample exclude each other")

    @property
    def chooses(self) -> bool:
        """Whether sets are left out."""
        return bool(self.only) or self.sample is not None

    @property
    def _apart(self) -> list[tuple[int, int]]:
        """The spans of `only` in ascending order, overlapping ones joined: each number once."""
        joined: list[tuple[int, int]] = []
        for first, last in sorted(self.only):
            if joined and first <= joined[-1][1]:
                joined[-1] = joined[-1][0], max(joined[-1][1], last)
            else:
                joined.append((first, last))
        return joined

    def count(self, space: ParameterSpace) -> int:
        """Return the number of parameter sets of a space. Sets that constraints exclude are
        counted."""
        if self.only and space.distribution is not None:
            return sum(max(0, min(last, space.size - 1) - first + 1) for first, last in self._apart)
        return space.size if self.sample is None else min(self.sample, space.size)

    def sets(
        self,
        space: ParameterSpace,
        enforce_constraints: bool,
        tell: Callable[[int], None] = lambda count: None,
    ) -> Iterator[tuple[int, dict[str, str]]]:
        """Number and values of each set, in ascending order; sets that violate constraints are left
        out, unless they were named.

        Args:
            tell: called at the end with the number of sets that violate constraints, if there are
                any.

        Raises:
            UsageError: a number is beyond the last one.
            InvalidFile: no set, or practically none, keeps the constraints.
        """
        if self.only and space.distribution is not None:
            # Number by number: a span may be longer than what memory can list, and the first one
            # beyond the space is refused.
            for index in chain.from_iterable(range(a, b + 1) for a, b in self._apart):
                yield index, space.variation(index)[1]
            return
        if self.sample is not None and self.sample < space.size:
            for index in self._drawn(space, enforce_constraints):
                yield index, space.variation(index)[1]
            return
        every = Variations(space, enforce_constraints)
        for _, values in every:
            yield every.index, values
        # Nothing to run is no success: a batch without runs would pass.
        if every.excluded and every.excluded == space.size:
            raise _none_kept(space, f"none of {many(space.size, 'parameter set')}")
        if every.excluded:
            tell(every.excluded)

    def _drawn(self, space: ParameterSpace, enforce_constraints: bool) -> list[int]:
        """Numbers of different sets; the space, of any size, is not enumerated."""
        assert self.sample is not None
        draws, kept, rejected = random.Random(self.seed), set[int](), set[int]()
        tries = 0
        while (
            len(kept) < self.sample
            and len(kept) + len(rejected) < space.size
            and tries < MAX_REJECTIONS
        ):
            # By drawing until enough differ: a shuffled list of a space could exceed memory.
            index = draws.randrange(space.size)
            tries += 1
            if index in kept or index in rejected:
                continue
            if enforce_constraints and not space.admits(space.variation(index)[1]):
                rejected.add(index)
            else:
                kept.add(index)
                tries = 0
        if not kept:
            raise _none_kept(space, f"none of {many(len(rejected), 'sample')}")
        return sorted(kept)


def _none_kept(space: ParameterSpace, subject: str) -> InvalidFile:
    return space.node.invalid(
        f"{subject} satisfies the constraints of {space.scenario}: nothing is left to run; "
        "mend the values or the constraints, or give --no-constraints"
    )


def numbered(name: str, index: int) -> str:
    """Return the name of a parameter set: that of its file, and its number, or the digest of one
    too long for a file name."""
    return (
        f"{name}~{index:06d}" if index < _MOST_NUMBERED else f"{name}~{digest(str(index).encode())}"
    )


def spans(text: str) -> tuple[tuple[int, int], ...]:
    """Numbers of parameter sets as first and last, from a text such as `3,7-9`.

    Raises:
        UsageError: it is of another form.
    """
    chosen = []
    for part in text.split(","):
        match = _SPAN.fullmatch(part.strip())
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (1, 0)
        if last < first:
            raise UsageError(
                f"--only {text!r}: numbers of parameter sets are expected, such as 3,7-9"
            )
        chosen.append((first, last))
    return tuple(chosen)
