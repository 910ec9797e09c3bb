"""Parameter value distributions: order, numbers, constraints, draws, refusals,
and reading back what was written.
"""

from __future__ import annotations

import csv
import math
import random
import statistics
from datetime import datetime
from importlib.metadata import EntryPoint
from itertools import islice
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from schemas.common.errors import InvalidFile, Unsupported, UsageError
from schemas.validate import violations
from schemas.versions.registry import OPENSCENARIO, schema_for
from xosc.distributions import (
    Deterministic,
    DeterministicMultiParameterDistribution,
    DeterministicSingleParameterDistribution,
    DistributionRange,
    DistributionSet,
    Histogram,
    HistogramBin,
    LogNormalDistribution,
    NormalDistribution,
    ParameterSpace,
    ParameterValueDistribution,
    PoissonDistribution,
    ProbabilityDistributionSet,
    Range,
    Stochastic,
    StochasticDistribution,
    UniformDistribution,
    UserDefinedDistribution,
    sample,
    space,
    variations,
    write_distribution,
)
from xosc.distributions import values as shared
from xosc.document import load
from xosc.document.node import Node
from xosc.resolve.parameters import Assignment, ParameterScope
from xosc.writing.files import FileHeader

FILE_HEADER = FileHeader("a test", "a tester", datetime(2024, 1, 31))
HEADER = (
    '<FileHeader revMajor="1" revMinor="3" date="2024-01-01T00:00:00" description="" author=""/>'
)
SCENARIO = f"""<OpenSCENARIO>{HEADER}
<ParameterDeclarations>
  <ParameterDeclaration name="Speed" parameterType="double" value="10">
    <ConstraintGroup><ValueConstraint rule="lessOrEqual" value="${{2 * $Limit}}"/></ConstraintGroup>
  </ParameterDeclaration>
  <ParameterDeclaration name="Limit" parameterType="double" value="10"/>
  <ParameterDeclaration name="Lane" parameterType="int" value="1"/>
  <ParameterDeclaration name="Model" parameterType="string" value="car"/>
</ParameterDeclarations>
<CatalogLocations/><RoadNetwork/><Entities/><Storyboard><Init><Actions/></Init></Storyboard></OpenSCENARIO>
"""


def single(name: str, content: str) -> str:
    return (
        "<DeterministicSingleParameterDistribution "
        f'parameterName="{name}">{content}</DeterministicSingleParameterDistribution>'
    )


def values(*texts: str) -> str:
    elements = "".join(f'<Element value="{text}"/>' for text in texts)
    return f"<DistributionSet>{elements}</DistributionSet>"


def steps(lower: str, upper: str, step: str) -> str:
    return (
        f'<DistributionRange stepWidth="{step}"><Range lowerLimit="{lower}" '
        f'upperLimit="{upper}"/></DistributionRange>'
    )


def drawn(name: str, content: str) -> str:
    return f'<StochasticDistribution parameterName="{name}">{content}</StochasticDistribution>'


def stochastic(content: str, runs: str = "5", seed: str = 'randomSeed="7"') -> str:
    return f'<Stochastic numberOfTestRuns="{runs}" {seed}>{content}</Stochastic>'


@pytest.fixture
def written(tmp_path: Path):
    """Writes a distribution file beside a scenario."""
    (tmp_path / "scenario.xosc").write_text(SCENARIO)

    def write(definition: str, scenario: str = "scenario.xosc") -> Path:
        path = tmp_path / "variation.xosc"
        path.write_text(
            f"<OpenSCENARIO>{HEADER}\n<ParameterValueDistribution><ScenarioFile "
            f'filepath="{scenario}"/>\n'
            f"{definition}\n</ParameterValueDistribution></OpenSCENARIO>"
        )
        return path

    return write


def parameters(path: Path, enforce_constraints: bool = False) -> list[dict[str, str]]:
    return [assigned for _, assigned in variations(path, enforce_constraints)]


