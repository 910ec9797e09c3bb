"""Several processes make the same catalogue as one, and what was read before an interruption is not read again."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import pytest

from recognition.catalogue.beside import Workers
from recognition.catalogue.pipeline import ByRules, Summary, build
from recognition.catalogue.stages import CatalogueSettings, opened
from recognition.datasets import Source
from schemas.errors import InvalidFile
from tests.recognition import motorway


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recordings")
    for name in ("01", "02", "03"):
        motorway.write_motorway(folder / name, name)
    tracks = folder / "03" / "03_tracks.csv"
    tracks.write_text(tracks.read_text().replace("1,", "x,", 1))
    return folder


def made(recordings: Path, out: Path, workers: Workers) -> Summary:
    return build([recordings], out, CatalogueSettings(), ByRules(), lambda sources, _: sources, workers)


def content(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_several_make_the_same_bytes_as_one(recordings: Path, tmp_path: Path) -> None:
    one, several = made(recordings, tmp_path / "one", Workers()), made(recordings, tmp_path / "several", Workers(2))
    assert content(tmp_path / "one") == content(tmp_path / "several")
    assert one.classes == several.classes and one.classes.total() > 10
    assert [type(error) for error in several.failures.values()] == [InvalidFile], "what is wrong with one keeps no other away"
    assert not (tmp_path / "several" / ".recordings").exists()


@pytest.mark.parametrize("scenes", ["events", "vehicles"])
def test_several_share_one_recording(scenes: str, recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[tuple[str, int]] = []

    def seen(items: Sequence[object], doing: str) -> Sequence[object]:
        shown.append((doing, len(items)))
        return items

    whole = build([recordings / "01"], tmp_path / "whole", CatalogueSettings(scenes=scenes), ByRules(), seen, Workers())
    monkeypatch.setattr("recognition.catalogue.pipeline._EPISODES", 2)
    build([recordings / "01"], tmp_path / "parts", CatalogueSettings(scenes=scenes), ByRules(), seen, Workers(2))
    assert content(tmp_path / "whole") == content(tmp_path / "parts")
    assert shown == [("recognising", 1), ("writing", 1), ("recognising", 1), ("writing", -(-whole.classes.total() // 2))]
    assert shown[-1][1] > 2


def test_what_was_read_before_an_interruption_is_not_read_again(
    recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[str] = []
    load = Source.load

    def counted(source: Source) -> object:
        read.append(source.name)
        return load(source)

    def interrupted(sources: Sequence[Source], doing: str) -> Iterable[Source]:
        yield sources[0]
        raise KeyboardInterrupt

    monkeypatch.setattr(Source, "load", counted)
    with pytest.raises(KeyboardInterrupt):
        build([recordings], tmp_path / "again", CatalogueSettings(), ByRules(), interrupted)
    first = list(read)
    made(recordings, tmp_path / "again", Workers())
    made(recordings, tmp_path / "whole", Workers())
    names = [source.name for source in opened((recordings,))]
    assert first == names[:1] and read == [*names, *names]
    assert content(tmp_path / "again") == content(tmp_path / "whole")
