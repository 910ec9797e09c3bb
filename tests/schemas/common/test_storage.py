"""Files that may be anything, and files that the toolchain makes itself."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from schemas.common.errors import InvalidFile, UsageError
from schemas.common.policy import CommandPolicy, in_force
from schemas.common.storage import (
    ForeignCache,
    Records,
    cache_folder,
    check_settings,
    is_own,
    keep,
    parse_object,
    read_bytes,
    read_object,
    write_object,
    writing,
)  # fmt: skip
from tests.commands import Command
from tests.disk import watched
from xosc.listing import LIBRARY


@pytest.fixture(params=[0o022, 0o007], ids=oct)
def allowed(request: pytest.FixtureRequest) -> Iterator[int]:
    """The permissions that a umask leaves to new files, while it is the user's."""
    before = os.umask(request.param)
    yield 0o666 & ~request.param
    os.umask(before)


def test_a_file_has_the_permissions_of_the_users_umask(allowed: int, tmp_path: Path) -> None:
    path = keep(b"kept", tmp_path / "new" / "file")
    assert (path.read_bytes(), stat.S_IMODE(path.stat().st_mode)) == (b"kept", allowed)


def test_a_file_with_the_same_content_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "file"
    first = keep(b"kept", path).stat()
    assert keep(b"kept", path).stat().st_ino == first.st_ino
    assert keep(b"changed", path).read_bytes() == b"changed"


def test_what_can_t_be_written_leaves_nothing_behind(tmp_path: Path) -> None:
    (tmp_path / "in_the_way" / "inside").mkdir(parents=True)
    with (
        pytest.raises(UsageError, match=r"in_the_way: the note can't be written: Is a directory$"),
        writing("the note", tmp_path / "in_the_way"),
    ):
        keep(b"kept", tmp_path / "in_the_way")
    assert [path.name for path in tmp_path.iterdir()] == ["in_the_way"]


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", "object.json:1: not readable as JSON: Expecting value; mend it"),
        (b'{\n"a": }', "object.json:2: not readable as JSON: Expecting value; mend it"),
        (b'{"a": "\xff"}', "object.json: not readable as JSON: 'utf-8' codec can't decode byte"),
        (b"[" * 100_000, "object.json: not readable as JSON: "),
        (b"[]", "object.json: a JSON object is expected; mend it"),
        (b"null", "object.json: a JSON object is expected; mend it"),
    ],
)
def test_what_is_no_json_object_is_refused_in_one_line(
    content: bytes, complaint: str, tmp_path: Path
) -> None:
    path = tmp_path / "object.json"
    path.write_bytes(content)
    with pytest.raises(InvalidFile) as caught:
        read_object(path, "mend it")
    assert str(caught.value).startswith(f"{tmp_path}/{complaint}") and "\n" not in str(caught.value)


def test_a_missing_file_is_told_with_the_most_similar_beside_it(tmp_path: Path) -> None:
    for name in ("NCAP_CCRs_2023.xosc", "NCAP_CCR_2024.json", "other.xosc"):
        (tmp_path / name).touch()
    with pytest.raises(InvalidFile) as caught:
        read_bytes(tmp_path / "NCAP_CCR_2023.xosc")
    assert str(caught.value).endswith(": no such file; did you mean 'NCAP_CCRs_2023.xosc'?")
    with pytest.raises(InvalidFile) as caught:
        read_bytes(tmp_path / "NCAP_CCRs_2023.xsoc")
    assert str(caught.value).endswith(": no such file; did you mean 'NCAP_CCRs_2023.xosc'?")
    (tmp_path / "corpora").mkdir()
    with pytest.raises(InvalidFile, match=r"no such file; did you mean 'corpora'\?"):
        read_bytes(tmp_path / "corporas")
    with pytest.raises(InvalidFile, match=r"no such file$"):
        read_bytes(tmp_path / "absent" / "other.xosc")
    with pytest.raises(InvalidFile, match=r"result.json: no such file; did you mean 'corpora'\?"):
        read_bytes(tmp_path / "corporas" / "result.json")
    with in_force(CommandPolicy(untrusted=True)), pytest.raises(InvalidFile) as caught:
        read_bytes(tmp_path / "NCAP_CCR_2023.xosc")
    assert "CCRs" not in str(caught.value)


def test_an_object_is_read_or_refused_by_its_line(tmp_path: Path) -> None:
    path = keep('{"é": [1]}'.encode(), tmp_path / "object.json")
    assert read_object(path) == parse_object(path.read_bytes(), path) == {"é": [1]}
    with pytest.raises(InvalidFile, match=r"object\.json:7: not readable as JSON: "):
        parse_object(b"{", path, 7)
    with pytest.raises(InvalidFile, match=r"none\.json: no such file$"):
        read_object(tmp_path / "none.json", "mend it")


def test_work_goes_on_with_the_same_settings_or_a_part_of_them(tmp_path: Path) -> None:
    path = tmp_path / "work" / "settings.json"
    check_settings(path, {"seed": 1}, "a batch")
    assert not path.exists()
    write_object({"seed": 1, "names": ("ä", "b")}, path)
    check_settings(path, {"seed": 1, "names": ("ä", "b")}, "a batch")
    check_settings(path, {"seed": 1}, "a batch")
    assert read_object(path) == {"seed": 1, "names": ["ä", "b"]}


