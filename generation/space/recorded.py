"""Recorded parameters of a scenario: from a table of units, or from a catalogue of scenarios that
were recognised."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

import xosc
from generation.space.density.marginals import Admits, DeclaredPrior, JointPrior, Marginal, uniform
from generation.space.density.models import judge
from generation.space.density.prior import Box, Prior, RecordedPrior
from generation.space.density.roles import (
    KINDS_OF_SCENARIOS,
    NUISANCES,
    PAIRED,
    ROLES,
    Role,
    roles_of,
)
from generation.space.space import Space, free_option, numbers
from recognition.labels import Label
from recognition.labels.maneuvers.parameters import (
    BRAKING,
    CUT_IN,
    CUT_OUT,
    JERK,
    KINDS,
    LANE_CHANGE,
    Parameter,
)
from recognition.labels.maneuvers.units import OWN, Exposure, Samples, extract
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.errors import Unsupported, UsageError
from schemas.common.policy import scratch
from schemas.common.terminal.text import many
from xosc.document import Document
from xosc.document.node import Node
from xosc.resolve.parameters import ParameterScope
from xosc.writing.tags import PREFIX

if TYPE_CHECKING:
    from generation.space.logical.pairs import PairUnits

_RECORDING, _CLASS = f"{PREFIX}Recording", f"{PREFIX}Class"
_KINDS_OF_CLASSES = {
    **dict.fromkeys((Label.CUT_IN.title, Label.URBAN_CUT_IN.title), CUT_IN),
    **dict.fromkeys((Label.CUT_OUT.title, Label.URBAN_CUT_OUT.title), CUT_OUT),
    **dict.fromkeys(
        (
            Label.LANE_CHANGE_LEFT.title,
            Label.LANE_CHANGE_RIGHT.title,
            Label.RAMP_ENTERING.title,
            Label.RAMP_EXITING.title,
        ),
        LANE_CHANGE,
    ),
    **{
        label.title: BRAKING
        for label in (
            Label.FREE_CRUISE,
            Label.CAR_FOLLOWING,
            Label.ROUNDABOUT_ENTERING,
            Label.ROUNDABOUT_EXITING,
            Label.ROUNDABOUT_CIRCULATING,
            Label.LEFT_TURN,
            Label.RIGHT_TURN,
            Label.STRAIGHT_CROSS,
            Label.MERGING,
        )
    },
}
"""Kind of the units that are like the manoeuvre of a class: changes of lane, else of speed"""
_BESIDE = 7
"""Candidates, by the ego's speed, for the unit of the next actor: the nearest may be of the same
lane change."""
_DRAWN, _PARTS = 1000, 5
"""Draws in the place of recorded units, and how many recordings they count as."""


class Recorded(NamedTuple):
    """Recorded values of a space's parameters.

    Attributes:
        theta: parameters (n, d) in its order.
        recordings: the recording (n,) that each row is from.
        errors: root mean squares (n, 2), m, across and along the lane, of the motion that all seven
            parameters of the unit stand for; None where that is not known.
        values: recorded values (n,) by parameter, of pinned ones too.
        roles: of these parameters.
        marginals: densities of those of which nothing is recorded; their columns of `theta` are
            drawn.
        kind: of the units, or of the pairs; empty where they are of several or none.
        exposure: of the recordings, by their names; none where it is not known.
        pairs: what two adversaries did, where the rows are such pairs.
        simulated: whether the recorded traffic is simulated, as that of our own recordings is.
    """

    theta: FloatArray
    recordings: NDArray[np.str_]
    errors: FloatArray | None = None
    values: Mapping[str, FloatArray] = MappingProxyType({})
    roles: Mapping[str, Role] = MappingProxyType({})
    marginals: Mapping[str, Marginal] = MappingProxyType({})
    kind: str = ""
    exposure: Mapping[str, Exposure] = MappingProxyType({})
    pairs: PairUnits | None = None
    simulated: bool = False

    def prior(self, space: Space, density: str) -> Prior:
        """Return the prior of a space.

        Args:
            density: name of the model of what is recorded (`generation.space.density.models`).

        Raises:
            UsageError: there is no such density, or it can't be made of them.
        """
        # All is stated: the draws in `theta` are of the statement, and make no recorded density.
        if len(self.marginals) == len(space.names):
            return self._stated(space, space.admits)
        told = self.recorded_prior(space, judge(density, self.pairs is not None))
        # The plain case first: parts and constraints cost time in each draw.
        if not self.marginals and space.constraints is None and self.pairs is None:
            return told
        parts = (told, self._stated(space)) if self.marginals else (told,)
        return JointPrior(
            space.names, parts, partial(self._admitted, space), self.alone(space, density)
        )

    def alone(self, space: Space, density: str) -> list[RecordedPrior]:
        """Return the prior of each of two adversaries, from all units of its kind, independent of
        the other one."""
        priors = []
        for recorded in self.pairs.alone if self.pairs is not None else ():
            names = tuple(name for name in space.names if name in recorded.values)
            columns = [space.names.index(name) for name in names]
            pinned = {
                name: float(value)
                for name, value in space.pinned.items()
                if name in recorded.values
            }
            # All of one adversary may be pinned: then nothing of it is left to judge.
            if names:
                box = Box(names, space.low[columns], space.high[columns], pinned)
                priors.append(
                    RecordedPrior(
                        box, recorded.values, recorded.recordings, recorded.roles, density
                    )
                )
        return priors

    def _admitted(self, space: Space, theta: FloatArray) -> BoolArray:
        """Rows (n, d) that keep the scenario's constraints, without overlap of vehicles: (n,)."""
        admitted = space.admits(theta)
        if self.pairs is not None:
            admitted = admitted & self.pairs.apart(space.by_name(theta))
        return admitted

    def recorded_prior(self, space: Space, density: str) -> RecordedPrior:
        """Return the prior of those of a space's parameters that are recorded."""
        values = self.values or dict(zip(space.names, self.theta.T, strict=True))
        pinned = {name: float(value) for name, value in space.pinned.items() if name in values}
        # The others have a stated prior beside this one (`prior`).
        kept = [index for index, name in enumerate(space.names) if name not in self.marginals]
        box = Box(
            tuple(space.names[index] for index in kept), space.low[kept], space.high[kept], pinned
        )
        return RecordedPrior(box, values, self.recordings, self.roles or roles_of(values), density)

    def _stated(self, space: Space, admits: Admits | None = None) -> DeclaredPrior:
        """Prior of parameters that are not recorded."""
        roles = roles_of(space.names)
        nuisances = [
            name for name in self.marginals if name in roles and roles[name].role in NUISANCES
        ]
        marginals = {name: self.marginals[name] for name in space.names if name in self.marginals}
        return DeclaredPrior(
            marginals, admits, nuisances, self.theta if admits is not None else None
        )

    def replays(self, space: Space) -> tuple[Space, FloatArray] | None:
        """A space in which nothing is pinned that is recorded, and the units (n, k) inside the
        limits, with their own values.

        None where something is searched of which nothing is recorded: there is nothing to replay.
        """
        if self.marginals:
            return None
        own = [name for name in self.values if name in space.pinned]
        # The limits of the recordings themselves: outside of the box nobody asked for any.
        sides = [
            Parameter(name, float(self.values[name].min()), float(self.values[name].max()))
            for name in own
        ]
        inside = self.within(space)
        columns = [inside.theta, *(inside.values[name][:, None] for name in own)]
        rest = {name: value for name, value in space.pinned.items() if name not in own}
        return Space((*space.parameters, *sides), rest), np.hstack(columns)

    def within(self, space: Space) -> Recorded:
        """Return the values inside the box."""
        inside = ((self.theta >= space.low) & (self.theta <= space.high)).all(axis=1)
        errors = None if self.errors is None else self.errors[inside]
        values = {name: column[inside] for name, column in self.values.items()}
        return self._replace(
            theta=self.theta[inside],
            recordings=self.recordings[inside],
            errors=errors,
            values=values,
        )


