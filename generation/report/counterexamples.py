"""Failures as a tester reads them: measures, counterexamples, the boundary of
failures, and regions.

Counterexamples are the likeliest failure and the nearest to a recording. A region is a group of
failing runs with a rule, its probability, severity and typical member. A rule bounds at most three
measures from one side each. It is fitted to the runs of the folder, which were sought near
failures: its precision and recall are shares of draws of the density, those in arrays that measured
it among them. The probability of a region comes from unguided draws alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from generation.estimation.probability import Probability
from generation.pipeline import Generated, evidence
from generation.search.gate import NEAR, Share, Statement
from generation.search.outcomes import CAREFUL, Cases, Drivers, Outcomes, matrix
from generation.search.settings import SearchSettings
from generation.search.variations import Writer
from generation.space.density.prior import LEAST, by_actor, reading
from generation.space.density.roles import AHEAD, BEGINS, EGO, EGO_SPEED, NUISANCES, Role, roles_of
from generation.space.space import Space, distinctive, grouped
from schemas.common.array_types import BoolArray, FloatArray, IntArray
from schemas.common.terminal.text import many

if TYPE_CHECKING:
    from sklearn.pipeline import Pipeline


_UNITS = {"mps": "m/s", "mps2": "m/s²", "kph": "km/h", "deg": "°"}
"""Units by the suffix of parameter names"""


class Measure(NamedTuple):
    """A measure at some points: its name, its unit, values (n,)."""

    name: str
    unit: str
    values: FloatArray


def measures(space: Space, roles: Mapping[str, Role], theta: FloatArray) -> list[Measure]:
    """Return the measures of points (n, d): of each actor with recorded
    parameters, and all other parameters.

    Args:
        roles: of the parameters that are known in recordings, of pinned ones too: these enter into
            measures, and are none.
    """
    values = space.by_name(theta)
    # Roles of parameters that this scenario does not have would look up nothing.
    roles = {name: role for name, role in roles.items() if name in values}
    actors = by_actor(values, roles) if roles else {}
    listed = [
        measure for actor, of in actors.items() for measure in _of_actor(of, actor, len(actors) > 1)
    ]
    # Times before the manoeuvre begins decide no failure: they would be bounds of a rule by chance.
    nuisances = {name for name, role in roles.items() if role.role in NUISANCES}
    ego = next(
        (name for name, role in roles.items() if role.role == EGO_SPEED and name in space.names),
        None,
    )
    # Where no actor has a measure, parameters with a role are shown as they are.
    read = set(roles) if listed else set(nuisances)
    if ego is not None and listed:
        whose = "leader" if EGO in actors else "ego"
        listed.append(Measure(f"speed of the {whose}", "m/s", values[ego] / roles[ego].factor))
    for name in space.names:
        if coded := space.categories(name):
            listed += _of_categories(coded, values[name])
        elif name not in read:
            listed.append(Measure(name, unit_of(name), values[name]))
    return listed


def _of_categories(
    coded: Mapping[float, Mapping[str, str]], codes: FloatArray
) -> Iterator[Measure]:
    """Measures of what codes (n,) stand for: values of parameters where all are numbers; else, of
    each value, or of the first one of two, whether a point has it, 1 or 0."""
    names = list(dict.fromkeys(name for texts in coded.values() for name in texts))
    # A search moves between codes; a point stands for the nearest one (`Space`).
    near = np.abs(codes[:, None] - np.array(list(coded))).argmin(axis=1)
    for name in names:
        texts = [entry.get(name, "") for entry in coded.values()]
        # A parameter that each choice sets alike tells no runs apart.
        different = list(dict.fromkeys(texts))
        if len(different) < 2:
            continue
        try:
            numbers = np.array([float(text) for text in texts])
        except ValueError:
            # Of two values, one measure tells both.
            for value in different[:-1] if len(different) == 2 else different:
                has = np.array([float(text == value) for text in texts])
                yield Measure(f"{name} is {value or 'its default'}", "", has[near])
        else:
            yield Measure(name, unit_of(name), numbers[near])


def unit_of(name: str) -> str:
    """The unit that a parameter's name ends with, as `Ego_Speed_mps`; empty
    where it ends with none.
    """
    last = name.rpartition("_")[2] if "_" in name else ""
    return _UNITS.get(last, last if last in ("m", "s", "percent") else "")


def _of_actor(of: Mapping[str, FloatArray], actor: str, several: bool) -> Iterator[Measure]:
    """Measures of one actor by the roles that are known."""
    before = f"{actor}: " if several else ""
    start, end, duration = (of.get(role) for role in ("start_speed", "end_speed", "duration"))
    read = reading(of, actor)
    if read.closing is not None:
        yield Measure(f"{before}closing speed", "m/s", read.closing)
    elif start is not None:
        # Where the ego's speed is no parameter, the actor's own speed is all there is.
        yield Measure(f"{before}start speed", "m/s", start)
    if read.headway is not None:
        yield Measure(f"{before}time headway", "s", read.headway)
    # Headway and speed tell the gap already: a boundary over all three would be drawn along a
    # surface.
    elif "gap" in of:
        yield Measure(f"{before}gap", "m", of["gap"])
    if AHEAD in of:
        yield Measure(f"{before}gap to the one before", "m", of[AHEAD])
    if BEGINS in of:
        yield Measure(f"{before}begins at", "s", of[BEGINS])
    if duration is not None:
        yield Measure(
            f"{before}duration" if several else "duration of the manoeuvre", "s", duration
        )
        # Mean over the manoeuvre; a duration of 0, a jump, would have no value.
        if start is not None and end is not None:
            of_whom = (
                f"{before}acceleration" if several else f"acceleration of {actor or 'the actor'}"
            )
            yield Measure(of_whom, "m/s²", (end - start) / np.maximum(duration, LEAST))
    if end is not None and "final_speed" in of:
        yield Measure(f"{before}change of speed afterwards", "m/s", of["final_speed"] - end)


LIKELIEST, NEAREST = "likeliest_failure", "nearest_failure"
"""Suffixes of their files, after the scenario's name"""


