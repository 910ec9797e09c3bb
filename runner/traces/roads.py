"""The road of an OSI trace: attached, named, beside it, or drawn from its lanes."""

from __future__ import annotations

from pathlib import Path, PurePosixPath
from typing import NamedTuple

from runner.traces.lanes import drawn
from runner.traces.reading import TraceRecording
from schemas.common.errors import ToolchainError
from schemas.common.policy import current
from schemas.common.storage import digest, keep
from schemas.osi.traces import AttachedMap, Trace

_ENDINGS = (".xodr", ".odr")


class TraceRoad(NamedTuple):
    """The OpenDRIVE file of a trace, and what is to be said of it."""

    path: Path
    notes: tuple[str, ...]


def road_of(path: Path, found: TraceRecording, folder: Path) -> TraceRoad | None:
    """The road of a trace; None where it has none.

    A map inside the file comes first, then the file that `map_reference` names beside the trace, then one with the trace's own
    name, then the lanes. Only the last part of a reference counts: traces name files of the machines that wrote them.

    Args:
        found: what the trace records.
        folder: for roads that are made, or taken out of the trace.

    Raises:
        InvalidFile: the map inside the file is no OpenDRIVE.
        UsageError: the lanes make no road map, or the folder can't be written.
    """
    reference = found.truth.map_reference
    attached = _attached(Trace(path).contents.maps, reference)
    if attached is not None:
        made = keep(attached.content, folder / f"{_plain(path.stem)}-{digest(attached.content)}.xodr")
        _load(made, f"the map {attached.name!r} in the {attached.where} of {path.name}")
        return TraceRoad(made, (f"the road is the one in the trace's {attached.where} {attached.name!r}",))
    for name in dict.fromkeys((_last(reference), f"{path.stem}.xodr")):
        beside = path.with_name(name) if name else None
        if beside is not None and current().allows(beside) and beside.is_file():
            return TraceRoad(beside, (f"the road is {name} beside the trace",))
    lanes = drawn(found.truth, path.stem)
    if lanes is None:
        return None
    absent = f"{_last(reference)}, which map_reference names, is not beside the trace: " if _last(reference) else ""
    made = keep(lanes.content, folder / f"{_plain(path.stem)}-{digest(lanes.content)}.xodr")
    return TraceRoad(made, (f"{absent}{lanes.notes[0]}", *lanes.notes[1:]))


def _attached(maps: list[AttachedMap], reference: str) -> AttachedMap | None:
    """The map that a trace's reference names, else the first."""
    named = [each for each in maps if _last(each.name) and _last(each.name) == _last(reference)]
    return next(iter([*named, *maps]), None)


def _load(path: Path, what: str) -> None:
    from xodr.reader import load

    try:
        load(path)
    except ToolchainError as error:
        error.message = f"{what}: {error.message}"
        raise


def _last(reference: str) -> str:
    """The file name in a reference to an OpenDRIVE file; empty for anything else."""
    name = PurePosixPath(reference.replace("\\", "/")).name
    return name if name.lower().endswith(_ENDINGS) and name.isprintable() else ""


def _plain(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name)
