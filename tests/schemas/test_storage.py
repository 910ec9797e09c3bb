"""Files that the toolchain makes itself."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from schemas.storage import keep


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
    with pytest.raises(OSError, match="in_the_way"):
        keep(b"kept", tmp_path / "in_the_way")
    assert [path.name for path in tmp_path.iterdir()] == ["in_the_way"]