@dataclass(frozen=True)
class RecordedUnit:
    """A recorded unit: its recording, values of what is searched, distance from a point as a share
    of the ranges (root mean square over all that distinguishes cases)."""

    recording: str
    values: Mapping[str, float]
    distance: float


@dataclass(frozen=True)
class Counterexample:
    """A failure with its files.

    Attributes:
        names: which one it is, of `LIKELIEST` and `NEAREST`; both where they are the same.
        row: of `Counterexamples.cases`.
        scenario: its file, all values worked out. replay: the page that plays it.
        reproduced: whether the run of that file ends in a collision.
        film: data of its moving picture; None without an encounter.
        recorded: the recorded unit that is most like it; None without recordings.
    """

    names: Sequence[str]
    row: int
    scenario: Path
    replay: Path
    reproduced: bool
    film: dict[str, Any] | None
    recorded: RecordedUnit | None


@dataclass(frozen=True, eq=False)
class Counterexamples:
    """Counterexamples that exist.

    Attributes:
        cases: the failures that they are of, one a row. foreseeable, preventable: which of them
            (n,) are.
    """

    cases: Cases
    foreseeable: BoolArray
    preventable: BoolArray
    found: Sequence[Counterexample]


def counterexamples(
    scenario: Path, generated: Generated, settings: SearchSettings, drivers: Drivers, out: Path
) -> Counterexamples:
    """Choose, write and play them: of the edge cases, or where none is a failure, of all failures.

    Args:
        drivers: runs points with other systems under test, where failures are no edge cases.
        out: folder for the files.
    """
    names, cases = _chosen(generated, drivers)
    if not names:
        return Counterexamples(cases, np.zeros(0, bool), np.zeros(0, bool), ())
    # Told beside each: the likeliest failure of a search without edge cases may be neither.
    foreseeable = generated.prior.foreseeable(cases.theta)
    preventable = np.any([cases.drivers[name].survived for name in cases.judges], axis=0)
    writer = Writer(scenario, generated.space, out, settings.run, settings.overwrite)
    of_all = evidence(settings, len(generated.episodes.theta))
    files = writer.concrete(cases, of_all, [row_names[0] for row_names in names])
    made = []
    for row, (file, row_names) in enumerate(zip(files, names, strict=True)):
        unit = nearest(generated, cases.theta[row])
        made.append(Counterexample(row_names, row, file, *_played(file, settings), unit))
    return Counterexamples(cases, foreseeable, preventable, made)


