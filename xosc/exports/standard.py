"""Targets `1.0` to `1.4`: the same scenarios, catalogues and distributions in another version of
the standard.

Where a version has no expressions, or not the functions that a scenario uses, its parameters are
worked out; its distributions then become a scenario for each set of parameters, as for 1.0, which
has no distributions.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from difflib import SequenceMatcher
from pathlib import Path

from schemas.common.errors import InvalidFile, Unsupported
from schemas.common.fates import changed, kept, lost
from schemas.common.storage import read_bytes
from schemas.expressions import ExpressionError, references
from xosc.document import Document, load, to_bytes
from xosc.document.road_files import NoRoadNetwork
from xosc.exports import DOCUMENT_FIELDS
from xosc.exports.concrete import concrete, concrete_scenarios, copied, in_version
from xosc.exports.draft import DEFAULTS, Draft, ExportSettings, Folder
from xosc.exports.omissions import omit
from xosc.exports.references import catalog_name, take_catalogs, take_roads
from xosc.exports.shapes import earlier, first_distances, in_world, polylines, to_init
from xosc.exports.starts import RoadGeometry
from xosc.writing.versions import Version

TARGETS = {
    "1.0": "OpenSCENARIO XML 1.0",
    "1.1": "OpenSCENARIO XML 1.1",
    "1.2": "OpenSCENARIO XML 1.2",
    "1.3": "OpenSCENARIO XML 1.3",
    "1.4": "OpenSCENARIO XML 1.4",
}
_OLD = {
    "variables": changed("parameters, which actions may set before 1.2"),
    "followingMode": lost("no attribute before 1.2; vehicles keep their Performance"),
    "lights of vehicles": lost("no element before 1.2"),
}
_ALL = dict.fromkeys(DOCUMENT_FIELDS, kept())
FATES = {
    "1.0": {
        **_ALL,
        **_OLD,
        "expressions": changed("values: 1.0 has no expressions"),
    },
    "1.1": {**_ALL, **_OLD},
    "1.2": {
        **_ALL,
        "lights of vehicles": lost(
            "refused: 1.2's schema asks for both kinds of light and an animation at once"
        ),
    },
    "1.3": _ALL,
    "1.4": _ALL,
}
"""Fates of the fields of a scenario of 1.4 by target"""
_CLOSED_SINCE = (1, 2)
"""Before, the entries of catalogues also saw the parameters at the place of the reference."""


def export(
    source: Path, target: str, folder: Folder, settings: ExportSettings = DEFAULTS
) -> Sequence[str]:
    """Write a file, and all that it refers to, in the version that the target names.

    Args:
        source: a scenario, catalogue or distribution.
        target: `1.0`, `1.1`, `1.2`, `1.3` or `1.4`.

    Returns:
        Remarks on what is not as it was.

    Raises:
        Unsupported: the version can't say all of it, named with file and line.
        InvalidFile, UsageError: a file can't be read, or not be written.
    """
    major, minor = target.split(".")
    version = (int(major), int(minor))
    # Nothing of a version is decided by the road; only who plays the file needs it.
    settings = replace(settings, needs_road=False)
    document = load(source, strict=settings.strict)
    if document.kind == "distribution":
        return distribution(document, version, Draft(folder, settings))
    if document.kind == "scenario":
        return scenario(document, version, Draft(folder, settings))
    draft = Draft(folder, settings)
    draft.note(*document.remarks)
    draft.add(catalog_name(source, folder), as_written(_catalog(document, version, draft)))
    return draft.write()


def scenario(document: Document, version: Version | None, draft: Draft) -> Sequence[str]:
    """Write a scenario with its parameters and catalogues, or worked out where the version can't
    say them; as in `export`.

    Args:
        version: of the scenario and its catalogues; None leaves each in its own.
        draft: what else is to be written and said.
    """
    # On a copy of the draft: what fails half-way adds no file and no remark.
    trial = draft.copy()
    try:
        add(document, version, trial)
        return trial.write()
    except (Unsupported, InvalidFile) as error:
        # Unused entries of catalogues may be invalid, and so may attributes without a value yet.
        add_worked_out(concrete(document, **draft.settings.resolving), version, draft)
        return draft.write(f"values stand in the place of parameters and references: {error}")


def add(document: Document, version: Version | None, draft: Draft, name: str = "") -> None:
    """Add a scenario (under another name, where one is given), its catalogues and its roads to what
    is to be written.

    Raises:
        Unsupported: the version can't say all of it.
        InvalidFile: a file that it refers to can't be read.
    """
    changed = copied(document)
    draft.note(*document.remarks)
    take_catalogs(changed, draft, lambda catalog: as_written(_catalog(catalog, version, draft)))
    try:
        take_roads(changed, draft)
    except NoRoadNetwork as missing:
        if draft.settings.needs_road or draft.settings.strict:
            raise
        rest, _, _ = str(missing).partition(": put it there")
        draft.note(f"{rest}: it is named as before")
    named = draft.folder.name(document.path, f"{name or document.path.stem}.xosc")
    draft.add(named, as_written(in_version(changed, version or changed.version, draft)))


_OTHER_ENCODING = re.compile(rb"""\sencoding\s*=\s*["'](?!utf-8["'])""", re.IGNORECASE)
_TAG = re.compile(rb"""<!--.*?-->|<(?:[^<>"']|"[^"]*"|'[^']*')*>""", re.DOTALL)


def as_written(document: Document) -> bytes:
    """Content of a document, with the bytes of its file where both say the same: a diff of both
    shows what has changed, not other spaces, quotes or ends of lines."""
    content = to_bytes(document)
    try:
        source = read_bytes(document.path)
        source.decode("utf-8-sig")
    except (InvalidFile, UnicodeDecodeError):  # of no file, or in another encoding
        return content
    end = b"\r\n" if source.count(b"\r\n") > source.count(b"\n") / 2 else b"\n"
    tags, texts = _tokens(content)
    old_tags, old_texts = _tokens(source)
    places = _places([_plain(tag) for tag in tags], [_plain(tag) for tag in old_tags])
    written = [old_texts[0] if places.get(0) == 0 else texts[0]]
    for at, (tag, text) in enumerate(zip(tags, texts[1:], strict=True)):
        old = places.get(at)
        last = at == len(tags) - 1
        follows = old is not None and (
            old == len(old_tags) - 1 if last else places.get(at + 1) == old + 1
        )
        same = old is not None and _plain(tag) == _plain(old_tags[old])
        written.append(old_tags[old] if same and old is not None else tag)
        if old is not None and follows and old_texts[old + 1].split() == text.split():
            written.append(old_texts[old + 1])
        else:
            written.append(text.replace(b"\n", end))
    return b"".join(written)


def _tokens(content: bytes) -> tuple[list[bytes], list[bytes]]:
    """Tags and comments of a file, and the texts before, between and after them."""
    tags = _TAG.findall(content)
    return tags, _TAG.split(content)


def _plain(tag: bytes) -> bytes:
    """A tag without what says nothing: spaces, and how a declaration of UTF-8 is written. One of
    another encoding would be wrong for what is added."""
    if tag.startswith(b"<!--"):
        return tag.replace(b"\r\n", b"\n")
    if tag.startswith(b"<?xml") and not _OTHER_ENCODING.search(tag):
        return b"<?xml?>"
    return re.sub(rb"\s+(/?>)\Z", rb"\1", b" ".join(tag.split()))


def _places(new: Sequence[bytes], old: Sequence[bytes]) -> dict[int, int]:
    """Places of tags in the old file by places in the new one; of changed tags too, where as many
    stand there."""
    places: dict[int, int] = {}
    for _, first, last, start, stop in SequenceMatcher(None, new, old).get_opcodes():
        if last - first == stop - start:
            places.update(zip(range(first, last), range(start, stop), strict=True))
    return places


def add_worked_out(
    document: Document, version: Version | None, draft: Draft, name: str = ""
) -> None:
    """Add a worked-out scenario, positions and trajectories as places in the world where the
    version has no others; as `add`."""
    trial = draft.copy()
    try:
        add(document, version, trial, name)
        draft.take(trial)
    except Unsupported:
        if draft.settings.locate is None or version is None or version >= document.version:
            raise
        located = copied(document)
        if not draft.settings.strict:
            draft.note(*omit(located, document.version))  # what nothing executes gets no place
        if version < (1, 1):
            draft.note(*to_init(located))
        draft.note(*_located(located, draft.settings.locate(located), version))
        add(located, version, draft, name)


def _located(document: Document, geometry: RoadGeometry, version: Version) -> Iterator[str]:
    """Replace, in place, elements that a version lacks by places on the roads; remarks."""
    if version < (1, 4):
        yield from in_world(document, geometry, lambda position: position.has("layer"))
    if version < (1, 3):
        yield from polylines(
            document, geometry, ("ClothoidSpline",), offsets=version < (1, 1), during=None
        )
    if version < (1, 1):
        yield from earlier(document, geometry)
        yield from in_world(
            document,
            geometry,
            lambda position: position.tag in ("TrajectoryPosition", "GeoPosition"),
        )
        yield from first_distances(document, geometry.starts())


def _catalog(catalog: Document, version: Version | None, draft: Draft) -> Document:
    """A catalogue in a version; refused where its entries would no longer see parameters that they
    use."""
    if version is not None and catalog.version < _CLOSED_SINCE <= version:
        for entry in catalog.node.need("Catalog").children():
            declared = {
                declaration.get("name") for declaration in entry.iter("ParameterDeclaration")
            }
            for node in entry.iter():
                used = {
                    name for text in node.element.attrib.values() for name in _parameters(str(text))
                }
                if used - declared:
                    name = min(used - declared)
                    raise node.unsupported(
                        f"${name} is of the scenario, and since 1.2 entries of catalogues see "
                        "their own only"
                    )
    return in_version(catalog, version or catalog.version, draft)


def _parameters(text: str) -> set[str]:
    try:
        return references(text)
    except ExpressionError:  # as malformed in every version
        return set()


def distribution(document: Document, version: Version | None, draft: Draft) -> Sequence[str]:
    """Write a distribution and its scenario, or a scenario for each set of parameters; remarks and
    errors as in `export`."""
    node = document.node.need("ParameterValueDistribution", "ScenarioFile")
    if draft.settings.selection.chooses:
        return write_sets(
            document,
            version,
            draft,
            "a scenario is written for each set of parameters that is chosen",
        )
    trial = draft.copy()
    try:
        varied = load(node.file("filepath"), strict=draft.settings.strict)
        add(varied, version, trial)
        changed = copied(in_version(document, version or document.version, trial))
        reference = changed.node.need("ParameterValueDistribution", "ScenarioFile")
        reference.element.set(
            "filepath", draft.folder.name(varied.path, f"{varied.path.stem}.xosc")
        )
        trial.note(*document.remarks)
        trial.add(draft.folder.name(document.path, document.path.name), as_written(changed))
        return trial.write()
    except (Unsupported, InvalidFile) as error:
        return write_sets(
            document, version, draft, f"a scenario is written for each set of parameters: {error}"
        )


def write_sets(
    document: Document, version: Version | None, draft: Draft, remark: str
) -> Sequence[str]:
    """Write the scenario of a distribution with each set of its parameters worked out; remarks and
    errors as in `export`."""
    for name, worked_out in concrete_scenarios(document.path, draft.settings):
        add_worked_out(worked_out, version, draft, name)
    return draft.write(remark)