@pytest.mark.parametrize(
    "settings", [{"seed": 2}, {"seed": 1, "sut": None}, {"seed": 1, "sut": "cas"}, {"seed": "1"}]
)
def test_work_with_other_settings_is_refused_by_their_names(
    tmp_path: Path, settings: dict[str, object]
) -> None:
    write_object({"seed": 1}, tmp_path / "settings.json")
    changed = "sut" if "sut" in settings else "seed"
    with pytest.raises(UsageError, match=rf"holds a batch with other settings \({changed}\)"):
        check_settings(tmp_path / "settings.json", settings, "a batch")


def test_damaged_settings_are_named(tmp_path: Path) -> None:
    (tmp_path / "settings.json").write_text("[1]")
    with pytest.raises(UsageError, match=r"settings of a batch .* a JSON object is expected"):
        check_settings(tmp_path / "settings.json", {}, "a batch")


# a cache that is shared -------------------------------------------------------------------------


@pytest.fixture
def shared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder that holds a file."""
    folder = tmp_path / "cache"
    keep(b"kept", folder / "roads" / "a.xodr")
    monkeypatch.setenv("XOSC_CACHE_DIR", str(folder))
    return folder


def test_a_cache_of_another_user_is_refused(shared: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert cache_folder("roads") == shared / "roads"
    (shared / "roads").chmod(0o777)
    with pytest.raises(ForeignCache, match="other users may write into this cache folder"):
        cache_folder("roads")
    (shared / "roads").chmod(0o1777)  # as /tmp: others may add files, which do not count
    assert cache_folder("roads") == shared / "roads"
    owner = shared.stat().st_uid
    os.chown(shared, 4242, -1) if os.geteuid() == 0 else monkeypatch.setattr(
        os, "geteuid", lambda: owner + 1
    )
    with pytest.raises(ForeignCache) as error:
        cache_folder()
    assert str(shared) in str(error.value)


def test_a_command_does_without_such_a_cache_and_says_so(shared: Path, command: Command) -> None:
    shared.chmod(0o777)
    before = sorted(shared.rglob("*"))
    answer = command(
        "xosc-run",
        LIBRARY / "simple_cut_in_variation.xosc",
        "--sut",
        "adas",
        "--only",
        "6",
        "--max-time",
        "0.2",
    )
    assert answer.code == 6 and answer.err.count("\n") == 1
    assert (
        answer.err.startswith(f"xosc-run: remark: {shared}: other users may write")
        and "an empty one is used" in answer.err
    )
    assert sorted(shared.rglob("*")) == before and os.environ["XOSC_CACHE_DIR"] == str(shared)


def test_a_file_that_others_may_change_is_written_anew(shared: Path) -> None:
    path = shared / "roads" / "a.xodr"
    path.chmod(0o666)
    number = path.stat().st_ino
    keep(b"kept", path)
    assert is_own(path) and path.stat().st_ino != number and path.read_bytes() == b"kept"


@pytest.mark.skipif(not Path("/proc/self/environ").is_file(), reason="no /proc")
def test_a_file_of_proc_has_no_content() -> None:
    """Some of them answer with secrets, and some, as /proc/kmsg, never."""
    assert read_bytes(Path("/proc/self/environ")) == b""


@pytest.mark.skipif(not os.access("/dev/shm", os.W_OK), reason="no disk in memory")
def test_a_link_on_a_disk_in_memory_is_replaced_and_not_written_through() -> None:
    with TemporaryDirectory(dir="/dev/shm") as folder:
        outside, link = Path(folder, "outside"), Path(folder, "link")
        outside.write_bytes(b"kept")
        link.symlink_to(outside)
        keep(b"new", link)
        assert (outside.read_bytes(), link.read_bytes(), link.is_symlink()) == (
            b"kept",
            b"new",
            False,
        )


def test_a_content_is_on_the_disk_before_its_name(tmp_path: Path) -> None:
    operations: list[str] = []
    with watched(tmp_path, operations.append):
        keep(b"content", tmp_path / "file")
    assert [name for name in operations if name in ("fsync", "replace")] == ["fsync", "replace"]


def test_records_are_sorted_by_name_and_the_last_of_a_name_stays(tmp_path: Path) -> None:
    records = Records(tmp_path / "runs.jsonl")
    records.sort(lambda record: record["name"])
    assert not records.path.exists()
    records.add([{"name": "b", "n": 1}, {"name": "a", "n": 2}, {"name": "b", "n": 3}, {"n": 4}])
    with records.path.open("ab") as file:
        file.write(b'{"name": "c"}\n')  # without its digest
    records.sort(lambda record: record.get("name"))
    assert records.read() == ([{"name": "a", "n": 2}, {"name": "b", "n": 3}], [])
    before = records.path.stat()
    records.sort(lambda record: record["name"])
    assert records.path.stat().st_ino == before.st_ino, "what is in order is not written again"


def test_records_are_read_a_line_at_a_time_and_damaged_lines_are_none(tmp_path: Path) -> None:
    records = Records(tmp_path / "runs.jsonl")
    assert not [*records]
    records.add([{"n": 1}, {"n": 2}, {"n": 3}])
    records.path.write_bytes(records.path.read_bytes().replace(b'"n": 2', b'"n": 7')[:-5])
    assert [*records] == [{"n": 1}, None, None]
    assert records.read().damaged == [2, 3]