def _chosen(generated: Generated, drivers: Drivers) -> tuple[list[list[str]], Cases]:
    """One or two failures with their names; none without failures."""
    # Edge cases first, which a careful driver prevents: other failures say less about the system.
    cases = generated.cases.take(generated.cases.outcomes.collision)
    if not len(cases):
        cases = _others(generated)
    if not len(cases):
        return [], cases
    rows = {LIKELIEST: int(cases.log_likelihood.argmax())}
    distances = [
        match_.distance for row in cases.theta if (match_ := nearest(generated, row)) is not None
    ]
    if distances:
        rows[NEAREST] = int(np.argmin(distances))
    names = [
        [name for name, row in rows.items() if row == chosen]
        for chosen in dict.fromkeys(rows.values())
    ]
    # Once where both are one failure: it has two names and one file.
    chosen = cases.take(np.array(list(dict.fromkeys(rows.values()))))
    # Only these one or two are driven by others: of all failures it would cost a search.
    return names, chosen if chosen.drivers else replace(
        chosen, drivers=matrix(chosen.theta, drivers, judges=chosen.judges).drivers
    )


def _others(generated: Generated) -> Cases:
    """All runs that failed, whether foreseeable and preventable or not; no other
    system has driven them yet.
    """
    theta, outcomes, rewards = generated.episodes
    rows = np.flatnonzero(outcomes.executed & outcomes.collision)
    points = theta[rows]
    # A density may refuse an array without rows.
    likelihood = generated.prior.log_density(points) if len(rows) else np.empty(0)
    return Cases(
        points, outcomes.take(rows), rewards[rows], likelihood, {}, judges=generated.cases.judges
    )


class FailureReplay(NamedTuple):
    """A failure that is played from its file: the file, the page that plays it, whether its run
    ends in a collision, its film.
    """

    scenario: Path
    page: Path
    reproduced: bool
    film: dict[str, Any] | None


def replays(
    scenario: Path,
    generated: Generated,
    settings: SearchSettings,
    drivers: Drivers,
    out: Path,
    rows: Mapping[str, int],
) -> dict[str, FailureReplay]:
    """Write and play failures of the executed runs.

    Args:
        drivers: runs points with other systems under test: the tags of the files tell which judges
            survive.
        out: folder for the files.
        rows: of the executed runs, by the names of the files after the scenario's; equal ones share
            a file.
    """
    theta, outcomes, rewards = generated.episodes
    chosen = list(dict.fromkeys(rows.values()))
    if not chosen:
        return {}
    # Rows of regions count executed runs; episodes hold the others too.
    executed = np.flatnonzero(outcomes.executed)[chosen]
    # Reversed, so that the first name of a row is the one that its file gets.
    points, names = theta[executed], {row: name for name, row in reversed(list(rows.items()))}
    judges = generated.cases.judges
    judged = {name: drivers(points, name) for name in dict.fromkeys((CAREFUL, *judges))}
    cases = Cases(
        points,
        outcomes.take(executed),
        rewards[executed],
        generated.prior.log_density(points),
        judged,
        judges=judges,
    )
    writer = Writer(scenario, generated.space, out, settings.run, settings.overwrite)
    of_all = evidence(settings, len(theta))
    files = writer.concrete(cases, of_all, [names[row] for row in chosen])
    played = {
        row: FailureReplay(file, *_played(file, settings))
        for row, file in zip(chosen, files, strict=True)
    }
    return {name: played[row] for name, row in rows.items()}


def nearest(generated: Generated, point: FloatArray) -> RecordedUnit | None:
    """The recorded unit that is most like a point (d,)."""
    # Where the density is stated there is no recorded unit to be near.
    if generated.gate.replayed is None:
        return None
    space, real = generated.space, generated.recorded
    distances = _distances(space, point, real.theta)
    row = int(distances.argmin())
    values = dict(zip(space.names, real.theta[row].tolist(), strict=True))
    return RecordedUnit(str(real.recordings[row]), values, float(distances[row]))


def _distances(space: Space, point: FloatArray, others: FloatArray) -> FloatArray:
    # Without the nuisances: two units that differ in their start time alone are the same case.
    columns = distinctive(space)
    apart = (space.unit(others) - space.unit(point))[:, columns]
    distances: FloatArray = np.sqrt(np.square(apart).mean(axis=1))
    return distances


def _played(file: Path, settings: SearchSettings) -> tuple[Path, bool, dict[str, Any] | None]:
    """The page that plays a scenario, whether its run ends in a collision, and
    the data of its moving picture.
    """
    from runner.judging.execution import run
    from runner.view.replay.player import preview, write_replay

    # From the file, not from the search: what is shown is what anybody gets who plays it.
    result = run(file, settings.run)
    result.name = file.stem
    page = file.with_suffix(".html")
    write_replay([result], page)
    return page, bool(result.verdict.failures), preview(result)