class RecordedScenario(NamedTuple):
    """A scenario of a catalogue, names of its searchable parameters, and what is recorded of them
    in all its like."""

    path: Path
    names: tuple[str, ...]
    recorded: Recorded

    def on(self, space: Space) -> Recorded:
        """The columns that belong to a space of the scenario.

        Raises:
            UsageError: the catalogue has no values of one of the parameters.
        """
        unknown = [name for name in space.names if name not in self.names]
        if unknown:
            raise UsageError(f"the catalogue has no values of the parameter {unknown[0]}: pin it")
        columns = [self.names.index(name) for name in space.names]
        values = dict(zip(self.names, self.recorded.theta.T, strict=True))
        return Recorded(
            self.recorded.theta[:, columns],
            self.recorded.recordings,
            None,
            values,
            roles_of(self.names),
        )


def shipped_instead(scenario: RecordedScenario, space: Space, least: int) -> Recorded | None:
    """Units that are shipped, where fewer than `least` of a catalogue's own are inside a space, or
    all are of one recording.

    Returns:
        None where there are enough, or no units are like the scenario's class.
    """
    own = scenario.on(space).within(space)
    # A density is tested on a recording that it was not fitted on.
    if len(own.theta) >= least and len(np.unique(own.recordings)) > 1:
        return None
    try:
        return of_samples(of_recordings(None, kind_of(scenario.path)), space, simulated=True)
    except UsageError:
        return None


