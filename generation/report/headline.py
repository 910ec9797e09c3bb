"""What a report says first, in sentences: what fails, how often, how hard."""

from __future__ import annotations

from collections.abc import Iterator

from generation.estimation.estimate import FAILURE, PREVENTABLE, Estimate
from generation.estimation.probability import LEAST_EFFECTIVE, Probability
from generation.estimation.rates import PER_DISTANCE, PER_HOUR, Rate
from generation.pipeline import Generated
from schemas.commands.wording import many

_SMALLEST = 1e-4
"""Numbers below this are written with a power of ten"""


def headline(title: str, sut: str, generated: Generated) -> list[str]:
    """Sentences about a search of a scenario with that title."""
    found, lost, estimate = _found(title, sut, generated), _lost(generated), generated.estimate
    refusal = generated.gate.refusal
    refused = [] if refusal is None else [f"The density is no judge of what is foreseeable: {refusal}."]
    if estimate is None:
        return [found, *lost, *refused, "How often traffic makes it fail was not estimated; --estimate does that."]
    made = f"When traffic makes the manoeuvre of {title}"
    drawn = made if generated.gate.replayed is not None else f"Where {title} has values as stated (nothing is recorded)"
    return [*_often(drawn, sut, estimate), *refused, found, *lost]


def _found(title: str, sut: str, generated: Generated) -> str:
    outcomes = generated.episodes.outcomes
    failures, cases = int((outcomes.executed & outcomes.collision).sum()), int(generated.cases.outcomes.collision.sum())
    ran = int(outcomes.executed.sum())
    if not failures:
        return f"{sut} has no collision in {many(ran, 'run')} of {title}."
    judged = f"{cases} failures unlike each other are" if cases > 1 else f"{cases or 'no'} failure is"
    ran_of = f"{failures:,} of {many(ran, 'sought or drawn run')} of {title}"
    return f"{sut} collides in {ran_of}; {judged} foreseeable and prevented by a careful driver."


def _lost(generated: Generated) -> Iterator[str]:
    """Runs that failed, which nothing else on the page counts."""
    outcomes = generated.episodes.outcomes
    errors = outcomes.error[~outcomes.executed]
    if len(errors):
        yield f"{many(len(errors), 'more run')} failed and count for nothing, the first with: {errors[0]}"


def _often(drawn: str, sut: str, estimate: Estimate) -> Iterator[str]:
    failure, rates = estimate.probabilities[FAILURE], estimate.rates(FAILURE)
    yield f"{drawn}, {sut} collides with a probability of {chance(failure)}."
    if rates:
        yield f"That is {rate(rates[PER_HOUR])} collisions per hour of driving and {rate(rates[PER_DISTANCE])} per 1,000 km."
    if not failure.stable and failure.value > 0.0:
        yield f"This interval is not to be trusted: {failure.counted} are fewer than {LEAST_EFFECTIVE:g}; more runs help."
    yield f"Collisions that a careful driver prevents have a probability of {chance(estimate.probabilities[PREVENTABLE])}."
    bands = {name: each.value for name, each in estimate.probabilities.items() if name not in (FAILURE, PREVENTABLE)}
    if sum(bands.values()) > 0.0:
        shares = ((name.removeprefix("impact "), 100.0 * each / sum(bands.values())) for name, each in bands.items())
        yield f"Impacts of the collisions: {', '.join(f'{share:.0f} % {name}' for name, share in shares if share > 0.0)}."


def chance(found: Probability) -> str:
    """A probability with its interval, in percent."""
    low, high = found.interval
    if found.value <= 0.0:
        return f"at most {percent(high)} (no draw fails)"
    return f"{percent(found.value)} (95\N{NO-BREAK SPACE}% interval {percent(low)} to {percent(high)})"


def rate(found: Rate) -> str:
    """A rate with its interval."""
    low, high = found.interval
    return f"{figure(found.value)} ({figure(low)} to {figure(high)})" if found.value > 0.0 else f"at most {figure(high)}"


def percent(share: float) -> str:
    """A share in percent, two significant digits."""
    return f"{figure(100.0 * share)}\N{NO-BREAK SPACE}%"


def figure(value: float) -> str:
    """A number with two significant digits."""
    if value == 0.0:
        return "0"
    if abs(value) >= 10.0:
        return f"{value:,.0f}"
    if abs(value) < _SMALLEST:
        digits, power = f"{value:.1e}".split("e")
        return f"{digits}·10{str(int(power)).translate(_RAISED)}"
    return f"{value:#.2g}".rstrip(".")


_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