_FEWEST = 20
"""Fewest runs that fail, and that do not, for a boundary"""
_FOLDS, _SLICED, _GRID = 5, 3, 60
"""Folds of the cross-validation, measures that slices are made of, and points
along the sides of a slice
"""
_LINEAR = 1e-9
"""Difference from 1 below which a correlation is one but for rounding"""
_ROOM = 0.02
"""Room around the runs of a slice, as a share of their range"""


class Slice(NamedTuple):
    """Two measures, the others held.

    Attributes:
        across, up: indices of the measures.
        held: medians (k,) over the failures, of all measures.
        boundary: lines (n, 2) where as much speaks for a failure as against it, among the runs that
            there are.
    """

    across: int
    up: int
    held: FloatArray
    boundary: list[FloatArray]


@dataclass(frozen=True, eq=False)
class Region:
    """The boundary.

    Attributes:
        accuracy: balanced, of runs that the model was not fitted on: mean of the shares of failures
            and of others that it gets right; ½ is chance. spread: its standard deviation over
            folds.
        area: under the receiver's characteristic, likewise.
        weights: how much of the accuracy goes when a measure's values are shuffled, by its index,
            the greatest first.
        drawn: indices of the measures that matter most. alone: accuracy of a model of these alone.
        slices: of that model.
    """

    accuracy: float
    spread: float
    area: float
    weights: dict[int, float]
    drawn: list[int]
    alone: float
    slices: list[Slice]


def region(measures: Sequence[Measure], failing: BoolArray) -> Region | str:
    """The boundary between runs (n,) that fail and those that do not, or why there is none."""
    fails, others = int(failing.sum()), int((~failing).sum())
    # Five folds need four of each kind in a fold, or the scores are those of luck.
    if min(fails, others) < _FEWEST:
        ran = f"{many(fails + others, 'run')}, {many(fails, 'failure')}"
        return f"{ran}: a boundary needs {_FEWEST} that fail and {_FEWEST} that do not"
    if len(measures) < 2:
        return "one measure varies: there is nothing to draw over two"
    rows = np.stack([measure.values for measure in measures], axis=1)
    scores = _scores(rows, failing)
    weights = _weights(_model().fit(rows, failing), rows, failing)
    drawn, held = _independent(rows, weights), np.median(rows[failing], axis=0)
    if len(drawn) < 2:
        return "all measures that vary follow from one: there is nothing to draw over two"
    # A model of the drawn measures alone: a slice of the full one would hide the others' effect.
    few = rows[:, drawn]
    model, alone = _model().fit(few, failing), _scores(few, failing)["test_balanced_accuracy"]
    slices = [
        Slice(drawn[across], drawn[up], held, _boundary(model, few, held[drawn], across, up))
        for across, up in combinations(range(len(drawn)), 2)
    ]
    accuracy, area = scores["test_balanced_accuracy"], scores["test_roc_auc"]
    return Region(
        float(accuracy.mean()),
        float(accuracy.std()),
        float(area.mean()),
        weights,
        drawn,
        float(alone.mean()),
        slices,
    )


def _independent(rows: FloatArray, order: Iterable[int]) -> list[int]:
    """The first `_SLICED` measures of which none is a linear function of one before it."""
    # The closing speed is the ego's speed less a pinned one: runs over the two lie on a line, which
    # has no area to draw a boundary in.
    alike = np.abs(np.corrcoef(rows, rowvar=False)) > 1.0 - _LINEAR
    chosen = list[int]()
    for index in order:
        if not alike[index, chosen].any():
            chosen.append(index)
    return chosen[:_SLICED]


def _model() -> Pipeline:
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import PolynomialFeatures, StandardScaler

    # Balanced: searches crowd about failures or hardly hit any, and the rarer outcome counts as
    # much.
    regression = LogisticRegression(class_weight="balanced", max_iter=2000)
    return make_pipeline(StandardScaler(), PolynomialFeatures(2, include_bias=False), regression)


def _scores(rows: FloatArray, failing: BoolArray) -> dict[str, Any]:
    from sklearn.model_selection import StratifiedKFold, cross_validate

    # Shuffled: runs are in the order of the search, whose phases look in different places.
    folds = StratifiedKFold(_FOLDS, shuffle=True, random_state=0)
    scores: dict[str, Any] = cross_validate(
        _model(), rows, failing, cv=folds, scoring=("balanced_accuracy", "roc_auc")
    )
    return scores