def test_the_last_listed_distribution_varies_fastest(written) -> None:
    path = written(
        f"<Deterministic>{single('Lane', values('1', '2'))}{single('Model', values('car', 'van'))}</Deterministic>"
    )
    assert [tuple(each.values()) for each in parameters(path)] == [
        ("1", "car"),
        ("1", "van"),
        ("2", "car"),
        ("2", "van"),
    ]


def test_value_sets_belong_together_and_may_differ_in_what_they_assign(written) -> None:
    one, two, three = (
        f'<ParameterAssignment parameterRef="{name}" value="{value}"/>'
        for name, value in (("Speed", 1), ("Limit", 2), ("Speed", 3))
    )
    sets = f"<ParameterValueSet>{one}{two}</ParameterValueSet><ParameterValueSet>{three}</ParameterValueSet>"
    multi = (
        f"<DeterministicMultiParameterDistribution><ValueSetDistribution>{sets}"
        "</ValueSetDistribution></DeterministicMultiParameterDistribution>"
    )
    path = written(f"<Deterministic>{multi}{single('Lane', values('1', '2'))}</Deterministic>")
    assert parameters(path) == [
        {"Speed": "1", "Limit": "2", "Lane": "1"},
        {"Speed": "1", "Limit": "2", "Lane": "2"},
        {"Speed": "3", "Lane": "1"},
        {"Speed": "3", "Lane": "2"},
    ]


@pytest.mark.parametrize(
    ("lower", "upper", "step", "expected"),
    [
        ("0", "0.5", "0.1", ["0", "0.1", "0.2", "0.3", "0.4", "0.5"]),
        ("20.0", "60.0", "20.0", ["20", "40", "60"]),
        ("-1.75", "1.75", "1.5", ["-1.75", "-0.25", "1.25"]),
        ("5", "5", "1", ["5"]),
        ("0", "${1 / 3}", "${1 / 9}", None),
        ("1e-7", "3e-7", "1e-7", ["0.0000001", "0.0000002", "0.0000003"]),
        ("1e20", "2e20", "1e20", ["1E+20", "2E+20"]),
    ],
)
def test_ranges_reach_their_upper_limit_in_clean_decimals(
    written, lower, upper, step, expected
) -> None:
    found = [
        each["Speed"]
        for each in parameters(
            written(f"<Deterministic>{single('Speed', steps(lower, upper, step))}</Deterministic>")
        )
    ]
    assert found == expected if expected else len(found) == 4


@given(
    lower=st.floats(-1e6, 1e6),
    span=st.floats(0, 1e6),
    step=st.floats(1e-6, 1e6),
)
def test_every_step_lies_in_the_range(lower: float, span: float, step: float) -> None:
    distribution = DistributionRange(Range(lower, lower + span), step)
    first, last = float(distribution.value(0)), float(distribution.value(distribution.size - 1))
    assert first == lower
    assert last <= lower + span + 2e-6 * step
    assert last + step > lower + span - 1e-9 * (step + abs(lower) + span)


def test_deterministic_without_distributions_is_the_scenario_itself(written) -> None:
    assert parameters(written("<Deterministic/>")) == [{}]


def test_a_scenario_is_its_own_only_variation(written) -> None:
    path = written("<Deterministic/>").parent / "scenario.xosc"
    assert list(variations(path)) == [(path, {})]
    assert list(sample(path, 2)) == [(path, {}), (path, {})]


