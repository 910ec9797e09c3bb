"""Reading files that may be anything, writing them whole or not at all, and keeping results of work
that is resumed."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import secrets
import stat
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

from schemas.common.errors import InvalidFile, NotWritten, UsageError, guess, most_similar
from schemas.common.errors import reason as reason_of
from schemas.common.policy import current

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.dataset as ds
    import pyarrow.parquet as pq

MAX_BYTES = 256 * 1024 * 1024
"""Largest file that is read. The biggest public road networks have about a tenth of it."""


def cache_folder(part: str = "") -> Path:
    """The cache folder, or a folder in it: XOSC_CACHE_DIR, or xosc-toolchain in XDG_CACHE_HOME or
    in ~/.cache.

    Raises:
        ForeignCache: it is there, and another user may have put files into it.
    """
    own = os.environ.get("XOSC_CACHE_DIR")
    root = Path(
        own or Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "xosc-toolchain"
    )
    # The root is looked at too: who may write into it can put another folder in the place of the
    # part.
    for folder in dict.fromkeys((root, root / part)):
        if not is_own(folder):
            raise ForeignCache(
                "other users may write into this cache folder: set XOSC_CACHE_DIR to another one",
                path=folder,
            )
    return root / part


class ForeignCache(UsageError):
    """The cache folder is not of this user alone."""


def is_own(path: Path) -> bool:
    """Whether a file or folder is absent, or of this user or the system's and not for all to write
    into.

    A folder for all in which users remove only their own files (as /tmp) is one. Windows keeps this
    by its own means.
    """
    try:
        status = os.stat(path)
    except OSError:
        return True
    if os.name == "nt":
        return True
    kept = not status.st_mode & stat.S_IWOTH or bool(
        stat.S_ISDIR(status.st_mode) and status.st_mode & stat.S_ISVTX
    )
    owner = getattr(os, "geteuid", lambda: status.st_uid)()
    return status.st_uid in (0, owner) and kept


@contextmanager
def own_cache() -> Iterator[str]:
    """Context manager around a command: yields "", or a remark if the cache folder is not of this
    user alone and an empty one takes its place."""
    try:
        cache_folder("sumo")
        cache_folder("roads")
    except ForeignCache as error:
        before = os.environ.get("XOSC_CACHE_DIR")
        with TemporaryDirectory(prefix="xosc-cache-") as folder:
            os.environ["XOSC_CACHE_DIR"] = folder
            try:
                yield f"{error}; this time an empty one is used"
            finally:
                del os.environ["XOSC_CACHE_DIR"]
                os.environ |= {"XOSC_CACHE_DIR": before} if before is not None else {}
    else:
        yield ""


POINTER = b"version https://git-lfs.github.com/spec/"
"""Beginning of the small file that Git has in the place of a large one until `git lfs pull` brings
that"""
LONGEST_POINTER = 1024
"""Bytes; the limit of Git LFS's specification"""


def alike(path: Path) -> str:
    """Question for the most similar name of a scenario or road beside a missing one, or of a
    folder where that has no ending or is missing itself; empty without one.
    """
    if not path.parent.exists():
        return alike(path.parent)
    # Strangers learn no names of files; files that commands write are missing often, and asked for.
    endings = (".xosc", ".xodr")
    folders = not path.suffix
    if current().untrusted or not (folders or most_similar(path.suffix, endings)):
        return ""
    kinds = (path.suffix,) if path.suffix in endings else endings
    try:
        files = (
            other
            for other in path.parent.iterdir()
            if other.suffix in kinds or (folders and other.is_dir())
        )
        beside = {other.stem: other.name for other in files if other.exists()}
    except OSError:
        return ""
    # Endings are alike in all names, and would make each of them similar.
    nearest = most_similar(path.stem, sorted(beside))
    return nearest and f"; did you mean {beside[nearest]!r}?"