_LEAST_LIKELY = 1e-3
"""Least share of a density inside the limits of the parameters: below, next to no draw is"""


def stated_instead(recorded: Recorded, space: Space, density: str) -> Recorded | None:
    """Draws from the limits, where shipped units have next to nothing inside them, as beside a
    vehicle that stands; None elsewhere.

    Densities that the user names are kept: they state what is likely.
    """
    if not recorded.simulated or recorded.pairs is not None or not recorded.values:
        return None
    try:
        likely = recorded.recorded_prior(space, density).possible_share >= _LEAST_LIKELY
    except UsageError:
        likely = False
    return None if likely else of_statements(recorded.marginals, space)


def of_recordings(path: Path | None, kind: str) -> Samples | PairUnits:
    """Units of a kind, or pairs of units.

    Args:
        path: recordings, or a table of units that `recognition.labels.maneuvers.units.Samples`
            wrote; None for those of our own recordings.

    Raises:
        UsageError: there is no such kind, or the recordings have no units.
        InvalidFile: a file is malformed.
    """
    if kind not in (*KINDS, *PAIRED):
        raise UsageError(
            f"there are no units of the kind {kind!r}; kinds: {', '.join((*KINDS, *PAIRED))}"
        )
    samples = _units(path)
    if kind in KINDS:
        return samples.of_kind(kind)
    from generation.space.logical.pairs import PAIRS, pair_units

    return pair_units(samples, PAIRS[kind])


def _units(path: Path | None) -> Samples:
    if path is None or Samples.claims(path):
        return Samples.read(path or OWN)
    with scratch("xosc-roads-") as roads:
        return extract(path, roads)


def kind_of(scenario: Path) -> str:
    """The kind of recorded units that a scenario is about, by its name (the library's) or, for a
    recorded one, the tag of its class.

    Raises:
        UsageError: it has neither, or is not there.
    """
    if not scenario.is_file():
        raise UsageError("no such file", path=scenario)
    # By the beginning of the name: `cut_in_highway` and `cut_in_narrow_road` have the same units.
    named = (
        kind for name, kind in KINDS_OF_SCENARIOS.items() if scenario.stem.startswith(f"{name}_")
    )
    kind = next(named, None) or _kind_of_recording(xosc.load(scenario).node)
    if kind is None:
        raise UsageError(
            "nothing says which values are likely: it is no recorded scenario of a known class, "
            "and its name is not that of a manoeuvre, as "
            f"cut_in_highway.xosc. Give ranges, as {free_option(numbers(scenario))}, or --density "
            "uniform for all that has limits, "
            "or name recorded units that are like it by --kind",
            path=scenario,
        )
    return kind


