"""`xosc-generate --method adversary`: its search, and what it says."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from generation.adversary import NAME, OBJECTIVES
from schemas.commands.options import progress_bar
from schemas.errors import UsageError

if TYPE_CHECKING:
    from generation.adversary.pipeline import Written
    from generation.declared import Ask
    from generation.pipeline import SearchSettings

_LISTED = 3


def adversary(source: Path, out: Path, settings: SearchSettings, ask: Ask, objective: str | None, quiet: bool) -> bool:
    """Search, and say what was found; whether there is anything.

    Args:
        objective: name of what shapes its reward; None for the default.

    Raises:
        UsageError: an option has no meaning for an adversary, or as in `generation.adversary.pipeline.generate`.
    """
    from generation.adversary.pipeline import Settings, generate
    from generation.adversary.search import AdversarySettings
    from generation.adversary.shape import shape

    if source.is_dir():
        raise UsageError(f"the method {NAME} takes a scenario, not a catalogue", path=source)
    if meaningless := _meaningless(settings, ask):
        raise UsageError(f"{', '.join(meaningless)}: about parameters, which the method {NAME} does not search")
    chosen = Settings(
        settings.run,
        settings.budget,
        settings.choice.most,
        settings.seed,
        ask.recordings,
        settings.processes,
        settings.ray,
        ask.pinned,
        AdversarySettings(objective=objective or OBJECTIVES[0], apart=settings.choice.apart),
    )
    shape(chosen.search.objective)  # a wrong name is better known before recordings are read
    with progress_bar(source.stem, chosen.search.rounds * chosen.search.episodes, quiet) as progress:
        written = generate(source, out, chosen, progress)
    if not quiet:
        print("\n".join(_report(source, written, chosen.run.sut)))
    return bool(written.files)


def _meaningless(settings: SearchSettings, ask: Ask) -> list[str]:
    """Options that were given and say nothing to an adversary."""
    usual = type(settings)()
    given = {
        "--free": ask.free, "--map": ask.maps, "--kind": ask.kind, "--density": ask.density != usual.density,
        "--weight": settings.weight is not None, "--rss": settings.rss != usual.rss, "--estimate": settings.estimate,
        "--violations": settings.choice.violations, "--concrete": settings.concrete,
    }  # fmt: skip
    return [option for option, value in given.items() if value]


def _report(scenario: Path, written: Written, sut: object) -> Iterator[str]:
    rounds = written.rounds
    episodes, foreseeable = sum(each.episodes for each in rounds), sum(each.foreseeable for each in rounds)
    failures = sum(each.failures for each in rounds)
    yield f"{scenario.name}: {NAME} against {sut}"
    yield f"  {episodes} episodes on the twin, {foreseeable} of them as likely as recorded driving; {failures} failures"
    survived = ", ".join(f"{name} {count}" for name, count in written.survived.items())
    confirmed = f"{written.world} confirms {len(written.files)} of {written.tried} to the step"
    yield f"  {written.found} of the failures are distinct; {confirmed}"
    if written.files:
        yield f"  of these, reference drivers survive: {survived}"
    yield from (f"  {path}" for path in written.files[:_LISTED])
    if len(written.files) > _LISTED:
        yield f"  and {len(written.files) - _LISTED} more files in {written.files[0].parent}"
