"""Failures per hour and per 1,000 km, where both parts of their uncertainty are known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from generation.estimation.probability import (
    PER_DISTANCE,
    PER_HOUR,
    Driving,
    Probability,
    driving,
    probability,
)
from generation.space import SpaceChoice
from generation.space.density.roles import Role
from generation.space.logical.library import SCENARIOS
from generation.space.logical.pairs import PAIRS, PairUnits, pair_units
from generation.space.recorded import of_recordings, of_samples
from generation.space.space import Space
from recognition.labels.maneuvers.units import OWN, Exposure, Samples, extract
from tests.recognition.motorway import write_motorway

CUT_IN = SCENARIOS / "cut_in_highway.xosc"
SURE = Probability(0.01, 0.0, 1e6, 1.0)


def met(count: int, hours: float = 10.0, units: int = 1000, possible: int = 1000) -> Driving:
    return Driving(Exposure(hours, 80.0 * hours, {"cut_in": count}), "cut_in", 3, units, possible)


def test_a_rate_is_the_probability_times_manoeuvres_per_hour() -> None:
    found = met(400, possible=500).rates(SURE)
    assert found[PER_HOUR].value == pytest.approx(0.01 * 0.5 * 400 / 10.0)
    assert found[PER_DISTANCE].value == pytest.approx(found[PER_HOUR].value * 1000.0 / 80.0)


def test_a_sure_probability_leaves_the_uncertainty_of_the_count() -> None:
    low, high = met(25, units=10**7, possible=10**7).rates(SURE)[PER_HOUR].interval
    assert low == pytest.approx(0.01 * 16.6 / 10.0, rel=0.02)  # Gamma(25.5): 16.63 and 36.20
    assert high == pytest.approx(0.01 * 36.2 / 10.0, rel=0.02)


def test_many_manoeuvres_leave_the_uncertainty_of_the_probability() -> None:
    vague = Probability(0.01, 0.003, 100.0, 1.0)
    low, high = met(10**7, hours=1e6, units=10**7, possible=10**7).rates(vague)[PER_HOUR].interval
    assert (low, high) == (
        pytest.approx(10.0 * vague.interval[0], rel=0.02),
        pytest.approx(10.0 * vague.interval[1], rel=0.02),
    )


def test_both_uncertainties_make_the_interval_wider() -> None:
    def width(found: Probability, count: int) -> float:
        low, high = met(count, units=10**7, possible=10**7).rates(found)[PER_HOUR].interval
        return float(np.log(high / low))

    vague = Probability(0.01, 0.003, 100.0, 1.0)
    assert width(vague, 20) > max(width(SURE, 20), width(vague, 10**6)) * 1.1


def test_recordings_that_differ_widen_the_interval_of_the_count_and_sites_are_told_apart() -> None:
    parts = {
        f"{site}/{n}": Exposure(1.0, 80.0, {"cut_in": count})
        for site in "ab"
        for n, count in enumerate([5] * 10 + [75] * 10)
    }
    alike = met(1600, hours=40.0, units=10**7, possible=10**7)
    over_dispersed = replace(alike, parts=parts)
    one, other = (
        np.diff(each.rates(SURE)[PER_HOUR].interval)[0] for each in (alike, over_dispersed)
    )
    assert other > 3.0 * one
    assert over_dispersed.by_site()["a"]["manoeuvres_per_hour"] == pytest.approx(40.0)
    assert not alike.by_site()
    assert "simulated driving" in str(replace(alike, simulated=True)) and "simulated" not in str(
        alike
    )


def test_where_nothing_fails_there_is_a_limit() -> None:
    none = probability(np.zeros(300, bool), np.ones(300), 1.0)
    rate = met(10**7, hours=1e6, units=10**7, possible=10**7).rates(none)[PER_HOUR]
    assert rate.value == rate.interval[0] == 0.0
    assert rate.interval[1] == pytest.approx(10.0 * none.bound, rel=0.03)
    assert str(rate).startswith("below")


def test_recordings_of_others_have_rates(tmp_path: Path) -> None:
    write_motorway(tmp_path / "recordings")
    space = Space.of(CUT_IN)
    recorded = of_samples(extract(tmp_path / "recordings", tmp_path).of_kind("cut_in"), space)
    own = of_samples(of_recordings(None, "cut_in"), space).prior(space, "gaussian")
    found = driving(recorded, space, own)
    assert isinstance(found, Driving)
    assert (found.kind, found.recordings, found.units) == ("cut_in", 1, len(recorded.theta))
    assert found.count >= found.units >= found.possible
    assert "cut_in in 0." in str(found)


@pytest.mark.parametrize("name", PAIRS)
def test_pairs_have_rates_of_the_recordings_that_they_were_sought_in(name: str) -> None:
    space = Space.of(SCENARIOS / f"{name}_highway.xosc")
    samples, pairs = Samples.read(OWN), of_recordings(None, name)
    assert isinstance(pairs, PairUnits)
    recorded = of_samples(pairs, space)
    found = driving(recorded, space, recorded.prior(space, "gaussian"))
    assert isinstance(found, Driving)
    every = Exposure.total(samples.exposure.values())
    assert (found.exposure.hours, found.exposure.kilometres) == (every.hours, every.kilometres)
    assert (
        found.count
        > found.units
        == len(pairs.recordings)
        >= len(recorded.theta)
        >= found.possible
        > 0
    )
    kinds = [
        (samples.kinds == part.kind).sum() / every.counts[part.kind] for part in PAIRS[name].parts
    ]
    assert found.count == pytest.approx(found.units / np.prod(kinds), abs=0.5)
    rate = found.rates(SURE)[PER_HOUR]
    assert rate.value == pytest.approx(
        0.01 * found.possible / found.units * found.count / every.hours
    )
    assert f"{found.count} manoeuvres {pairs.kind} in " in str(found)


def test_pairs_without_exposure_have_no_rates() -> None:
    name = next(iter(PAIRS))
    space = Space.of(SCENARIOS / f"{name}_highway.xosc")
    samples = replace(Samples.read(OWN), exposure={})
    recorded = of_samples(pair_units(samples, PAIRS[name]), space)
    assert recorded.pairs is not None and recorded.pairs.known == 1.0
    assert "how many hours" in str(driving(recorded, space, recorded.prior(space, "gaussian")))


def test_what_is_not_known_is_said_by_name(tmp_path: Path) -> None:
    write_motorway(tmp_path / "recordings")
    samples = extract(tmp_path / "recordings", tmp_path).of_kind("cut_in")
    free, pinned = Space.of(CUT_IN), Space.of(CUT_IN, SpaceChoice(pinned={"Ego_Speed_mps": "30"}))
    prior = of_samples(of_recordings(None, "cut_in"), free).prior(free, "gaussian")
    recorded = of_samples(samples, free)
    assert "how many hours" in str(driving(recorded._replace(exposure={}), free, prior))
    assert str(driving(of_samples(samples, pinned), pinned, prior)).startswith(
        "Ego_Speed_mps is pinned"
    )
    others = {**recorded.roles, "Other_Gap_m": Role("Other", "gap")}
    assert "several actors" in str(driving(recorded._replace(roles=others), free, prior))