def _weights(model: Pipeline, rows: FloatArray, failing: BoolArray) -> dict[int, float]:
    from sklearn.inspection import permutation_importance

    # On the runs it was fitted to: the order of the measures is asked, not their worth elsewhere.
    importance = permutation_importance(
        model, rows, failing, scoring="balanced_accuracy", n_repeats=5, random_state=0
    )
    means = importance["importances_mean"]
    return {int(index): float(means[index]) for index in np.argsort(-means, kind="stable")}


def _boundary(
    model: Pipeline, rows: FloatArray, held: FloatArray, across: int, up: int
) -> list[FloatArray]:
    """Return the points where the model is undecided, within the reach of runs."""
    from matplotlib.figure import Figure
    from scipy.spatial import Delaunay

    xs, ys = (np.linspace(*limits(rows[:, index]), _GRID) for index in (across, up))
    grid = np.repeat(held[None], _GRID * _GRID, axis=0)
    grid[:, across], grid[:, up] = (axis.ravel() for axis in np.meshgrid(xs, ys))
    # Beyond the hull of the runs the model only extrapolates: no boundary is drawn there.
    reached = Delaunay(rows[:, [across, up]]).find_simplex(grid[:, [across, up]]) >= 0
    decided = np.ma.masked_array(model.decision_function(grid), ~reached).reshape(_GRID, _GRID)
    (path,) = Figure().subplots().contour(xs, ys, decided, levels=[0.0]).get_paths()
    return [np.asarray(line, np.float64) for line in path.to_polygons(closed_only=False)]


def limits(values: FloatArray) -> tuple[float, float]:
    """Least and greatest value with a little room."""
    low, high = float(values.min()), float(values.max())
    return low - _ROOM * (high - low), high + _ROOM * (high - low)


LINKED = 0.15
"""Distance in the unit cube, root mean square, up to which failures are of one region"""
_MOST, _GROUPED = 6, 2000
"""Regions that are listed, and failures that are linked, evenly chosen where there are more"""
_RULED = 5
"""Fewest failures that a rule is made of"""
_BOUNDS, _EDGE = 3, 0.02
"""Bounds of a rule at most, and share of a region's members that each may leave out"""


class Bound(NamedTuple):
    """One side of a rule: values of a measure, by its index, at least or at most at a limit."""

    measure: int
    least: bool
    limit: float

    def holds(self, rows: FloatArray) -> BoolArray:
        """Rows (n, k) that keep it: (n,)."""
        values = rows[:, self.measure]
        return values >= self.limit if self.least else values <= self.limit


class Chance(NamedTuple):
    """Probability of a part of the failures under the density.

    Attributes:
        value: estimate. interval: of 95 %; from 0 to the one-sided limit where no draw fails so.
        draws: how many it is of. failing: those of them that fail so.
    """

    value: float
    interval: tuple[float, float]
    draws: int
    failing: int

    @classmethod
    def counted(cls, failing: int, draws: int, most: float = 1.0) -> Chance:
        """Count draws of the density itself; `most` is a limit of what it is a part of."""
        if not draws:
            return cls(0.0, (0.0, 1.0), 0, 0)
        low, high = Share(failing, draws).interval
        # Where nothing fails there is no lower end: the limit is that of the statement.
        high = high if failing else Statement(draws, 0, 0).total
        return cls(failing / draws, (low, min(high, most)), draws, failing)

    @classmethod
    def weighted(cls, estimated: Probability, draws: int, failing: int) -> Chance:
        """Take the probability of weighted draws of an estimate."""
        return cls(estimated.value, estimated.interval, draws, failing)

    def as_json(self) -> dict[str, Any]:
        """Return it as a JSON object, for files and the page."""
        return {
            "draws": self.draws,
            "failing_draws": self.failing,
            "probability": self.value if self.draws else None,
            "interval": list(self.interval),
        }


class FailureParts(NamedTuple):
    """Probabilities of the regions that are listed, of the other failures, and of all: the first
    and the second add up to the third.

    Attributes:
        regions: of each region. others: of failures nearer to other regions. every: of all.
        weighted: whether they are of the estimate's draws; else of unguided ones.
    """

    regions: Sequence[Chance]
    others: Chance
    every: Chance
    weighted: bool

    def as_json(self) -> dict[str, Any]:
        """Return it as a JSON object, for files and the page."""
        return {
            "others": self.others.as_json(),
            "all": self.every.as_json(),
            "weighted": self.weighted,
        }