def test_scenario_paths_are_relative_to_the_distribution(written, tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    path = folder / "variation.xosc"
    path.write_text(written("<Deterministic/>", r"..\scenario.xosc").read_text())
    assert next(variations(path))[0] == tmp_path / "scenario.xosc"


def test_combinations_outside_the_constraints_are_left_out_and_counted(written) -> None:
    path = written(
        f"<Deterministic>{single('Limit', values('1', '2'))}{single('Speed', steps('1', '4', '1'))}</Deterministic>"
    )
    found = variations(path)
    assert [tuple(each.values()) for _, each in found] == [
        ("1", "1"),
        ("1", "2"),
        ("2", "1"),
        ("2", "2"),
        ("2", "3"),
        ("2", "4"),
    ]
    assert found.excluded == 2
    assert len(parameters(path)) == ParameterSpace(path).size == 8


LINKED = """
  <ParameterDeclaration name="Alone" parameterType="double" value="1">
    <ConstraintGroup><ValueConstraint rule="lessOrEqual" value="2"/></ConstraintGroup>
    <ConstraintGroup><ValueConstraint rule="equalTo" value="4"/></ConstraintGroup>
  </ParameterDeclaration>
  <ParameterDeclaration name="Half" parameterType="double" value="${$Speed / 2}">
    <ConstraintGroup><ValueConstraint rule="lessThan" value="$Lane"/></ConstraintGroup>
  </ParameterDeclaration>
"""


def test_constraints_hold_by_groups_as_they_do_together(written) -> None:
    draws = random.Random(0)
    names = ("Speed", "Limit", "Lane", "Alone", "Half")
    path = written(
        "<Deterministic>"
        + "".join(single(name, values("1", "2")) for name in names)
        + "</Deterministic>"
    )
    scenario = path.parent / "scenario.xosc"
    scenario.write_text(
        SCENARIO.replace("</ParameterDeclarations>", LINKED + "</ParameterDeclarations>")
    )
    declarations = load(scenario).node.need("ParameterDeclarations").children()
    found, verdicts = ParameterSpace(path), []
    for _ in range(300):
        texts = {name: str(draws.randrange(6)) for name in names if draws.random() < 0.7}
        assigned = {name: Assignment(value, UsageError) for name, value in texts.items()}
        verdicts.append(not list(ParameterScope(declarations, None, assigned).violations()))
        assert found.admits(texts) == verdicts[-1], texts
    assert {*verdicts} == {True, False}


def test_an_astronomic_space_is_counted_and_reached_into_but_never_enumerated(written) -> None:
    many = steps("0", "1e10", "1e-5")
    path = written(
        f"<Deterministic>{single('Speed', many)}{single('Limit', many)}{single('Lane', values('1'))}</Deterministic>"
    )
    wide = ParameterSpace(path)
    assert wide.size == (10**15 + 1) ** 2
    assert wide.variation(wide.size - 1)[1] == {
        "Speed": "10000000000",
        "Limit": "10000000000",
        "Lane": "1",
    }
    assert [each["Limit"] for _, each in islice(variations(path, False), 2)] == ["0", "0.00001"]
    assert len(list(sample(path, 3, enforce_constraints=False))) == 3
    with pytest.raises(UsageError, match="no variation"):
        wide.variation(wide.size)


def test_samples_of_a_deterministic_space_repeat_with_their_seed(written) -> None:
    path = written(
        f"<Deterministic>{single('Limit', steps('1', '9', '1'))}{single('Speed', steps('1', '9', '1'))}</Deterministic>"
    )
    first = list(sample(path, 200, seed=1))
    assert first == list(sample(path, 200, seed=1)) != list(sample(path, 200, seed=2))
    assert {each["Limit"] for _, each in first} == set("123456789")
    assert all(float(each["Speed"]) <= 2 * float(each["Limit"]) for _, each in first)


def test_a_search_for_samples_inside_impossible_constraints_ends(written) -> None:
    path = written(f"<Deterministic>{single('Speed', values('99'))}</Deterministic>")
    with pytest.raises(UsageError, match=r"none of .* samples satisfies the constraints"):
        next(sample(path, 1))


def test_names_of_sets_fit_into_file_names_whatever_their_number(written) -> None:
    wide = f"<Deterministic>{single('Speed', steps('0', '1e308', '1'))}</Deterministic>"
    number = ParameterSpace(written(wide)).size - 1
    assert space.numbered("a", 7) == "a~000007"
    assert len(space.numbered("a", number)) < 20 and space.numbered("a", number) != space.numbered(
        "a", number - 1
    )


def test_an_error_in_the_scenario_names_the_file_that_refers_to_it(written) -> None:
    path = written(f"<Deterministic>{single('Speed', values('1'))}</Deterministic>")
    (path.parent / "scenario.xosc").write_text("no XML")
    with pytest.raises(
        InvalidFile, match=rf"scenario\.xosc:1: not well-formed.*; {path}:\d+ refers to this file"
    ):
        ParameterSpace(path)


def test_an_enumeration_without_end_inside_impossible_constraints_ends(
    written, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(space, "MAX_EXCLUDED", 100)
    path = written(f"<Deterministic>{single('Speed', steps('99', '1e12', '1'))}</Deterministic>")
    with pytest.raises(InvalidFile, match="100 variations in a row"):
        next(variations(path))


def test_a_value_that_the_parameter_can_not_have_is_refused_where_it_is_listed(written) -> None:
    path = written(f"<Deterministic>{single('Speed', values('9', 'fast'))}</Deterministic>")
    with pytest.raises(
        InvalidFile,
        match=r"variation\.xosc:\d+: .*the value of the parameter Speed: 'fast' is not a number",
    ):
        list(variations(path))


def test_a_type_that_is_an_expression_counts_as_what_it_says(written, tmp_path: Path) -> None:
    symbolic = SCENARIO.replace(
        'name="Speed" parameterType="double"', 'name="Speed" parameterType="$Kind"'
    )
    kind = '<ParameterDeclaration name="Kind" parameterType="string" value="double"/>'
    (tmp_path / "symbolic.xosc").write_text(
        symbolic.replace("<ParameterDeclarations>", f"<ParameterDeclarations>{kind}")
    )
    path = written(
        f"<Deterministic>{single('Speed', values('9', 'fast'))}</Deterministic>", "symbolic.xosc"
    )
    with pytest.raises(
        InvalidFile,
        match=r"variation\.xosc:\d+: .*the value of the parameter Speed: 'fast' is not a number",
    ):
        parameters(path)
    uniform = (
        '<UniformDistribution><Range lowerLimit="3.1" upperLimit="3.9"/></UniformDistribution>'
    )
    drawn_speeds = parameters(written(stochastic(drawn("Speed", uniform)), "symbolic.xosc"))
    assert all(3.1 <= float(each["Speed"]) <= 3.9 for each in drawn_speeds)


def test_the_name_of_a_scenario_may_be_of_any_length(written) -> None:
    path = written("<Deterministic/>")
    path.write_text(path.read_text().replace("scenario.xosc", "9" * 4000))
    with pytest.raises(InvalidFile, match="does not exist"):
        variations(path)


def test_test_runs_are_reproducible_and_streams_are_independent(written) -> None:
    speed = drawn("Speed", '<NormalDistribution expectedValue="8" variance="4"/>')
    lane = drawn(
        "Lane", '<UniformDistribution><Range lowerLimit="1" upperLimit="3"/></UniformDistribution>'
    )
    alone = parameters(written(stochastic(speed)))
    both = parameters(written(stochastic(lane + speed)))
    assert len(both) == 5
    assert [each["Speed"] for each in both] == [each["Speed"] for each in alone]
    assert parameters(written(stochastic(speed, seed=""))) != alone
    assert {each["Lane"] for each in both} <= {"1", "2", "3"}
    path = written(stochastic(lane + speed, runs="5"))
    assert ParameterSpace(path).variation(4)[1] == both[4]
    assert [each for _, each in sample(path, 5, seed=7, enforce_constraints=False)] == both


def quantiles(distribution, number: int = 20_000) -> list[float]:
    return [float(distribution.quantile((index + 0.5) / number)) for index in range(number)]


@pytest.mark.parametrize(
    ("distribution", "mean", "variance"),
    [
        (NormalDistribution(10, 4), 10, 4),
        (NormalDistribution(0, 1, Range(0, 100)), math.sqrt(2 / math.pi), 1 - 2 / math.pi),
        (NormalDistribution(3, 0), 3, 0),
        (LogNormalDistribution(2, 0.5), 2, 0.5),
        (UniformDistribution(Range(-1, 5)), 2, 3),
        (PoissonDistribution(4), 4, 4),
        (
            Histogram(
                (
                    HistogramBin(Range(0, 2), 1),
                    HistogramBin(Range(2, 3), 0),
                    HistogramBin(Range(4, 6), 3),
                )
            ),
            4,
            10 / 3,
        ),
    ],
)
def test_moments(distribution, mean: float, variance: float) -> None:
    drawn_values = quantiles(distribution)
    assert statistics.fmean(drawn_values) == pytest.approx(mean, abs=2e-3)
    assert statistics.pvariance(drawn_values) == pytest.approx(variance, abs=2e-2)
    assert drawn_values == sorted(drawn_values)


@pytest.mark.parametrize(
    "distribution",
    [
        NormalDistribution(0, 1, Range(9, 10)),
        NormalDistribution(0, 1, Range(-10, -9)),
        NormalDistribution(0, 1, Range(3, 3)),
        NormalDistribution(3, 0, Range(3, 4)),
        LogNormalDistribution(1, 1, Range(-5, 0.5)),
        LogNormalDistribution(1e-300, 1e-300),
        UniformDistribution(Range(-1.7e308, 1.7e308)),
        PoissonDistribution(3, Range(4.5, 6.5)),
        PoissonDistribution(1e9),
    ],
)
def test_draws_stay_in_their_range_however_unlikely(distribution) -> None:
    limits = getattr(distribution, "range", None) or Range(-1.7e308, 1.7e308)
    found = [float(distribution.quantile(p)) for p in (2**-53, 0.25, 0.5, 0.75, 1 - 2**-53)]
    assert all(value in limits for value in found)
    assert found == sorted(found)


@given(p=st.floats(1e-9, 0.999), mean=st.floats(0.01, 1e6))
def test_poisson_quantiles_invert_the_distribution_function(p: float, mean: float) -> None:
    from scipy.special import pdtr

    count = PoissonDistribution(mean).quantile(p)
    assert pdtr(count, mean) >= p * (1 - 1e-9)
    assert count == 0 or pdtr(count - 1, mean) < p * (1 + 1e-9)


def test_probability_sets_follow_their_weights() -> None:
    distribution = ProbabilityDistributionSet((("a", 0), ("b", 1), ("c", 3)))
    found = [distribution.quantile((index + 0.5) / 1000) for index in range(1000)]
    assert (found.count("a"), found.count("b"), found.count("c")) == (0, 250, 750)


EVERYTHING = [
    Deterministic(
        (
            DeterministicSingleParameterDistribution("A", DistributionSet(("x", ""))),
            DeterministicSingleParameterDistribution("B", DistributionRange(Range(-1, 1.5), 0.25)),
            DeterministicSingleParameterDistribution("C", UserDefinedDistribution("twice", "1 2")),
            DeterministicMultiParameterDistribution(({"D": "1", "E": "2"}, {"D": "3", "E": "4"})),
        )
    ),
    Stochastic(
        3,
        (
            StochasticDistribution("A", ProbabilityDistributionSet((("x", 1), ("y", 0.5)))),
            StochasticDistribution("B", NormalDistribution(0, 1, Range(-1, 1))),
            StochasticDistribution("C", LogNormalDistribution(1, 2)),
            StochasticDistribution("D", UniformDistribution(Range(0, 1))),
            StochasticDistribution("E", PoissonDistribution(3, Range(0, 9))),
            StochasticDistribution("F", Histogram((HistogramBin(Range(0, 1), 2),))),
            StochasticDistribution("G", UserDefinedDistribution("twice", "1 2")),
        ),
        random_seed=42,
    ),
]


class Twice:
    """A plug-in, as another package would install it."""

    def __init__(self, content: str) -> None:
        if "?" in content:
            raise ValueError("question marks mean nothing")
        if "!" in content:
            raise LookupError("no such table")
        self.content = content

    def values(self) -> list[str]:
        return self.content.split() * 2

    def quantile(self, probability: float) -> str:
        return self.content.split()[probability > 0.5]


@pytest.fixture
def plugin(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = EntryPoint("twice", f"{__name__}:Twice", shared.GROUP)
    monkeypatch.setattr(shared, "installed", lambda group: {"twice": entry})
    shared._plugin.cache_clear()


@pytest.mark.parametrize("definition", EVERYTHING, ids=["Deterministic", "Stochastic"])
def test_reading_gives_what_was_written(definition, plugin) -> None:
    distribution = ParameterValueDistribution("scenario.xosc", definition)
    assert (
        ParameterValueDistribution.read(Node(distribution.write(), Path("memory.xosc")))
        == distribution
    )


@pytest.mark.parametrize("version", [(1, 0), (1, 1), (1, 2), (1, 3)])
@pytest.mark.parametrize("definition", EVERYTHING, ids=["Deterministic", "Stochastic"])
def test_files_are_valid_where_the_version_can_say_it(
    tmp_path: Path, plugin, definition, version: tuple[int, int]
) -> None:
    distribution = ParameterValueDistribution("scenario.xosc", definition)
    path = tmp_path / "variation.xosc"
    since = (1, 1) if definition is EVERYTHING[0] else (1, 3)
    if version < since:
        with pytest.raises(Unsupported, match="Distribution"):
            write_distribution(distribution, path, FILE_HEADER, version)
        return
    write_distribution(distribution, path, FILE_HEADER, version)
    document = load(path)
    assert document.version == version
    assert not violations(document.root.getroottree(), schema_for(OPENSCENARIO, version))
    assert (
        ParameterValueDistribution.read(document.node.need("ParameterValueDistribution"))
        == distribution
    )


def test_a_plugin_gives_user_defined_values(written, plugin) -> None:
    content = '<UserDefinedDistribution type="twice">1 2</UserDefinedDistribution>'
    assert [
        each["Lane"]
        for each in parameters(written(f"<Deterministic>{single('Lane', content)}</Deterministic>"))
    ] == list("1212")
    assert {
        each["Lane"] for each in parameters(written(stochastic(drawn("Lane", content), runs="20")))
    } == {"1", "2"}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("?", "question marks mean nothing"),
        ("", "lists no value"),
        ("!", "the plug-in 'twice' of .* can't be used: LookupError: no such table"),
    ],
)
def test_content_that_a_plugin_cannot_use_is_refused_at_its_line(
    written, plugin, content: str, message: str
) -> None:
    distribution = f'<UserDefinedDistribution type="twice">{content}</UserDefinedDistribution>'
    with pytest.raises(
        InvalidFile, match=rf"variation\.xosc:3: UserDefinedDistribution: .*{message}"
    ):
        variations(written(f"<Deterministic>{single('Lane', distribution)}</Deterministic>"))


def test_a_user_defined_distribution_without_plugin_is_refused_by_name(written) -> None:
    shared._plugin.cache_clear()
    content = '<UserDefinedDistribution type="mine"/>'
    with pytest.raises(Unsupported, match=r"variation\.xosc:3: UserDefinedDistribution: .*'mine'"):
        variations(written(f"<Deterministic>{single('Lane', content)}</Deterministic>"))


NORMAL = '<NormalDistribution expectedValue="{}" variance="{}">{}</NormalDistribution>'
RANGE = '<Range lowerLimit="{}" upperLimit="{}"/>'


@pytest.mark.parametrize(
    ("definition", "message"),
    [
        (single("Sped", values("1")), "declares no parameter 'Sped'; did you mean 'Speed'"),
        (
            single("Lane", values("1")) + single("Lane", values("2")),
            "'Lane' gets its values from more than one",
        ),
        (single("Lane", "<DistributionSet/>"), "at least one Element"),
        (single("Lane", steps("1", "2", "0")), "stepWidth=0 must be positive"),
        (single("Lane", steps("1", "2", "-1")), "stepWidth=-1 must be positive"),
        (single("Lane", steps("1", "2", "NaN")), "NaN"),
        (single("Lane", steps("1", "INF", "1")), "must be a finite number"),
        (single("Lane", steps("2", "1", "1")), "lowerLimit=2 is above upperLimit=1"),
        (single("Lane", steps("0", "1e308", "1e-300")), "more steps than can be counted"),
        (single("Lane", steps("$Speed", "2", "1")), "no parameter 'Speed'"),
        (single("Lane", steps("${1/0}", "2", "1")), "divides by zero"),
        (single("Lane", ""), "exactly one child"),
        (single("Lane", "<Nonsense/>"), "Nonsense: not a deterministic distribution"),
        ("<Nonsense/>", "Nonsense: not a deterministic distribution"),
        (
            "<DeterministicSingleParameterDistribution><DistributionSet/></DeterministicSingleParameterDistribution>",
            "'parameterName'",
        ),
    ],
)
def test_malformed_deterministic_distributions_are_refused_with_their_line(
    written, definition: str, message: str
) -> None:
    with pytest.raises(InvalidFile, match=rf"variation\.xosc:3: .*{message}"):
        variations(written(f"<Deterministic>{definition}</Deterministic>"))


@pytest.mark.parametrize(
    ("definition", "message"),
    [
        (NORMAL.format("1", "-1", ""), "variance=-1 must not be negative"),
        (NORMAL.format("NaN", "1", ""), "NaN"),
        (NORMAL.format("0", "1", RANGE.format(50, 60)), "holds no probability"),
        (NORMAL.format("0", "0", RANGE.format(1, 2)), "holds no probability"),
        ('<LogNormalDistribution expectedValue="0" variance="1"/>', "must be positive"),
        (
            '<LogNormalDistribution expectedValue="1e-200" variance="1e300"/>',
            "must be a finite number",
        ),
        (
            (
                '<LogNormalDistribution expectedValue="1" '
                f'variance="1">{RANGE.format(-2, -1)}</LogNormalDistribution>'
            ),
            "holds no prob",
        ),
        ('<PoissonDistribution expectedValue="-1"/>', "between 0 and 1e9"),
        (
            (
                "<PoissonDistribution "
                f'expectedValue="1">{RANGE.format(0.2, 0.8)}</PoissonDistribution>'
            ),
            "holds no probability",
        ),
        ("<UniformDistribution/>", "Range is missing"),
        ("<Histogram/>", "at least one weight"),
        (
            f'<Histogram><Bin weight="-1">{RANGE.format(0, 1)}</Bin></Histogram>',
            "weight=-1 must not be negative",
        ),
        (
            (
                '<ProbabilityDistributionSet><Element value="1" '
                'weight="0"/></ProbabilityDistributionSet>'
            ),
            "at least one weight",
        ),
        (
            (
                '<ProbabilityDistributionSet><Element value="1" '
                'weight="INF"/></ProbabilityDistributionSet>'
            ),
            "finite",
        ),
        ("<Nonsense/>", "Nonsense: not a stochastic distribution"),
    ],
)
def test_malformed_stochastic_distributions_are_refused_with_their_line(
    written, definition: str, message: str
) -> None:
    with pytest.raises(InvalidFile, match=rf"variation\.xosc:3: .*{message}"):
        variations(written(stochastic(drawn("Speed", definition))))


@pytest.mark.parametrize(
    ("runs", "seed"),
    [
        ("0", ""),
        ("-1", ""),
        ("1.5", ""),
        ("INF", ""),
        ("1", 'randomSeed="NaN"'),
        ("1", 'randomSeed="INF"'),
    ],
)
def test_malformed_numbers_of_runs_and_seeds_are_refused(written, runs: str, seed: str) -> None:
    with pytest.raises(InvalidFile, match="Stochastic"):
        variations(written(stochastic(drawn("Speed", NORMAL.format(0, 1, "")), runs, seed)))


def test_a_stochastic_without_distributions_and_a_missing_definition_are_refused(written) -> None:
    with pytest.raises(InvalidFile, match="at least one StochasticDistribution"):
        variations(written(stochastic("")))
    with pytest.raises(InvalidFile, match="Deterministic or Stochastic is missing"):
        variations(written(""))


def test_the_scenario_must_exist_and_be_one(written) -> None:
    with pytest.raises(InvalidFile, match=r"variation\.xosc:2: ScenarioFile: .*does not exist"):
        variations(written("<Deterministic/>", "nowhere.xosc"))
    with pytest.raises(InvalidFile, match=r"variation\.xosc:2: ScenarioFile: .*is a distribution"):
        variations(written("<Deterministic/>", "variation.xosc"))


@pytest.mark.parametrize("name", ["absent.xosc", "x" * 300, "a\u0085b"])
def test_a_scenario_that_is_not_there_is_named(written, name: str) -> None:
    with pytest.raises(
        InvalidFile, match=r"variation\.xosc:2: ScenarioFile: the scenario .* does not exist"
    ):
        variations(written("<Deterministic/>", name))


def test_a_value_of_the_wrong_type_is_an_error_and_no_violation(written) -> None:
    with pytest.raises(InvalidFile, match=r"variation\.xosc:3: .*'fast' is not a number"):
        next(
            variations(written(f"<Deterministic>{single('Speed', values('fast'))}</Deterministic>"))
        )
    with pytest.raises(InvalidFile, match=r"variation\.xosc:3: .*'left' is not"):
        next(
            variations(
                written(f"<Deterministic>{single('Lane', values('left'))}</Deterministic>"),
                enforce_constraints=False,
            )
        )


def test_public_variation_files_have_the_sizes_of_the_reference_runs(
    corpora: Path, reference: Path
) -> None:
    last: dict[str, int] = {}
    for table in ("alks_variation", "ncap_2023_variation"):
        with open(reference / f"{table}.runs.csv") as file:
            for row in csv.DictReader(file):
                last[row["file"]] = max(last.get(row["file"], 0), int(row["permutation"]))
    assert len(last) > 50
    for name, index in last.items():
        public = ParameterSpace(corpora / name)
        assert public.size == index + 1, name
        assert public.variation(index)[0].is_file()


def test_overlapping_spans_choose_and_count_a_set_once() -> None:
    sets_of = ParameterSpace("xosc/library/simple_cut_in_variation.xosc")
    chosen = space.Selection(only=((3, 5), (4, 4), (0, 0), (5, 6)))
    assert [number for number, _ in chosen.sets(sets_of, True)] == [0, 3, 4, 5, 6]
    assert chosen.count(sets_of) == 5


def test_a_span_far_beyond_the_space_is_refused_at_its_first_number() -> None:
    sets_of = ParameterSpace("xosc/library/simple_cut_in_variation.xosc")
    sets = space.Selection(only=((6, 10**15),)).sets(sets_of, True)
    assert [number for number, _ in islice(sets, 2)] == [6, 7]
    with pytest.raises(UsageError, match="there is no variation 8, the last of 8 is 7"):
        next(sets)
