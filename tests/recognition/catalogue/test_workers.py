"""Several processes make the same catalogue as one, and what was read before an
interruption is not read again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from recognition.catalogue.detect import ByRules
from recognition.catalogue.pipeline import Summary, Workers, build
from recognition.catalogue.recordings import CatalogueSettings, RecordingStore
from recognition.recordings import Report, Source
from recognition.recordings.source import opened
from runner.recording import Recording
from schemas.common.errors import InvalidFile
from schemas.common.terminal.command_line import progress_bar
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
    return build(
        [recordings], out, CatalogueSettings(), ByRules, partial(progress_bar, quiet=True), workers
    )


def content(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.mark.slow
def test_several_make_the_same_bytes_as_one(recordings: Path, tmp_path: Path) -> None:
    one, several = (
        made(recordings, tmp_path / "one", Workers()),
        made(recordings, tmp_path / "several", Workers(2)),
    )
    assert content(tmp_path / "one") == content(tmp_path / "several")
    assert one.classes == several.classes and one.classes.total() > 10
    assert [type(error) for error in several.failures.values()] == [InvalidFile], (
        "what is wrong with one keeps no other away"
    )
    assert not (tmp_path / "several" / ".recordings").exists()


@pytest.mark.slow
@pytest.mark.parametrize("scenes", ["events", "vehicles"])
def test_several_share_one_recording(
    scenes: str, recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[tuple[str, int, list[float]]] = []

    @contextmanager
    def seen(doing: str, count: int) -> Iterator[Callable[[float], None]]:
        shown.append((doing, count, []))
        yield shown[-1][2].append

    whole = build(
        [recordings / "01"],
        tmp_path / "whole",
        CatalogueSettings(scenes=scenes),
        ByRules,
        seen,
        Workers(),
    )
    monkeypatch.setattr("recognition.catalogue.pipeline._EPISODES", 2)
    build(
        [recordings / "01"],
        tmp_path / "parts",
        CatalogueSettings(scenes=scenes),
        ByRules,
        seen,
        Workers(2),
    )
    assert content(tmp_path / "whole") == content(tmp_path / "parts")
    written = whole.classes.total()
    assert [(doing, count) for doing, count, _ in shown] == 2 * [
        ("recognising", 1),
        ("writing", written),
        ("playing", written),
    ]
    assert [sum(steps) for _, _, steps in shown] == 2 * [1, written, written], (
        "what is shown adds up"
    )
    assert len(shown[-2][2]) == -(-written // 2) > 2, "one recording is shown in parts"


@pytest.mark.parametrize("edited", ["road.xodr", "table.osm", "table.xodr", "columns.toml"])
def test_a_copy_counts_while_the_files_that_it_was_read_by_are_the_same(
    tmp_path: Path, edited: str
) -> None:
    for name in ("table.csv", "road.xodr", "table.osm", "table.xodr", "columns.toml"):
        (tmp_path / name).write_text("as it was")
    source = Source("table", "table", "table", tmp_path / "table.csv", lambda: 1 // 0)
    source.given, source.map = tmp_path / "road.xodr", tmp_path / "table.osm"
    source.columns = tmp_path / "columns.toml"
    store = RecordingStore(tmp_path / "copies")
    store.put(source, Recording([], 0.1, None), Report())
    assert store.find(source) is not None
    (tmp_path / edited).write_text("as it is now")
    assert store.find(source) is None


@pytest.mark.slow
@pytest.mark.parametrize("damaged", ["", "arrow", "jsonl"])
def test_what_was_read_before_an_interruption_is_not_read_again_unless_it_is_damaged(
    recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, damaged: str
) -> None:
    read: list[str] = []
    load = Source.load

    def counted(source: Source) -> object:
        read.append(source.name)
        return load(source)

    @contextmanager
    def interrupted(doing: str, count: int) -> Iterator[Callable[[float], None]]:
        def stop(done: float) -> None:
            raise KeyboardInterrupt

        yield stop

    monkeypatch.setattr(Source, "load", counted)
    with pytest.raises(KeyboardInterrupt):
        build([recordings], tmp_path / "again", CatalogueSettings(), ByRules, interrupted)
    first = list(read)
    if damaged:
        (kept,) = (tmp_path / "again" / ".recordings").glob(f"*.{damaged}")
        content_of = bytearray(kept.read_bytes())
        content_of[len(content_of) // 2] ^= 1
        kept.write_bytes(content_of)
    made(recordings, tmp_path / "again", Workers())
    made(recordings, tmp_path / "whole", Workers())
    names = [source.name for source in opened((recordings,))]
    assert first == names[:1] and read == [*(names[:1] if damaged else []), *names, *names]
    assert content(tmp_path / "again") == content(tmp_path / "whole")
