"""Varied parameters beyond recordings: ranges, distributions of variation files, names of roles."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lxml import etree

import xosc
from generation.density.marginals import Choices, Marginal, marginal, uniform
from generation.density.models import UNIFORM
from generation.density.roles import EGO, ROLES, Role
from generation.recorded import Recorded, kind_of, of_recordings, of_samples, of_statements
from generation.search.space import Space
from generation.settings import Ask
from schemas.common.errors import UsageError, nearest
from xosc.distributions import DeterministicMultiParameterDistribution, ParameterSpace
from xosc.exports import standard
from xosc.exports.concrete import copied
from xosc.exports.draft import Draft, ExportSettings, Folder
from xosc.node import Node


class NothingToVary(UsageError):
    """A variation file leaves nothing to search.

    Attributes:
        reason: without a remedy. scenario: its scenario, which can be searched itself.
    """

    def __init__(self, reason: str, scenario: Path, path: Path) -> None:
        super().__init__(f"{reason}: search {scenario.name} itself", path=path)
        self.reason, self.scenario = reason, scenario

    def __reduce__(self) -> tuple[object, ...]:
        return (type(self), (self.reason, self.scenario, Path(str(self.path))))


class Varied(NamedTuple):
    """Contents of a variation file.

    Attributes:
        scenario: its file.
        marginals: densities of the parameters that it varies.
        pinned: values of those to which it gives one, or words to choose from, of which it is the likeliest.
    """

    scenario: Path
    marginals: dict[str, Marginal]
    pinned: dict[str, str]


def varied(path: Path) -> Varied | None:
    """Read a variation file; None for a scenario.

    Raises:
        InvalidFile: the file is malformed, or a catalogue.
        UsageError: one of its distributions has no density.
    """
    if xosc.load(path).kind != "distribution":
        return None
    space = ParameterSpace(path)
    found = Varied(space.scenario, {}, {})
    if space.distribution is None:
        return None
    for each in space.distribution.definition.distributions:
        if isinstance(each, DeterministicMultiParameterDistribution):
            name, choices = _sets(each.value_sets, space.scenario, path)
            found.marginals[name] = choices
            continue
        try:
            of = marginal(each.distribution)
        except UsageError as error:
            raise UsageError(f"{each.parameter_name}: {error.message}", path=path) from None
        if isinstance(of, str):
            found.pinned[each.parameter_name] = of
        else:
            found.marginals[each.parameter_name] = of
    return found


def _sets(sets: Sequence[Mapping[str, str]], scenario: Path, path: Path) -> tuple[str, Choices]:
    """Sets of values as the values of one parameter, a number that is another one in each set; the others follow it.

    Raises:
        NothingToVary: there is one set alone, or no such parameter.
    """
    for name in sets[0]:
        try:
            values = [float(each[name]) for each in sets]
        except (KeyError, ValueError):
            continue
        if len(values) > 1 and len(set(values)) == len(values) and np.isfinite(values).all():
            rest = [{other: text for other, text in each.items() if other != name} for each in sets]
            follows = dict(sorted(zip(values, rest, strict=True), key=lambda each: each[0]))
            return name, Choices(tuple(follows), (1.0,) * len(values), follows if any(rest) else {})
    raise NothingToVary("no number tells its sets of values apart", scenario, path)


def scenario_of(path: Path) -> Path:
    """The scenario of a variation file; of a scenario, itself."""
    variation = varied(path)
    return path if variation is None else variation.scenario


def _refuse_undeclared(scenario: Path, roles: Mapping[str, Role]) -> None:
    """A role of what the scenario does not declare is better named before anything else is asked for."""
    holder = xosc.load(scenario).node.find("ParameterDeclarations")
    declared = [each.get("name") for each in holder.children("ParameterDeclaration")] if holder is not None else []
    for name in roles:
        if name not in declared:
            raise UsageError(f"--map: there is no parameter {name!r}; {nearest(name, declared)}", path=scenario)


def freed(texts: Iterable[str]) -> tuple[tuple[str, ...], dict[str, Marginal]]:
    """Names to search, and the ranges of those that have one, from texts NAME or NAME=LOW..HIGH.

    Raises:
        UsageError: a text is of neither form.
    """
    names, ranges = [], {}
    for text in texts:
        name, equals, limits = text.partition("=")
        low, dots, high = limits.partition("..")
        try:
            if equals:
                ranges[name] = uniform(float(low), float(high))
            elif name:
                names.append(name)
            if not name or bool(equals) != bool(dots):
                raise ValueError
        except (ValueError, UsageError):
            raise UsageError(f"--free {text!r}: NAME or NAME=LOW..HIGH is expected, as Ego_Speed_mps=10..40") from None
    return tuple(names), ranges


def with_literals(ask: Ask, path: Path, folder: Path) -> tuple[Ask, Path]:
    """Declare literals of a scenario that are to be searched as parameters, in a copy with all that it refers to.

    A literal is LINE@ATTRIBUTE of the file, as in `--free 87@value=10..40`.

    Returns:
        what is asked for by the names of the parameters, and the copy; both as they are without literals.

    Raises:
        UsageError: it is none of a scenario, or no number. NotWritten: the folder has another scenario of that name.
    """
    literals = [text for text in ask.free if _LITERAL.match(text)]
    if not literals:
        return ask, path
    document = copied(xosc.load(path))
    if document.kind != "scenario":
        raise UsageError(f"--free {literals[0]}: literals are those of a scenario", path=path)
    declared = document.node.find("ParameterDeclarations")
    holder = declared.element if declared is not None else document.root.makeelement("ParameterDeclarations", {}, None)
    if declared is None:
        document.node.need("FileHeader").element.addnext(holder)
    free = [text for text in ask.free if text not in literals]
    for text in literals:
        where, _, limits = text.partition("=")
        name, value = _declared(document.node, where, path)
        etree.SubElement(holder, "ParameterDeclaration", name=name, parameterType="double", value=value)
        free.append(f"{name}={limits}")
    draft = Draft(Folder(folder), ExportSettings())
    standard.add(document, None, draft)
    draft.write()
    return replace(ask, free=free), folder / f"{path.stem}.xosc"


_LITERAL = re.compile(r"\d+@\w")


def _declared(root: Node, where: str, path: Path) -> tuple[str, str]:
    """Put a reference in the place of a literal; the name of its parameter, and its value."""
    line, _, attribute = where.partition("@")
    found = [each for each in root.iter() if each.line == int(line) and each.has(attribute)]
    if len(found) != 1:
        raise UsageError(f"--free {where}: {len(found) or 'no'} elements of this line have the attribute {attribute}", path=path)
    value = found[0].get(attribute)
    try:
        float(value)
    except ValueError:
        raise UsageError(f"--free {where}: {attribute} is {value!r}, not a number", path=path) from None
    name = f"{found[0].tag}_{attribute}_{line}"
    found[0].element.set(attribute, f"${name}")
    return name, value


def mapped(texts: Iterable[str]) -> dict[str, Role]:
    """Roles by parameter, from texts NAME=ROLE or NAME=ROLE*FACTOR.

    Raises:
        UsageError: a text is not of that form, there is no such role, or two parameters have the same.
    """
    found: dict[str, Role] = {}
    for text in texts:
        name, equals, right = text.partition("=")
        role, times, factor = right.partition("*")
        try:
            scale = float(factor) if times else 1.0
        except ValueError:
            scale = 0.0
        if not (name and equals and scale > 0.0):
            raise UsageError(f"--map {text!r}: NAME=ROLE or NAME=ROLE*FACTOR is expected, as Ego_speed_kph=ego_speed*3.6")
        if role not in ROLES:
            raise UsageError(f"--map {text!r}: recordings have no role {role!r}; roles: {', '.join(ROLES)}")
        if role in (each.role for each in found.values()):
            raise UsageError(f"--map {text!r}: another parameter has the role {role}")
        found[name] = Role(EGO, role, scale)
    return found


class Asked(NamedTuple):
    """A search as it was asked for.

    Attributes:
        scenario: the file to search.
        recorded: gives what is recorded of the parameters of its space, or stated in its place.
        pinned, free, marginals, default: see `generation.settings.SearchSettings`.
    """

    scenario: Path
    recorded: Callable[[Space], Recorded]
    pinned: Mapping[str, str]
    free: tuple[str, ...]
    marginals: Mapping[str, Marginal]
    default: bool


def asked_of(ask: Ask, path: Path) -> Asked:
    """The search of a scenario, or of the one that a variation file is about, with what that varies, as the options say.

    Recordings say what is likely where a kind of them is known: by `--kind`, or of a scenario of the library by its name.
    Otherwise the distributions of the variation file and the ranges of `--free` are the density, and with the density
    `uniform` the limits of all that is searched.

    Raises:
        UsageError: an option is wrong, or nothing says what is likely.
        InvalidFile: a file is malformed.
    """
    variation, (free, ranges), roles = varied(path), freed(ask.free), mapped(ask.maps)
    scenario = variation.scenario if variation is not None else path
    if variation is not None and not (variation.marginals or ranges or free or roles):
        raise NothingToVary("it gives each parameter one value, which leaves nothing to search", scenario, path)
    _refuse_undeclared(scenario, roles)
    stated = {**(variation.marginals if variation is not None else {}), **ranges}
    marginals = {name: each for name, each in stated.items() if name not in ask.pinned}
    pinned = {**(variation.pinned if variation is not None else {}), **ask.pinned}
    pinned = {name: value for name, value in pinned.items() if name not in ranges and name not in free}
    if _is_recorded(ask, scenario, variation is not None, bool(marginals)):
        samples, simulated = of_recordings(ask.recordings, ask.kind or kind_of(scenario)), ask.recordings is None
        default = variation is None and not roles
        named = (*free, *(name for name in roles if name not in marginals))
        recorded = partial(of_samples, samples, mapped=roles, marginals=marginals, simulated=simulated)
        return Asked(scenario, recorded, pinned, named, marginals, default)
    default = variation is None and not ranges
    return Asked(scenario, partial(of_statements, marginals), pinned, free, marginals, default)


def _is_recorded(ask: Ask, scenario: Path, variation: bool, stated: bool) -> bool:
    """Whether recordings say what is likely."""
    if ask.density == UNIFORM:
        return False
    if ask.kind is not None or ask.recordings is not None or ask.maps:
        return True
    try:
        kind_of(scenario)
    except UsageError:
        if stated:
            return False
        raise
    return not variation