def of_samples(
    samples: Samples | PairUnits,
    space: Space,
    mapped: Mapping[str, Role] = MappingProxyType({}),
    marginals: Mapping[str, Marginal] = MappingProxyType({}),
    simulated: bool = False,
) -> Recorded:
    """The columns of a table that belong to a space: the seven of its actor, and the speed of the
    other vehicle.

    Two actors of pairs have those of the same pair. Several actors otherwise have the values of as
    many units, of egos that are about as fast.

    Args:
        mapped: roles of parameters whose names don't tell them.
        marginals: densities of parameters of which nothing is recorded.
        simulated: whether the recorded traffic is simulated.

    Raises:
        UsageError: recordings have no values of one of the parameters.
    """
    if not isinstance(samples, Samples):
        return _of_pairs(samples, space)._replace(simulated=simulated)
    samples, roles = _with_jerk(samples, roles_of([*space.names, *space.pinned], mapped), space)
    table = dict(zip(ROLES, [*samples.theta.T, samples.ego_speeds, samples.jerks], strict=True))
    units = _units_of_actors(
        list(dict.fromkeys(role.actor for role in roles.values())), samples.ego_speeds
    )
    values = {
        name: role.factor * table[role.role][units[role.actor]] for name, role in roles.items()
    }
    unknown = [name for name in space.names if name not in values and name not in marginals]
    if unknown:
        raise UsageError(
            f"recordings have no values of the parameter {unknown[0]}: pin it, give it a range by "
            f"--free {unknown[0]}=LOW..HIGH, "
            "or say by --map what it is in recordings"
        )
    rest = {name: marginals[name] for name in space.names if name not in values}
    drawn = _drawn(rest, len(samples.theta))
    theta = np.stack(
        [values[name] if name in values else drawn[name] for name in space.names], axis=1
    )
    kinds = sorted(set(samples.kinds.tolist()))
    # Exposure is counted for each kind: mixed units have no rate.
    kind = kinds[0] if len(kinds) == 1 else ""
    return Recorded(
        theta,
        samples.recordings,
        samples.errors,
        values,
        roles,
        rest,
        kind,
        samples.exposure,
        None,
        simulated,
    )


def _with_jerk(
    samples: Samples, roles: Mapping[str, Role], space: Space
) -> tuple[Samples, Mapping[str, Role]]:
    """Return the samples with known jerk if it is searched; drop its role if it is pinned and never
    known."""
    jerk = next((name for name, role in roles.items() if role.role == JERK), None)
    known = np.flatnonzero(np.isfinite(samples.jerks))
    # Units without a known jerk are left out only where it is asked: they are most of them.
    if jerk is None or known.size:
        return (samples if jerk is None else samples.where(known)), roles
    if jerk in space.names:
        raise UsageError(
            f"no jerk is recorded, of which {jerk} is: name recordings, or a table of their "
            "units, by --recorded"
        )
    return samples, {name: role for name, role in roles.items() if name != jerk}


def _of_pairs(samples: PairUnits, space: Space) -> Recorded:
    values, recordings = samples.values, samples.recordings
    unknown = [name for name in space.names if name not in values]
    if unknown:
        raise UsageError(f"recorded pairs have no values of the parameter {unknown[0]}: pin it")
    # Estimated times may let two vehicles overlap that did not.
    kept = samples.apart(values)
    values = {name: column[kept] for name, column in values.items()}
    theta = np.stack([values[name] for name in space.names], axis=1)
    return Recorded(
        theta,
        recordings[kept],
        None,
        values,
        samples.roles,
        {},
        samples.kind,
        samples.exposure,
        samples,
    )


