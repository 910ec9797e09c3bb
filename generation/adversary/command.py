"""`xosc-generate --method adversary`: its search, and what it says."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from generation.adversary import NAME
from schemas.commands.options import progress_bar
from schemas.errors import UsageError

if TYPE_CHECKING:
    from generation.adversary.pipeline import Written
    from generation.declared import Ask
    from generation.pipeline import SearchSettings

_LISTED = 3


def adversary(source: Path, out: Path, settings: SearchSettings, ask: Ask, quiet: bool) -> bool:
    """Search, and say what was found; whether there is anything.

    Raises:
        UsageError: an option has no meaning for an adversary, or as in `generation.adversary.pipeline.generate`.
    """
    from generation.adversary.pipeline import Settings, generate

    if source.is_dir():
        raise UsageError(f"the method {NAME} takes a scenario, not a catalogue", path=source)
    if ask.free or ask.maps or ask.kind is not None or settings.estimate:
        raise UsageError(f"--free, --map, --kind and --estimate are about parameters, which the method {NAME} does not search")
    chosen = Settings(
        settings.run,
        settings.budget,
        settings.choice.most,
        settings.seed,
        ask.recordings,
        settings.processes,
        settings.ray,
        ask.pinned,
    )
    with progress_bar(source.stem, chosen.search.rounds * chosen.search.episodes, quiet) as progress:
        written = generate(source, out, chosen, progress)
    if not quiet:
        print("\n".join(_report(source, written, chosen.run.sut)))
    return bool(written.files)


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