def read_bytes(path: Path) -> bytes:
    """The content of a file that may be anything, a device without an end included.

    Raises:
        InvalidFile: it is missing, no regular file, larger than `MAX_BYTES`, or a pointer of Git
            LFS; or the policy in force refuses it.
    """
    current().admit(path)
    most = min(MAX_BYTES, current().max_bytes or MAX_BYTES)
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode) and not os.access(path, os.R_OK | os.X_OK):
            raise InvalidFile("the folder can't be read", path=path)
        if stat.S_ISDIR(status.st_mode):
            raise InvalidFile("this is a folder, a file is expected", path=path)
        if not stat.S_ISREG(status.st_mode):
            raise InvalidFile("this is not a regular file", path=path)
        if status.st_size > most:
            raise InvalidFile(
                f"the file has {status.st_size} bytes, at most {most} are read", path=path
            )
        # A file of /proc has no size, and reading it may never end.
        content = path.read_bytes() if status.st_size else b""
    except FileNotFoundError:
        raise InvalidFile(f"no such file{alike(path)}", path=path) from None
    except (OSError, ValueError) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise InvalidFile(f"the file can't be read: {reason}", path=path) from None
    if content.startswith(POINTER):
        raise InvalidFile("this is a pointer of Git LFS: 'git lfs pull' brings the file", path=path)
    return content


EXPANSION, LEAST_TABLE, LARGEST_TABLE = 100, 64 * 1024 * 1024, 2 * 1024**3
"""Times its own size to which a table may expand, and the bytes that every table and no table may
take"""


def read_parquet(path: str | PathLike[str], columns: Sequence[str] | None = None) -> pa.Table:
    """Return columns of a Parquet file, after its metadata has shown that they are of a sensible
    size.

    Texts are read as dictionaries first: a page of some kilobytes may stand for a million rows.

    Args:
        columns: names of those wanted; all by default.

    Raises:
        InvalidFile: they expand to much more than the file.
        OSError, ValueError, pyarrow.ArrowException: it can't be read.
        MemoryError: there is not enough memory for them.
    """
    import pyarrow as pa
    import pyarrow.compute as pc
    import pyarrow.parquet as pq

    path = Path(path)
    limit = min(max(LEAST_TABLE, EXPANSION * path.stat().st_size), LARGEST_TABLE)
    try:
        schema = pq.read_schema(path)
        wanted = [name for name in schema.names if columns is None or name in columns]
        texts = [name for name in wanted if _is_text(schema.field(name).type)]
        with pq.ParquetFile(path, read_dictionary=texts) as file:
            _check_metadata(file.metadata, schema, wanted, limit, path)
            table = file.read(columns if columns is None else list(columns))
        for name in texts:
            for chunk in table[name].chunks:
                lengths = pc.take(pc.binary_length(chunk.dictionary), chunk.indices)
                _check_expansion(pc.sum(lengths).as_py() or 0, limit, path)
        return table.cast(
            pa.schema([schema.field(name) for name in table.column_names], schema.metadata)
        )
    except pa.ArrowMemoryError as error:
        raise MemoryError(str(error)) from None
    except KeyError as error:
        raise ValueError(f"its schema is not that of its columns: {error.args[0]}") from None


def _check_metadata(
    about: pq.FileMetaData, schema: pa.Schema, wanted: Sequence[str], limit: int, path: Path
) -> None:
    """Refuse a Parquet file if its metadata announces more than the limit for the wanted columns.

    Row groups are read first: pyarrow ends the process where the metadata of a column is damaged.
    That of columns is read only if the groups exceed the limit, to which unwanted columns
    contribute, and for lists: a group counts rows, not values of lists.
    """
    import pyarrow as pa

    groups = [about.row_group(i) for i in range(about.num_row_groups)]
    whole = sum(
        # A column of one repeated value takes a few bytes for any number of rows: rows count as
        # well.
        max(8 * about.num_columns * group.num_rows, group.total_byte_size)
        for group in groups
    )
    if whole <= limit and not any(pa.types.is_nested(schema.field(name).type) for name in wanted):
        return
    chunks = [group.column(i) for group in groups for i in range(about.num_columns)]
    chosen = [chunk for chunk in chunks if chunk.path_in_schema.split(".")[0] in wanted]
    _check_expansion(
        sum(max(8 * chunk.num_values, chunk.total_uncompressed_size) for chunk in chosen),
        limit,
        path,
    )