def _units_of_actors(actors: Sequence[str], speeds: FloatArray) -> dict[str, IntArray]:
    """Rows (n,) of the units that each actor has the values of; for the first one all in their
    order.

    Further actors have those some places further by the ego's speed, within blocks, so that the
    fastest get fast ones too.
    """
    order = np.argsort(speeds, kind="stable")
    units = {}
    for number, actor in enumerate(actors):
        beside = _BESIDE * number
        # Blocks of two displacements at least: in one of less a unit would come back to itself.
        blocks = np.array_split(order, max(1, len(order) // (2 * beside))) if beside else [order]
        units[actor] = np.empty(len(speeds), np.int64)
        units[actor][order] = np.concatenate([np.roll(block, -beside) for block in blocks])
    return units


def of_statements(marginals: Mapping[str, Marginal], space: Space) -> Recorded:
    """Draws in the place of recordings, from densities that are stated; uniform where there is
    none."""
    every = {
        parameter.name: marginals.get(parameter.name) or uniform(parameter.low, parameter.high)
        for parameter in space.parameters
    }
    drawn = _drawn(every, _DRAWN)
    theta = np.stack([drawn[name] for name in space.names], axis=1)
    # Drawn evenly and cut: draws that break a constraint are no statement of the user.
    theta = theta[space.admits(theta)]
    return Recorded(
        theta,
        # Cross-validation needs several recordings; draws are independent, so any parts do.
        np.array([f"drawn {number % _PARTS}" for number in range(len(theta))]),
        marginals=every,
    )


def _drawn(marginals: Mapping[str, Marginal], n: int) -> dict[str, FloatArray]:
    generator = np.random.default_rng(0)
    return {name: marginal.sample(n, generator) for name, marginal in marginals.items()}


def of_catalogue(path: Path, alone: bool = False) -> Iterator[RecordedScenario]:
    """Return, for each folder in a catalogue, the scenario in the middle of those that declare the
    same parameters.

    The recorded parameters are the values that those scenarios declare; most of a kind win where
    there are several kinds.

    Args:
        alone: whether scenarios with the ego alone count, which can't collide.
    """
    # The folder itself too: a single class may have been named.
    for folder in folders_of(path):
        kinds: dict[tuple[str, ...], list[tuple[Path, FloatArray, str]]] = {}
        for file in sorted(folder.glob("*.xosc")):
            declared = _declared(file, alone)
            if declared is not None:
                names, row, recording = declared
                kinds.setdefault(names, []).append((file, row, recording))
        if kinds:
            names = max(kinds, key=lambda kind: len(kinds[kind]))
            files, rows, recordings = zip(*kinds[names], strict=True)
            theta = np.array(rows)
            yield RecordedScenario(
                files[_middle(theta)], names, Recorded(theta, np.array(recordings, np.str_))
            )


def folders_of(catalogue: Path) -> list[Path]:
    """Return a catalogue's folders: itself, and those in it."""
    return [catalogue, *sorted(path for path in catalogue.iterdir() if path.is_dir())]


def not_searched(folder: Path) -> str:
    """Reasons for which nothing in a folder of a catalogue is searched, and what to do; empty where
    it has no scenario."""
    lonely = plain = 0
    for file in folder.glob("*.xosc"):
        document = xosc.load(file)
        if document.kind == "scenario":
            alone = _ego_alone(document)
            lonely, plain = lonely + alone, plain + (not alone)
    reasons = []
    if lonely:
        reasons.append(
            f"the ego is alone in {many(lonely, 'scenario')} and can't collide: --fail-if, as "
            "'max_jerk>5', searches other failures of those with parameters"
        )
    if plain:
        reasons.append(
            f"{many(plain, 'scenario')} with others declare no parameter that is a number: name a "
            "file, with --free LINE@ATTRIBUTE=LOW..HIGH for a literal of it"
        )
    return "; ".join(reasons)


def _ego_alone(document: Document) -> bool:
    return len(document.node.need("Entities").children()) < 2


def _declared(file: Path, alone: bool) -> tuple[tuple[str, ...], FloatArray, str] | None:
    """Names and values of a scenario's searchable parameters, and the recording that it is from;
    None without any.

    The same for a scenario with the ego alone, unless these count.
    """
    document = xosc.load(file)
    if document.kind != "scenario" or (_ego_alone(document) and not alone):
        return None
    try:
        names = Space.of(file).names
    except (UsageError, Unsupported):
        return None
    # By the scope: a value may be an expression of other parameters.
    scope = ParameterScope(document.node.need("ParameterDeclarations").children())
    return (
        names,
        np.array([float(scope.literal(f"${name}")) for name in names]),
        _property(document.node, _RECORDING) or file.stem,
    )


def _kind_of_recording(root: Node) -> str | None:
    """The kind by the class of a recorded scenario; None for others, whose parameters may be of any
    kind."""
    # A class alone says nothing: tags of a written scenario are those of its author.
    recorded = _property(root, _RECORDING) is not None
    return _KINDS_OF_CLASSES.get(_property(root, _CLASS) or "") if recorded else None


def _property(root: Node, name: str) -> str | None:
    """The value of a property of a scenario's FileHeader; None without it."""
    properties = root.find("FileHeader", "Properties")
    listed = properties.children("Property") if properties is not None else []
    return next((entry.get("value") for entry in listed if entry.get("name") == name), None)


def _middle(theta: FloatArray) -> int:
    """The row nearest to the columns' medians, in units of their spread."""
    spread = theta.std(axis=0)
    scaled = (theta - np.median(theta, axis=0)) / np.where(spread > 0.0, spread, 1.0)
    return int(np.square(scaled).sum(axis=1).argmin())