class FailureRegion(NamedTuple):
    """A region.

    Attributes:
        bounds: its rule; none with fewer than `_RULED` failures.
        precision: draws within the rule (`_Traffic`), and those of them that fail.
        recall: draws that fail near its failures, and those of them within the rule.
        failures: number of failing runs. chance: probability of its failures.
        severity: mean impact speed, m/s. cases: rows of the edge cases in it, the likelier first.
        typical, likeliest: rows of the executed runs: the failure nearest to the others, and that
            of the greatest density.
        survived: number of the edge cases that each reference driver survives.
    """

    bounds: Sequence[Bound]
    precision: Share
    recall: Share
    failures: int
    chance: Chance
    severity: float
    cases: Sequence[int]
    typical: int
    likeliest: int
    survived: Mapping[str, int]

    def rule(self, by: Sequence[Measure]) -> str:
        """The rule in words."""
        sides = (
            (
                f"{by[bound.measure].name} {'≥' if bound.least else '≤'} {bound.limit:.3g} "
                f"{by[bound.measure].unit}"
            ).strip()
            for bound in self.bounds
        )
        few = f"fewer than {_RULED} failures make no rule"
        return " and ".join(sides) or (
            few if self.failures < _RULED else "no measure tells it from other runs"
        )

    @property
    def edge_cases(self) -> int:
        """Number of foreseeable and preventable failures."""
        return len(self.cases)

    @property
    def importance(self) -> tuple[bool, float]:
        """Order: regions with edge cases first, then by probability times severity."""
        # Half a draw more: among regions that no draw hit, the severer one still comes first.
        likely = self.chance.value + 0.5 / (self.chance.draws + 1.0)
        return self.edge_cases > 0, likely * (1.0 + self.severity)

    def as_json(
        self, by: Sequence[Measure], members: Mapping[str, Sequence[float]]
    ) -> dict[str, Any]:
        """Return the group as a JSON object, for files and the page; `members` has the values of
        the `typical` and of the `likeliest` member."""
        return {
            "rule": self.rule(by), **_scores_of("precision", self.precision),
            **_scores_of("recall", self.recall),
            "failures": self.failures, **self.chance.as_json(), "severity": round(self.severity, 2),
            "edge_cases": self.edge_cases,
            "survived": dict(self.survived),
            **{
                name: {measure.name: value for measure, value in zip(by, values, strict=True)}
                for name, values in members.items()
            },
        }  # fmt: skip


def _scores_of(name: str, share: Share) -> dict[str, Any]:
    return {
        name: share.collisions / share.runs if share.runs else None,
        f"{name}_interval": list(share.interval),
        f"{name}_draws": share.runs,
    }


def measured(generated: Generated, theta: FloatArray) -> list[Measure]:
    """Return the readable measures of points (n, d)."""
    names = (*generated.space.names, *generated.space.pinned)
    return measures(generated.space, generated.recorded.roles or roles_of(names), theta)


def varying(generated: Generated) -> list[Measure]:
    """Return the readable measures of the executed runs that differ from run to run."""
    listed = measured(generated, generated.episodes.theta[generated.episodes.outcomes.executed])
    return [measure for measure in listed if measure.values.size and np.ptp(measure.values) > 0.0]


def regions(generated: Generated, by: Sequence[Measure]) -> list[FailureRegion]:
    """Regions alone, as `with_parts` has them."""
    return with_parts(generated, by)[0]