def read_feather(path: str | PathLike[str], columns: Sequence[str] | None = None) -> pa.Table:
    """Return columns of a Feather file (Arrow IPC), after its buffers have shown that they expand
    to a sensible size.

    Messages are read in their order, and the footer, which could name others, is not. All values
    are checked: Arrow follows offsets of texts without looking where they lead.

    Args:
        columns: names of those wanted; all by default.

    Raises:
        InvalidFile: they expand to much more than the file.
        OSError, ValueError, pyarrow.ArrowException: it can't be read.
        MemoryError: there is not enough memory for them.
    """
    import pyarrow as pa

    path = Path(path)
    content = pa.py_buffer(read_bytes(path))
    if content.slice(0, len(_ARROW)).to_pybytes() != _ARROW:
        raise ValueError("not an Arrow file")
    messages = content.slice(len(_ARROW))
    limit = min(max(LEAST_TABLE, EXPANSION * content.size), LARGEST_TABLE)
    try:
        _check_expansion(
            sum(map(_expanded, pa.ipc.MessageReader.open_stream(messages))), limit, path
        )
        with pa.ipc.open_stream(
            messages, options=pa.ipc.IpcReadOptions(use_threads=False)
        ) as stream:
            table = stream.read_all()
        table.validate(full=True)
        return table if columns is None else table.select(list(columns))
    except pa.ArrowMemoryError as error:
        raise MemoryError(str(error)) from None
    except (KeyError, IndexError, struct.error) as error:
        raise ValueError(str(error.args[0])) from None


_ARROW = b"ARROW1\0\0"


def _expanded(message: pa.Message) -> int:
    """Bytes that a message of Arrow IPC takes, once decompressed: of its buffers, and 8 for each
    row, as a column may have none.

    Source: Arrow's `Message.fbs`: a message's header is a batch, or holds one for a dictionary; a
    compressed buffer begins with its length, -1 where it is stored as it is.
    """
    if message.type == "schema":
        return 0
    data, body = message.metadata.to_pybytes(), message.body

    def number(kind: str, at: int) -> int:
        return int(struct.unpack_from(f"<{kind}", data, at)[0])

    def field(table: int, index: int) -> int:
        """Place of a field of a table; 0 without it."""
        # Flatbuffers: a table begins with the signed distance back to its vtable, in which the size
        # and then the offset of each field are 16-bit numbers; an absent field has 0, or is beyond
        # the size.
        offsets = table - number("i", table)
        there = 4 + 2 * index < number("H", offsets)
        place = number("H", offsets + 4 + 2 * index) if there else 0
        return table + place if place else 0

    def target(place: int) -> int:
        return place + number("I", place)

    # Numbers of fields by Message.fbs: Message.header 2; DictionaryBatch.data 1; RecordBatch.length
    # 0, .buffers 2, .compression 3.
    header = target(field(target(0), 2))
    batch = target(field(header, 1)) if message.type == "dictionary" else header
    rows, buffers, compressed = field(batch, 0), field(batch, 2), bool(field(batch, 3))
    total = 8 * max(number("q", rows), 0) if rows else 0
    if not buffers:
        return total
    # A vector of Buffer structs: its length in 4 bytes, then 16 bytes each (offset, size).
    for place in range(
        target(buffers) + 4, target(buffers) + 4 + 16 * number("I", target(buffers)), 16
    ):
        start, size = number("q", place), number("q", place + 8)
        expanded = -1
        if compressed and size >= 8:
            expanded = int.from_bytes(body.slice(start, 8).to_pybytes(), "little", signed=True)
        total += size if expanded == -1 else max(expanded, 0)
    return total


def _is_text(kind: pa.DataType) -> bool:
    import pyarrow as pa

    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind))


def _check_expansion(size: int, limit: int, path: Path) -> None:
    if size > limit:
        raise InvalidFile(
            f"the table expands to {size} bytes, at most {limit} are read of a file of this size",
            path=path,
        )


_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")


def is_url(place: str | PathLike[str]) -> bool:
    """Whether a place is a URL, as `s3://bucket/folder`; a drive of Windows is none."""
    return _URL.match(str(place)) is not None


@contextmanager
def _reached(what: str, place: str) -> Iterator[None]:
    """Context manager that makes errors of a file system into ones that name the place.

    Raises:
        NotWritten: it can't be read or written.
    """
    import pyarrow as pa

    try:
        yield
    except (OSError, pa.ArrowException) as error:
        raise NotWritten(f"{what}: {reason_of(error)}", path=place) from None


