"""Findings of recordings in a store by site and day, questions to them, and scenarios that are written on demand."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from pyarrow import parquet

from recognition.catalogue import findings
from recognition.catalogue.detect import MODEL
from recognition.catalogue.findings import Found
from recognition.catalogue.model import ByModel
from recognition.catalogue.pipeline import build
from recognition.catalogue.recordings import CatalogueSettings
from runner.batch.pool import Workers
from schemas.common.errors import InvalidFile, NotWritten, ToolchainError, UsageError
from schemas.common.policy import CommandPolicy, in_force
from schemas.common.storage import FileSystemPath
from schemas.common.terminal.command_line import progress_bar
from tests.commands import Command
from tests.recognition import motorway
from tests.recognition.catalogue.test_findings import Oracle
from xosc.listing.tables import read_index

BAR = partial(progress_bar, quiet=True)
CUT_INS = "class = 'highway cut in'"


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recordings")
    for name in ("01", "02"):
        motorway.write_motorway(folder / name, name)
    (folder / "02" / "odd.toml").write_text('day = 2020-02-29\nweather = "rain"')
    return folder


def found(recordings: Path, store: str, workers: Workers = Workers()) -> Found:  # noqa: B008 - immutable
    return findings.find([recordings], store, CatalogueSettings(), BAR, workers)


@pytest.fixture(scope="module")
def made(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    store = tmp_path_factory.mktemp("store")
    assert found(recordings, str(store)).read == 2
    return store


@pytest.fixture(scope="module")
def whole(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("catalogue")
    build([recordings], out)
    return out


def test_findings_are_the_rows_of_the_catalogue(made: Path, whole: Path) -> None:
    rows = {
        (row["recording"], row["folder"], row["name"]): row
        for row in read_index(made).table.to_pylist()
    }
    index = read_index(whole).table.to_pylist()
    keys = {(row["recording"], *row["file"].removesuffix(".xosc").split("/")) for row in index}
    assert rows.keys() == keys and len(rows) > 10
    for row in index:
        other = rows[row["recording"], *row["file"].removesuffix(".xosc").split("/")]
        assert all(
            other[name] == row[name] for name in (*findings.ROWS, "site", "day") if name in row
        )


def test_parts_are_by_site_and_day(made: Path) -> None:
    folders = {
        path.parent.relative_to(made).as_posix() for path in (made / "findings").rglob("*.parquet")
    }
    assert folders == {"findings/site=01/day=unknown", "findings/site=02/day=2020-02-29"}
    table = parquet.read_table(next((made / "recordings").glob("*.parquet")))
    assert min(table["vehicle_km"].to_pylist()) > 0.0


def test_what_is_there_is_not_read_again_and_what_is_new_is_added(
    recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, store = tmp_path / "recordings", str(tmp_path / "store")
    shutil.copytree(recordings / "01", first / "01")
    found(first, store)
    count = read_index(store).table.num_rows
    shutil.copytree(recordings / "02", first / "02")
    added = found(first, store)
    assert (added.read, added.before) == (1, 1)
    assert read_index(store).table.num_rows == 2 * count
    monkeypatch.setattr(findings, "searched", None)
    assert found(first, store).read == 0


def test_what_an_interruption_left_counts_once(recordings: Path, tmp_path: Path) -> None:
    store = tmp_path / "store"
    count = len((found(recordings, str(store)), read_index(store).table)[1])
    for ledger in (store / "recordings").iterdir():
        ledger.unlink()
    # Another number of processes divides recordings into other blocks, which replace none of these.
    for rows in list((store / "findings").rglob("*.parquet")):
        rows.rename(rows.with_stem(f"{rows.stem}0"))
    assert found(recordings, str(store), Workers(2)).read == 2
    assert read_index(store).table.num_rows == count


def test_recordings_that_changed_and_other_settings_are_refused(
    recordings: Path, tmp_path: Path
) -> None:
    mine, store = tmp_path / "recordings", str(tmp_path / "store")
    shutil.copytree(recordings, mine)
    found(mine, store)
    tracks = mine / "01" / "01_tracks.csv"
    os.utime(tracks, ns=(0, 0))
    with pytest.raises(UsageError, match="'01/01' is another one, or has changed"):
        found(mine, store)
    road = CatalogueSettings(road=tmp_path / "x.xodr")
    with pytest.raises(UsageError, match=r"other settings \(road\)"):
        findings.find([mine], store, road, BAR, Workers())


def test_recordings_that_others_rename_are_refused(recordings: Path, tmp_path: Path) -> None:
    store = str(tmp_path / "store")
    shutil.copytree(recordings / "01", tmp_path / "all" / "x" / "a")
    found(tmp_path / "all", store)
    shutil.copytree(recordings / "01", tmp_path / "all" / "y" / "a")
    with pytest.raises(UsageError, match=r"'x/a/01_tracks\.csv/a/01' is in this store as 'a/01'"):
        found(tmp_path / "all", store)


def test_a_bad_recording_is_named_and_read_again_once_it_is_mended(
    recordings: Path, tmp_path: Path
) -> None:
    mine, store = tmp_path / "recordings", str(tmp_path / "store")
    shutil.copytree(recordings, mine)
    tracks = mine / "01" / "01_tracks.csv"
    good = tracks.read_text()
    tracks.write_text(good.replace("1,", "x,", 1))
    outcome = found(mine, store)
    assert outcome.read == 1 and "01_tracks.csv" in (Path(store) / "failures.json").read_text()
    assert [type(error) for error in outcome.failures.values()] == [InvalidFile]
    tracks.write_text(good)
    assert found(mine, store).read == 1
    assert (Path(store) / "failures.json").read_text() == "{}\n"


def test_scenarios_are_written_on_demand(made: Path, whole: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    findings.write(
        str(made), out, f"{CUT_INS} and weather = 'rain'", CatalogueSettings(), BAR, Workers()
    )
    rows = read_index(out).table.to_pylist()
    assert rows and {(row["class"], row["recording"]) for row in rows} == {
        ("highway cut in", "02/02")
    }
    for row in rows:
        assert (out / row["file"]).read_bytes() == (whole / row["file"]).read_bytes()
    assert not (out / "exposure.csv").exists(), "some events in all of the time have no rate"
    assert (whole / "exposure.csv").exists()


@pytest.mark.parametrize(
    ("where", "message"),
    [
        ("class = 'highway cut im'", "no finding meets the condition; .*highway cut in"),
        ("ego_speed > 1000", "no finding meets the condition"),
        ("klass = 'highway cut in'", "there is no such column; did you mean 'class'"),
    ],
)
def test_a_condition_that_nothing_meets_is_refused(
    where: str, message: str, made: Path, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=message):
        findings.write(str(made), tmp_path, where, CatalogueSettings(), BAR, Workers())


@pytest.mark.parametrize("gone", [True, False])
def test_recordings_that_are_gone_or_changed_are_named_and_the_others_written(
    recordings: Path, tmp_path: Path, gone: bool
) -> None:
    mine, store = tmp_path / "recordings", str(tmp_path / "store")
    shutil.copytree(recordings, mine)
    found(mine, store)
    if gone:
        shutil.rmtree(mine / "01")
    else:
        os.utime(mine / "01" / "01_tracks.csv", ns=(0, 0))
    summary = findings.write(store, tmp_path / "out", CUT_INS, CatalogueSettings(), BAR, Workers())
    assert list(summary.failures) == ["01/01"]
    told = f"has {'gone' if gone else 'changed'} since its findings were added"
    assert told in str(summary.failures["01/01"]) and summary.classes == {"highway cut in": 2}


def bytes_of(folder: Path) -> dict[str, bytes]:
    """Files of a catalogue but those that tell the exposure, by name."""
    files = (path for path in folder.rglob("*.xosc") if path.is_file())
    tags = folder.rglob("*.openlabel.json")
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in (*files, *tags)}


def rows_of(folder: Path) -> list[dict[str, object]]:
    """Rows of the index of a catalogue."""
    rows: list[dict[str, object]] = json.loads((folder / "index.json").read_text())["scenarios"]
    return rows


def test_scenes_of_vehicles_are_found_first_and_written_on_demand(
    recordings: Path, tmp_path: Path
) -> None:
    settings, store = CatalogueSettings(scenes="vehicles"), str(tmp_path / "store")
    outcome = findings.find([recordings], store, settings, BAR, Workers())
    summary = build([recordings], tmp_path / "whole", settings)
    assert outcome.classes == summary.classes and outcome.excluded == len(summary.exclusions)
    findings.write(store, tmp_path / "out", None, CatalogueSettings(), BAR, Workers())
    assert bytes_of(tmp_path / "out") == bytes_of(tmp_path / "whole")
    assert rows_of(tmp_path / "out") == rows_of(tmp_path / "whole")


def by_model() -> ByModel:
    return ByModel(Oracle(), sorts=True, discover=True, stride=1.0)  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_model_finds_first_what_its_catalogue_has(recordings: Path, tmp_path: Path) -> None:
    store = str(tmp_path / "store")
    outcome = findings.find([recordings], store, CatalogueSettings(), BAR, Workers(2), by_model)
    summary = build([recordings], tmp_path / "whole", recogniser=by_model)
    assert outcome.classes == summary.classes and outcome.classes["discovered 01"]
    findings.write(store, tmp_path / "out", None, CatalogueSettings(), BAR, Workers())
    assert bytes_of(tmp_path / "out") == bytes_of(tmp_path / "whole")
    assert rows_of(tmp_path / "out") == rows_of(tmp_path / "whole")
    index = json.loads((tmp_path / "out" / "index.json").read_text())
    assert index["sorted_by"] == MODEL


def test_discovered_classes_of_two_calls_are_not_mixed(recordings: Path, tmp_path: Path) -> None:
    mine, store = tmp_path / "recordings", str(tmp_path / "store")
    shutil.copytree(recordings / "01", mine / "01")
    findings.find([mine], store, CatalogueSettings(), BAR, Workers(), by_model)
    assert findings.find([mine], store, CatalogueSettings(), BAR, Workers(), by_model).read == 0
    shutil.copytree(recordings / "02", mine / "02")
    with pytest.raises(UsageError, match="would have the names of those in this store"):
        findings.find([mine], store, CatalogueSettings(), BAR, Workers(), by_model)
    with pytest.raises(UsageError, match="other settings \\(labels, sorted_by\\)"):
        found(mine, store)


def test_a_store_of_an_earlier_version_is_refused(made: Path, tmp_path: Path) -> None:
    store = tmp_path / "store"
    shutil.copytree(made, store)
    for file in (store / "findings").rglob("*.parquet"):
        parquet.write_table(parquet.ParquetFile(file).read().drop_columns("episode"), file)
    with pytest.raises(InvalidFile, match="of an earlier version"):
        findings.write(str(store), tmp_path / "out", None, CatalogueSettings(), BAR, Workers())


def test_the_commands(command: Command, recordings: Path, tmp_path: Path) -> None:
    store, out = str(tmp_path / "store"), tmp_path / "out"
    result = command("xosc-recognize", "find", str(recordings), "--out", store)
    assert result.code == 0 and "2 recordings added" in result.out + result.err
    result = command(
        "xosc-list", store, "--where", f"{CUT_INS} and day = '2020-02-29'", "--sort", "-time"
    )
    assert result.code == 0 and "2 findings" in result.out + result.err
    result = command("xosc-list", store, "--where", "site = '2'")
    assert "no row has site '2'" in result.out + result.err
    result = command("xosc-recognize", "write", store, "--where", CUT_INS, "--out", str(out))
    assert result.code == 0 and (out / "highway_cut_in").is_dir()
    result = command("xosc-recognize", "write", str(recordings), "--out", str(out))
    assert (
        result.code == 3
        and "findings of 'xosc-recognize find' are expected" in result.out + result.err
    )


def test_urls_of_no_file_system_and_of_strangers_are_refused() -> None:
    with pytest.raises(UsageError, match=r"no file system has this URL \(file, s3"):
        FileSystemPath.of("ftp://example.org/findings")
    with in_force(CommandPolicy(untrusted=True)), pytest.raises(UsageError, match="--untrusted"):
        FileSystemPath.of("s3://bucket/findings")


# an object store --------------------------------------------------------------------------------


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """URL of a bucket on a local server that speaks S3's protocol."""
    moto = pytest.importorskip("moto.server", reason="moto's server is not installed")
    server = moto.ThreadedMotoServer(port=0, verbose=False)
    server.start()
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "testing")
    host, port = server.get_host_and_port()
    options = (
        f"endpoint_override={host}%3A{port}&scheme=http&region=us-east-1&allow_bucket_creation=true"
    )
    try:
        yield f"s3://findings/all?{options}"
    finally:
        server.stop()


def test_a_store_may_be_an_object_store(
    command: Command, recordings: Path, bucket: str, made: Path, tmp_path: Path
) -> None:
    assert command("xosc-recognize", "find", str(recordings), "--out", bucket).code == 0
    assert found(recordings, bucket).read == 0
    local, remote = (
        sorted(
            read_index(place).table.to_pylist(),
            key=lambda row: (row["recording"], row["name"], row["class"]),
        )
        for place in (made, bucket)
    )
    assert local == remote
    result = command("xosc-list", bucket, "--where", f"{CUT_INS} and weather = 'rain'")
    assert result.code == 0 and "2 findings" in result.out + result.err
    findings.write(bucket, tmp_path / "out", CUT_INS, CatalogueSettings(), BAR, Workers())
    assert read_index(tmp_path / "out").table.num_rows == 4


def test_a_server_that_does_not_answer_is_named(recordings: Path) -> None:
    place = "s3://findings/all?endpoint_override=127.0.0.1%3A9&scheme=http&region=us-east-1"
    with pytest.raises((NotWritten, ToolchainError), match="s3://findings"):
        found(recordings, place)