def with_parts(
    generated: Generated, by: Sequence[Measure]
) -> tuple[list[FailureRegion], FailureParts | None]:
    """The regions of all executed runs, the most important first, at most `_MOST`, and the
    probabilities of these and of the others; none without failures or measures.

    Args:
        by: values (n,) at the executed runs.
    """
    theta, outcomes, _ = generated.episodes
    # Runs with errors neither fail nor pass: as passes they would speak against a rule.
    theta, outcomes = theta[outcomes.executed], outcomes.take(outcomes.executed)
    failing = np.flatnonzero(outcomes.collision)
    if not failing.size or not by:
        return [], None
    space, columns = generated.space, distinctive(generated.space)
    unit, rows = space.unit(theta)[:, columns], np.stack([measure.values for measure in by], axis=1)
    labels = _labels(unit[failing])
    parts = _Parts(generated, columns, unit[failing], labels)
    traffic = _Traffic.of(generated, by, theta, rows)
    collided = np.flatnonzero(generated.cases.outcomes.collision)
    cases = generated.cases.take(collided)
    listed = []
    for label in np.unique(labels):
        group = failing[labels == label]
        of = np.zeros(len(rows), bool)
        of[group] = True
        bounds = _rule(rows, of) if len(group) >= _RULED else []
        # The member nearest to the middle; the middle itself was never run.
        typical = group[
            int(np.argmin(np.square(unit[group] - unit[group].mean(axis=0)).sum(axis=1)))
        ]
        likeliest = group[int(np.argmax(generated.prior.log_density(theta[group])))]
        # By nearness, since cases have no rows among the runs.
        near = _near(space.unit(cases.theta)[:, columns], unit[group])
        survived = {
            name: int((outcomes.survived & near).sum()) for name, outcomes in cases.drivers.items()
        }
        severity = float(outcomes.impact_speed[group].mean())
        of_rule = (
            bounds,
            *traffic.scores(bounds, unit[group]),
            len(group),
        )
        listed.append(
            FailureRegion(
                *of_rule,
                parts.chance([int(label)]),
                severity,
                collided[near].tolist(),
                int(typical),
                int(likeliest),
                survived,
            )
        )
    order = sorted(range(len(listed)), key=lambda row: listed[row].importance, reverse=True)
    most = [listed[row] for row in order[:_MOST]]
    others = parts.chance(order[_MOST:])
    return most, FailureParts([area.chance for area in most], others, parts.every, parts.weighted)


def _labels(unit: FloatArray) -> IntArray:
    """Number of the region (n,) of each failure (n, k) in the unit cube, from 0 without a gap: they
    are places in a list of the regions, too."""
    from scipy.spatial import KDTree

    # Linking has a row for each pair; failures beyond that join the region of the nearest linked.
    linked = unit[np.linspace(0, len(unit) - 1, min(len(unit), _GROUPED)).astype(int)]
    labels = np.unique(grouped(linked, LINKED), return_inverse=True)[1]
    return np.asarray(labels[KDTree(linked).query(unit)[1]], np.int64)


class _Parts:
    """Probabilities of groups of failures: each failure belongs to the group of the known failure
    nearest to it, so that those of all groups add up.

    Args:
        columns: of the space that tell cases apart. unit: known failures (m, k) in the unit cube.
        labels: their groups (m,), from 0.
    """

    def __init__(
        self, generated: Generated, columns: BoolArray, unit: FloatArray, labels: IntArray
    ) -> None:
        from scipy.spatial import KDTree

        self._space, self._columns, self._labels = generated.space, columns, labels
        self._tree, self._measure = KDTree(unit), generated.measure
        theta, outcomes, _ = generated.draws or (np.empty((0, len(columns))), Outcomes.of(0), None)
        self._failing = theta[outcomes.executed & outcomes.collision]
        self._draws = int(outcomes.executed.sum())
        self.weighted = self._measure is not None
        # By the same count as the parts, whose sum it is.
        self.every = self.chance(np.unique(labels))

    def chance(self, groups: Sequence[int] | IntArray) -> Chance:
        """Probability of the failures of some groups."""

        def inside(theta: FloatArray) -> BoolArray:
            # The tree answers no empty query.
            if not len(theta):
                return np.zeros(0, bool)
            nearest = self._tree.query(self._space.unit(theta)[:, self._columns])[1]
            return np.isin(self._labels[nearest], groups)

        if self._measure is None:
            # Intervals of a part and of the whole are of different kinds: the part's may not exceed
            # it.
            whole = Statement(self._draws, len(self._failing), 0).total
            return Chance.counted(int(inside(self._failing).sum()), self._draws, whole)
        every = self._measure.part(lambda theta: np.ones(len(theta), bool))
        # Rounding of weights may not make a part exceed the whole that it is printed beside.
        part = self._measure.part(inside).within(every)
        failing = int(inside(self._measure.theta).sum())
        return Chance.weighted(part, self._measure.draws, failing)


def _near(unit: FloatArray, others: FloatArray) -> BoolArray:
    from scipy.spatial import KDTree

    if not len(unit):
        return np.empty(0, bool)
    # A tree, since draws in arrays fail by tens of thousands: a table of all distances would not
    # fit. `NEAR` is a root mean square over the parameters, a distance the root of a sum.
    return np.asarray(KDTree(others).query(unit)[0] < NEAR * np.sqrt(unit.shape[1]))