class FileSystemPath(NamedTuple):
    """A folder on any file system that pyarrow reaches.

    Attributes:
        place: folder or URL, as given.
        system: file system.
        root: the folder in it.
    """

    place: str
    system: Any
    root: str

    @classmethod
    def of(cls, place: str) -> FileSystemPath:
        """Return the folder that a path or a URL names.

        Raises:
            UsageError: no file system has such a URL, or --untrusted.
        """
        import pyarrow as pa
        from pyarrow import fs

        if not is_url(place):
            return cls(place, fs.LocalFileSystem(), os.path.abspath(place))
        if current().untrusted:
            raise UsageError("--untrusted reaches no other machine; give a folder", path=place)
        try:
            system, root = fs.FileSystem.from_uri(place)
        except (OSError, ValueError, TypeError, pa.ArrowException) as error:
            told = f"no file system has this URL (file, s3, gs, abfs, hdfs): {reason_of(error)}"
            raise UsageError(told, path=place) from None
        return cls(place, system, root)

    def read(self, name: str) -> bytes | None:
        """Content of a file; None where there is none."""
        from pyarrow import fs

        with _reached("this can't be read", self.place):
            if self.system.get_file_info(f"{self.root}/{name}").type != fs.FileType.File:
                return None
            with self.system.open_input_stream(f"{self.root}/{name}") as file:
                return bytes(file.read())

    def write(self, name: str, content: bytes) -> None:
        """Write a file, whole or not at all.

        Raises:
            NotWritten: it can't be written.
        """
        from pyarrow import fs

        path = f"{self.root}/{name}"
        if isinstance(self.system, fs.LocalFileSystem):
            with writing("this", Path(path)):
                keep(content, Path(path))
            return
        with _reached("this can't be written", self.place):
            self.system.create_dir(path.rpartition("/")[0], recursive=True)
            with self.system.open_output_stream(path) as file:
                file.write(content)

    def files(self, folder: str) -> list[str]:
        """Names of all files below a folder, relative to the root, in order."""
        from pyarrow import fs

        chosen = fs.FileSelector(f"{self.root}/{folder}", allow_not_found=True, recursive=True)
        with _reached("this can't be read", self.place):
            infos = self.system.get_file_info(chosen)
        names = [one.path for one in infos if one.type == fs.FileType.File]
        return sorted(name.removeprefix(self.root).lstrip("/") for name in names)

    def remove(self, name: str) -> None:
        """Remove a file."""
        with _reached("this can't be removed", self.place):
            self.system.delete_file(f"{self.root}/{name}")

    def dataset(self, folder: str, partitions: Sequence[str] = ()) -> ds.Dataset:
        """Return the Parquet files below a folder as one table, which is read when it is asked.

        Args:
            partitions: columns of texts in the names of folders, `name=value`.

        Raises:
            InvalidFile: a file is not readable.
        """
        import pyarrow as pa
        import pyarrow.dataset as ds

        parts = ds.partitioning(
            pa.schema([(name, pa.string()) for name in partitions]), None, "hive"
        )
        names = [f"{self.root}/{name}" for name in self.files(folder) if name.endswith(".parquet")]
        try:
            return ds.dataset(
                names, None, "parquet", self.system, parts, partition_base_dir=self.root
            )
        except (OSError, ValueError, TypeError, pa.ArrowException) as error:
            raise InvalidFile(
                f"not readable as Parquet: {reason_of(error)}", path=self.place
            ) from None


def search_path(folders: Sequence[str | PathLike[str]], variable: str) -> list[Path]:
    """Folders that were asked for: these, then those of an environment variable, separated as in
    PATH."""
    return [
        Path(folder)
        for folder in (*folders, *filter(None, os.environ.get(variable, "").split(os.pathsep)))
    ]


def similar_file(named: Path, *folders: Path) -> str:
    """Question for the most similar name of a file with the same ending that is in the folder of a
    file or in others, with a blank after it; empty where none is, or there is no ending."""
    ending, names = named.suffix, set[str]()
    for folder in (named.parent, *folders) if ending else ():
        with suppress(OSError, ValueError):
            names |= {name for name in os.listdir(folder) if name.endswith(ending)}
    return guess(named.name, sorted(names))


def in_any_case(path: Path) -> Path | None:
    """Return the only file or folder that matches a path without regard to case, as on Windows;
    else None."""
    spelt = Path(path.anchor)
    for part in path.parts[bool(path.anchor) :]:
        if not os.path.exists(spelt / part):  # unlike that of Path it takes names of any length
            try:
                alike = [name for name in os.listdir(spelt) if name.lower() == part.lower()]
            except (OSError, ValueError):
                return None
            if len(alike) != 1:
                return None
            part = alike[0]
        spelt /= part
    return spelt if current().allows(spelt) else None