def _rule(rows: FloatArray, of: BoolArray) -> list[Bound]:
    """Bounds that separate the marked rows (n,) of (n, k) best from the others."""
    bounds, inside = list[Bound](), np.ones(len(rows), bool)
    # Greedy: of three bounds out of twenty, all triples would be a thousand rules a region.
    while len(bounds) < _BOUNDS:
        possible = [bound for bound in _candidates(rows, of) if not _degenerate(bound, bounds)]
        if not possible:
            break
        best = max(possible, key=lambda candidate: _score(inside & candidate.holds(rows), of))
        if _score(inside & best.holds(rows), of) <= _score(inside, of) + _GAIN:
            break
        bounds.append(best)
        inside &= best.holds(rows)
    return bounds


def _degenerate(bound: Bound, others: Sequence[Bound]) -> bool:
    """Whether a bound leaves a single value, as printed, beside another one of its measure."""
    return any(
        other.measure == bound.measure and f"{other.limit:.3g}" == f"{bound.limit:.3g}"
        for other in others
    )


class _Traffic(NamedTuple):
    """Draws (n,) of the density by which rules are scored: the unguided ones, and those in arrays
    that measured the density, where arrays have the verdicts of all unguided ones.

    Sought runs crowd about failures, so a share of them says nothing about traffic.

    Attributes:
        unit: in the unit cube (n, j). rows: measures (n, k). fails: which fail.
    """

    unit: FloatArray
    rows: FloatArray
    fails: BoolArray

    @classmethod
    def of(
        cls, generated: Generated, by: Sequence[Measure], theta: FloatArray, rows: FloatArray
    ) -> _Traffic:
        """Build from a search.

        Args:
            theta, rows: executed runs (n, d), and their measures (n, k).
        """
        space, columns = generated.space, distinctive(generated.space)
        if generated.draws is None:
            return cls(np.empty((0, int(columns.sum()))), rows[:0], np.zeros(0, bool))
        drawn, outcomes, _ = generated.draws
        # Draws are among the executed runs, whose measures are worked out already.
        place = {row.tobytes(): number for number, row in enumerate(np.ascontiguousarray(theta))}
        ran = [
            number
            for number in np.flatnonzero(outcomes.executed)
            if drawn[number].tobytes() in place
        ]
        points, fails = drawn[ran], outcomes.collision[ran]
        values = rows[[place[row.tobytes()] for row in points]]
        if generated.measuring is not None:
            played, verdicts = generated.measuring
            played, verdicts = played[verdicts.executed], verdicts.take(verdicts.executed)
            named = {measure.name: measure.values for measure in measured(generated, played)}
            points = np.concatenate([points, played])
            fails = np.concatenate([fails, verdicts.collision])
            # By name: of these draws alone a measure may be constant that varies among the runs.
            more = np.stack([named[measure.name] for measure in by], axis=1)
            values = np.concatenate([values, more])
        return cls(space.unit(points)[:, columns], values, fails)

    def scores(self, bounds: Sequence[Bound], group: FloatArray) -> tuple[Share, Share]:
        """Precision and recall of a rule; of no draws without one.

        Args:
            group: failures (m, j) of the region in the unit cube.
        """
        if not bounds:
            return Share(0, 0), Share(0, 0)
        # Precision by all failures: a rule that holds for failures of another region is not wrong
        # there.
        inside = np.all([bound.holds(self.rows) for bound in bounds], axis=0)
        own = self.fails.copy()
        own[own] = _near(self.unit[own], group)
        return (
            Share(int((inside & self.fails).sum()), int(inside.sum())),
            Share(int((inside & own).sum()), int(own.sum())),
        )


_GAIN = 0.01
"""Gain of the F1 score that a further bound needs"""


def _candidates(rows: FloatArray, of: BoolArray) -> Iterator[Bound]:
    for measure in range(rows.shape[1]):
        # Not the extremes: a single failure far out would make a bound that holds for all runs.
        low, high = np.quantile(rows[of, measure], [_EDGE, 1.0 - _EDGE])
        yield Bound(measure, True, float(low))
        yield Bound(measure, False, float(high))


def _score(inside: BoolArray, of: BoolArray) -> float:
    """F1 of a rule."""
    return 2.0 * float((inside & of).sum()) / float(inside.sum() + of.sum())