def above(path: Path, file: Path) -> Iterator[Path]:
    """Yield a relative path of a file, resolved in the file's folder and in each folder above.

    Steps upwards and placeholders that no tool has filled in (`${ROOT}/roads/town.xodr`) are left
    out.
    """
    if path.is_relative_to(file.parent):
        below = [
            part
            for part in path.relative_to(file.parent).parts
            if part != ".." and not part.startswith("${")
        ]
        yield from (folder.joinpath(*below) for folder in Path(os.path.abspath(file)).parents)


_ENDING = 2.0
"""Time (s) that the workers of a process that was killed have to notice it and to end"""

_SYNCED = 16
"""Files that are synced at a time"""
LOCK = ".lock"
"""Name of the file by which `alone` keeps others out"""
DRAFT = ".draft-"
"""Beginning of the names of files and folders that are being written; a killed process leaves them.
"""
Stamp = tuple[int, int]
"""Modification time in nanoseconds and size in bytes; a file has changed if either differs."""


def stamp(path: str | PathLike[str]) -> Stamp:
    """The stamp of a file; zeros where there is none."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return (0, 0)
    return (status.st_mtime_ns, status.st_size)


def read_object(path: Path, remedy: str = "") -> dict[str, Any]:
    """The object that a JSON file holds.

    Args:
        remedy: what can be done about a file that holds none.

    Raises:
        InvalidFile: it can't be read, is not JSON, or holds something else.
    """
    return parse_object(read_bytes(path), path, remedy=remedy)


def parse_object(
    content: bytes, path: Path, line: int | None = None, remedy: str = ""
) -> dict[str, Any]:
    """The object that a JSON text holds.

    Args:
        path, line: what errors name; by default the line of the defect.
        remedy: as in `read_object`.

    Raises:
        InvalidFile: it is not JSON, or holds something else.
    """
    try:
        parsed = json.loads(content)
        reason = "a JSON object is expected"
    except json.JSONDecodeError as error:
        parsed, line, reason = None, line or error.lineno, f"not readable as JSON: {error.msg}"
    except (ValueError, RecursionError) as error:
        parsed, reason = None, f"not readable as JSON: {error}"
    if not isinstance(parsed, dict):
        raise InvalidFile("; ".join(filter(None, (reason, remedy))), path=path, line=line)
    return parsed


def write_object(values: Mapping[str, Any], path: Path) -> None:
    """Write a JSON object, whole or not at all and on the disk (see `keep`). Numbers must be
    finite.

    Raises:
        UsageError: the file can't be written.
    """
    text = json.dumps(values, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    with writing("this", path):
        # Bytes of file names that are no UTF-8 are surrogates here; `\udcff` is JSON for one.
        keep(text.encode(errors="backslashreplace"), path, durable=True)


def check_settings(path: Path, settings: Mapping[str, Any], what: str) -> None:
    """Refuse to go on with work that was begun with other settings; fine where none was begun.

    Resumable work first compares its settings with stored ones, then stores them by `write_object`.

    Args:
        path: the file beside the work that holds its settings.
        settings: JSON-able; all that decides what the work finds, or a part of it.
        what: the work, for the message: "a batch".

    Raises:
        UsageError: the work has other settings, which are named, or they are not readable.
    """
    if not path.exists():
        return
    try:
        before = read_object(path)
    except InvalidFile as error:
        raise UsageError(
            f"the settings of {what} in this folder can't be read: {error.message}", path=path
        ) from None
    # As the stored settings are after reading: tuples become lists, and keys texts.
    mine = json.loads(json.dumps(settings))
    changed = [name for name, value in mine.items() if name not in before or before[name] != value]
    if changed:
        reason = (
            f"this folder holds {what} with other settings ({', '.join(changed)}): give the same, "
            "or another folder"
        )
        raise UsageError(reason, path=path.parent)


@contextmanager
def writing(what: str, path: Path) -> Iterator[None]:
    """Context manager that makes errors of writing into ones that name the path.

    Raises:
        NotWritten: it can't be written.
    """
    try:
        yield
    except OSError as error:
        raise NotWritten(f"{what} can't be written: {error.strerror or error}", path=path) from None


@contextmanager
def alone(folder: Path, what: str) -> Iterator[None]:
    """Context manager around work that one process at a time may do in a folder, which is made; a
    hidden lock file stays in it.

    Args:
        what: the work, for the message: "a batch".

    Raises:
        UsageError: another process does it, or the folder can't be written into.
    """
    from filelock import FileLock, Timeout  # a twentieth of what a plain run imports

    with writing("the folder", folder):
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(folder / LOCK, timeout=_ENDING)
        try:
            lock.acquire()
        except Timeout:
            raise UsageError(
                f"{what} of another process writes into this folder: wait for it, or give another",
                path=folder,
            ) from None
    try:
        yield
    finally:
        lock.release()


def keep(content: bytes, path: Path, durable: bool = False) -> Path:
    """Write a file whole or not at all, safe against concurrent writers of the same content; skip a
    file with that content.

    A file that another user may change is replaced in any case. A new file gets the permissions
    that the user's umask leaves.

    Args:
        durable: return when it is on the disk, so that it is also there after a power cut.

    Raises:
        OSError: the file can't be written.
    """
    if not path.is_file() or not is_own(path) or path.read_bytes() != content:
        try:
            with drafted(path) as draft:
                draft.write_bytes(content)
        except PermissionError:
            # Windows replaces no file that is open: another writer of the same content was first.
            if not path.is_file() or path.read_bytes() != content:
                raise
    if durable:
        sync([path, path.parent])
    return path


@contextmanager
def drafted(path: Path) -> Iterator[Path]:
    """Yield a draft path to write to, which is renamed to the path at the end; after an error
    neither is there.

    The folder of the file is made.

    The content is on the disk before the name is: a power cut leaves no file that is empty or in
    part. Devices and pipes have nothing to be replaced: they are written directly.

    Raises:
        OSError: the file can't be put in its place.
    """
    if _is_special(path):
        yield path
        return
    if not path.parent.exists():  # else a file in the place of the folder is said to exist
        path.parent.mkdir(parents=True, exist_ok=True)
    # Not by tempfile, whose files only their owner may read.
    draft = path.with_name(f"{DRAFT}{secrets.token_hex(4)}{path.suffix}")
    try:
        yield draft
        _sync(draft)
        draft.replace(path)
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)


def check_writable(path: Path, what: str) -> None:
    """Refuse a path to which no file can be written, before any work for it.

    Raises:
        NotWritten: it can't be.
        UsageError: it is that of a scenario or a road, which it would replace.
    """
    if path.suffix.lower() in (".xosc", ".xodr") and path.exists():
        raise UsageError(f"{what} would replace a scenario or a road: name another", path=path)
    with writing(what, path):
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if _is_special(path):
            return
        if not path.parent.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
        if path.exists():
            path.open("a").close()
        elif not path.parent.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
        elif not os.access(path.parent, os.W_OK):  # a file made to try might not go away again
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


def _is_special(path: Path) -> bool:
    """Whether a path is a device, a pipe, or the open stream of a process (/dev/stdout)."""
    folder = f"{os.path.realpath(path.parent)}/"
    opened = folder.startswith(("/dev/", "/proc/")) and not folder.startswith("/dev/shm/")  # noqa: S108  # a disk in memory
    opened = opened and os.path.isdir(folder)  # /dev/null/report.xml is none
    return opened or not (path.is_file() or path.is_dir() or not os.path.exists(path))


def sync(paths: Iterable[Path]) -> None:
    """Return when the contents of files, and the names in folders, are on the disk.

    Many are synced together: a disk takes them in little more time than one.

    Raises:
        OSError: one can't be.
    """
    with ThreadPoolExecutor(_SYNCED) as pool:
        list(pool.map(_sync, paths))


def _sync(path: Path) -> None:
    if os.name == "nt" and path.is_dir():
        return  # Windows opens no folders, and writes their names at once
    file = os.open(path, os.O_RDWR if os.name == "nt" else os.O_RDONLY)
    try:
        os.fsync(file)
    finally:
        os.close(file)


def digest(content: bytes) -> str:
    """Short name of a content, which differs for other content."""
    return hashlib.blake2b(content, digest_size=6).hexdigest()


def fingerprint(content: bytes) -> str:
    """Digest of a content; no other content with it can be made (BLAKE2b, 160 bits)."""
    return hashlib.blake2b(content, digest_size=20).hexdigest()


_SEAL = b', "digest": "%s"}'


class JournalRecords(NamedTuple):
    """Records of a file, and the numbers (from 1) of its lines that are damaged."""

    records: list[dict[str, Any]]
    damaged: list[int]


class Records:
    """A file of JSON objects, a line each. For one process at a time (see `alone`).

    Each line ends with the digest of what is before it. So a line that a full disk or a power cut
    left in part, or that was edited, is detected, and the others still count. What `add` has
    returned from is on the disk.

        records = Records(out / "runs.jsonl")
        for record in records.read().records: ...
        records.add([{"name": "a", "passed": True}])

    Args:
        path: the file; absent until something is added.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def read(self) -> JournalRecords:
        """The records that are whole, in their order.

        Raises:
            OSError: the file is there and can't be read.
        """
        kept = JournalRecords([], [])
        for number, record in enumerate(self, 1):
            if record is None:
                kept.damaged.append(number)
            else:
                kept.records.append(record)
        return kept

    def __iter__(self) -> Iterator[dict[str, Any] | None]:
        """Yield the record of each line, None where it is damaged, with one in memory at a time;
        errors as of `read`."""
        with suppress(FileNotFoundError), self.path.open("rb") as file:
            for line in file:
                yield _opened(line.removesuffix(b"\n"))

    def add(self, records: Iterable[Mapping[str, Any]]) -> None:
        """Add records after the others. Numbers must be finite.

        Raises:
            OSError: they can't be written: none of them is kept.
        """
        content = b"".join(map(_sealed, records))
        is_new = not self.path.exists()
        binary = getattr(os, "O_BINARY", 0)  # else Windows makes two bytes of the end of a line
        file = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | binary, 0o666)
        try:
            before = os.fstat(file).st_size
            try:
                # A short write means a full disk. A part of a line must not stay: the next one
                # would be joined to it.
                if os.write(file, content) < len(content):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self.path))
                os.fsync(file)
            except OSError:
                with suppress(OSError):
                    os.ftruncate(file, before)
                raise
        finally:
            os.close(file)
        # The name of a new file is on the disk only when its folder is synced.
        if is_new:
            sync([self.path.parent])

    def replace(self, records: Iterable[Mapping[str, Any]]) -> None:
        """Put records in the place of all that there are, whole or not at all.

        Raises:
            OSError: they can't be written.
        """
        with drafted(self.path) as draft, draft.open("wb") as file:
            file.writelines(map(_sealed, records))
        sync([self.path, self.path.parent])

    def sort(self, name: Callable[[dict[str, Any]], str | None]) -> None:
        """Put the lines in the order of names of their records, which alone are in memory.

        Args:
            name: of a record; None for one that is left out. Of several with one name the last
                stays. Damaged lines are left out.

        Raises:
            OSError: they can't be written: the file stays as it is.
        """
        if not self.path.exists():
            return
        lines, place, places = 0, 0, dict[str, int]()
        with self.path.open("rb") as file:
            for line in file:
                record = _opened(line.removesuffix(b"\n"))
                if record is not None and (own := name(record)) is not None:
                    places[own] = place
                lines, place = lines + 1, place + len(line)
        ordered = [places[own] for own in sorted(places)]
        if len(ordered) == lines and ordered == sorted(ordered):
            return
        # Closed before the draft takes the file's place: Windows replaces none that is open.
        with drafted(self.path) as draft, self.path.open("rb") as file, draft.open("wb") as to:
            for place in ordered:
                file.seek(place)
                to.write(file.readline())
        sync([self.path, self.path.parent])


def _sealed(record: Mapping[str, Any]) -> bytes:
    content = json.dumps(record, allow_nan=False).encode()[:-1]
    return content + _SEAL % digest(content).encode() + b"\n"


def _opened(line: bytes) -> dict[str, Any] | None:
    """The record of a line; None where it is damaged."""
    # All seals have one length: the content before it is found without parsing.
    content = line[: -len(_SEAL % digest(b"").encode())]
    if not line or line != content + _SEAL % digest(content).encode():
        return None
    try:
        record = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(record, dict):
        return None
    record.pop("digest")
    return record
