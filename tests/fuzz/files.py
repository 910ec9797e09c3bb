"""Changes of CSV, JSON, Parquet, npy, safetensors and zip by what these formats are made of; of
other files by their bytes.
"""

from __future__ import annotations

import csv
import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

from tests.fuzz.standard import FORGED, NUMBERS

_CELLS = (
    "",
    " ",
    "nan",
    "inf",
    "-inf",
    "1.0",
    "1_0",
    "true",
    "None",
    "1,5",
    "2^31",
    "１",
    '"',
    *NUMBERS,
    *FORGED,
)
_MOST_ROWS = 30_000


def damage(path: Path, random: Random) -> str:
    """Change a file by its kind, or one in five times by its bytes alone; in
    words, what was done.
    """
    change = _BYTES if random.random() < 0.2 else _CHANGES.get(path.suffix, _BYTES)
    made = random.choice(change)
    data = path.read_bytes()
    try:
        path.write_bytes(made(data, random))
    except (
        ValueError,
        KeyError,
        IndexError,
        struct.error,
        zipfile.BadZipFile,
        zlib.error,
        csv.Error,
        NotImplementedError,
        RecursionError,
    ):  # it was damaged before
        made = _flip
        path.write_bytes(_flip(data, random))
    return f"{path.name}: {made.__name__.strip('_')}"


# bytes ----------------------------------------------------------------------------------------


def _flip(data: bytes, random: Random) -> bytes:
    changed = bytearray(data)
    for _ in range(random.choice((1, 1, 4, 40)) if changed else 0):
        changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
    return bytes(changed)


def _cut(data: bytes, random: Random) -> bytes:
    return data[: random.randrange(len(data) + 1)]


def _repeat(data: bytes, random: Random) -> bytes:
    start, end = sorted(random.randrange(len(data) + 1) for _ in range(2))
    return data[:end] + data[start:end] * random.choice((1, 1, 20)) + data[end:]


def _overwrite(data: bytes, random: Random) -> bytes:
    what = random.choice(
        (
            b"\xff" * 8,
            b"\0" * 8,
            b"\x7f\xff\xff\xff",
            b"\xff\xff\xff\x7f",
            random.randbytes(16),
            b"\n",
            b'"',
            b",",
        )
    )
    at = random.randrange(len(data) + 1)
    return data[:at] + what + data[at + len(what) :]


def _at_the_ends(data: bytes, random: Random) -> bytes:
    """Headers and footers are where formats keep sizes and places."""
    at = random.randrange(min(len(data), 64) or 1)
    at = at if random.random() < 0.5 else len(data) - 1 - at
    return data[:at] + random.randbytes(1) + data[at + 1 :] if data else b"\0"


def _nothing(data: bytes, random: Random) -> bytes:
    return random.choice(
        (b"", b"\n", b"\0" * 100, random.randbytes(300), b"PK\x05\x06" + b"\0" * 18, b"PAR1PAR1")
    )


# CSV ------------------------------------------------------------------------------------------


def _rows(data: bytes) -> list[list[str]]:
    rows = list(csv.reader(io.StringIO(data.decode("utf-8", "replace"), newline="")))
    if not rows or not rows[0]:
        raise ValueError("no rows")
    return rows


def _written(rows: list[list[str]]) -> bytes:
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode("utf-8", "surrogatepass")


def _cells(data: bytes, random: Random) -> bytes:
    """Values of a column, in some rows or all of them."""
    rows = _rows(data)
    column, value, share = (
        random.randrange(len(rows[0])),
        random.choice(_CELLS),
        random.choice((0.02, 0.3, 1.0)),
    )
    for row in rows[1:]:
        if column < len(row) and random.random() < share:
            row[column] = value if random.random() < 0.8 else random.choice(_CELLS)
    return _written(rows)


def _arithmetic(data: bytes, random: Random) -> bytes:
    """Numbers of a column moved, scaled or turned about: jumps in time and
    space, other ids, huge ranges.
    """
    rows = _rows(data)
    column, factor, shift = (
        random.randrange(len(rows[0])),
        random.choice((-1, 0, 1e3, 1e-3, 1e9)),
        random.choice((0, 1, -1e6, 1e9, 1e15)),
    )
    first = random.randrange(len(rows))
    for row in rows[first:]:
        try:
            row[column] = f"{float(row[column]) * factor + shift:.17g}"
        except (ValueError, IndexError):
            continue
    return _written(rows)


def _columns(data: bytes, random: Random) -> bytes:
    """A column dropped, doubled, renamed or moved; a thousand more."""
    rows, what = _rows(data), random.randrange(5)
    column = random.randrange(len(rows[0]))
    for number, row in enumerate(rows):
        if column < len(row):
            if what == 0:
                del row[column]
            elif what == 1:
                row.append(row[column])
            elif what == 2 and number == 0:
                row[column] = random.choice((*_CELLS, row[column].upper(), row[column] + " "))
            elif what == 3:
                row.insert(0, row.pop(column))
            elif what == 4:
                row += [f"more{k}" if number == 0 else "1" for k in range(1000)]
    return _written(rows)


def _lines(data: bytes, random: Random) -> bytes:
    """Rows dropped, repeated, shuffled, shortened, lengthened."""
    rows, what = _rows(data), random.randrange(6)
    at = random.randrange(len(rows))
    if what == 0:
        rows[at : at + random.choice((1, 5, len(rows)))] = []
    elif what == 1:
        rows += rows[1:] * random.choice((1, 3))
    elif what == 2:
        rows[1:] = random.sample(rows[1:], len(rows) - 1)
    elif what == 3:
        rows[at] = rows[at][: random.randrange(len(rows[at]) + 1)]
    elif what == 4:
        rows[at] += ["1"] * random.choice((1, 5000))
    else:
        rows += (rows[1:] * (_MOST_ROWS // max(len(rows) - 1, 1)))[
            : _MOST_ROWS if random.random() < 0.05 else 300
        ]
    return _written(rows)


def _as_text(data: bytes, random: Random) -> bytes:
    """Another separator, encoding, line end or quotation."""
    text = data.decode("utf-8", "replace")
    at = random.randrange(len(text) + 1)
    return random.choice((
        lambda: text.replace(",", ";").encode(), lambda: text.encode("utf-16"),
        lambda: b"\xef\xbb\xbf" + text.encode(),
        lambda: text.replace("\n", "\r").encode(), lambda: (text[:at] + '"' + text[at:]).encode(),
        lambda: (text[:at] + "x" * 200_000 + text[at:]).encode(),
        lambda: (text[:at] + "\0" + text[at:]).encode(),
    ))()  # fmt: skip


# JSON -----------------------------------------------------------------------------------------

_WILD: tuple[Any, ...] = (
    *(
        None,
        True,
        -1,
        0,
        1.5,
        1e308,
        10**400,
        float("nan"),
        float("inf"),
        "",
        [],
        {},
        [[]],
        {"a": 1},
        [None],
        2**63,
        -(2**63),
    ),
    *("/etc/passwd", "../../x", "/dev/zero", *FORGED),
)


def _json_value(data: bytes, random: Random) -> bytes:
    """A value of another type, a key without one, or a value deeper than readers
    go, in a line of JSON or a whole file.
    """
    lines = data.splitlines() if _is_lines(data) else [data]
    at = random.randrange(len(lines))
    values = json.loads(lines[at])
    holders = list(_holders(values))
    if holders and random.random() < 0.95:
        holder, key = random.choice(holders)
        if random.random() < 0.15:
            del holder[key]
        else:
            holder[key] = (
                random.choice(_WILD)
                if random.random() < 0.95
                else [holder[key]] * random.choice((2, 1000))
            )
    else:
        values = random.choice((*_WILD, [values]))
    lines[at] = json.dumps(values).encode()
    if random.random() < 0.02:
        lines[at] = b"[" * 100_000
    return b"\n".join(lines) + b"\n"


def _is_lines(data: bytes) -> bool:
    try:
        json.loads(data)
    except ValueError:
        return True
    return False


def _holders(value: Any) -> Any:
    pairs = (
        list(value.items())
        if isinstance(value, dict)
        else list(enumerate(value))
        if isinstance(value, list)
        else []
    )
    for key, inner in pairs:
        yield value, key
        yield from _holders(inner)


# Parquet --------------------------------------------------------------------------------------


def _parquet(data: bytes, random: Random) -> bytes:
    """A column of another type, with other values, dropped, renamed or doubled;
    no rows; more rows than bytes.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(io.BytesIO(data))
        at = random.randrange(table.num_columns)
        name, count, what = table.column_names[at], table.num_rows, random.randrange(8)
        if what == 0:
            table = table.drop_columns([name])
        elif what == 1:
            table = table.rename_columns(
                [
                    random.choice(FORGED) if k == at else each
                    for k, each in enumerate(table.column_names)
                ]
            )
        elif what == 2:
            table = table.append_column(name, table.column(at))
        elif what == 3:
            table = table.slice(0, random.choice((0, 1)))
        elif what == 4:
            column = table.column(at).to_pylist()
            wild = (
                [None, float("nan"), float("inf"), 1e308, -1e308, 0.0, 1e18]
                if pa.types.is_floating(table.column(at).type)
                else [None]
            )
            wild = (
                [None, "", "\x1b[31m", "x" * 70_000, *FORGED]
                if pa.types.is_string(table.column(at).type)
                else wild
            )
            column = [random.choice(wild) if random.random() < 0.3 else each for each in column]
            table = table.set_column(at, name, pa.array(column, table.column(at).type))
        elif what == 5:
            other = random.choice((
                pa.array(["x"] * count), pa.array([[1.0]] * count), pa.array([{"a": 1}] * count),
                pa.nulls(count),
                pa.array([True] * count),
                pa.array([2**62] * count), pa.array([b"\xff"] * count),
                pa.array(["x"] * count).dictionary_encode(),
            ))  # fmt: skip
            table = table.set_column(at, name, other)
        elif what == 6:
            table = pa.concat_tables([table] * random.choice((2, 30)))
        else:
            many = count > 0 and random.random() < 0.03
            table = (
                pa.table(
                    {
                        each: pa.repeat(table.column(each)[0], 2_000_000)
                        for each in table.column_names
                    }
                )
                if many
                else table.slice(count // 2)
            )
        out = io.BytesIO()
        pq.write_table(table, out, compression=random.choice(("zstd", "snappy", "none")))
    except (pa.ArrowException, OSError, MemoryError) as error:
        raise ValueError(str(error)) from None
    return out.getvalue()


# npy, safetensors, zip ------------------------------------------------------------------------


def _npy(data: bytes, random: Random) -> bytes:
    """Another header: type, order, shape."""
    header = random.choice((
        "{'descr': '|O', 'fortran_order': False, 'shape': (3,), }",
        "{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999,), }",
        "{'descr': '<f8', 'fortran_order': True, 'shape': (-1, 4), }",
        "{'descr': '<f4', 'fortran_order': False, 'shape': (), }",
        "{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (1,), }",
        "{'descr': '<U99999999', 'fortran_order': 1, 'shape': (1,)}",
        "__import__('os').getcwd()", "{'shape': (" + "1," * 5000 + ")}", "{" * 5000,
    )).encode() + b"\n"  # fmt: skip
    return (
        data[:8]
        + struct.pack("<H", len(header) & 0xFFFF)
        + header
        + data[10 + struct.unpack("<H", data[8:10])[0] :]
    )


def _tensors(data: bytes, random: Random) -> bytes:
    """Another header: names, types, shapes and places of tensors, metadata; or
    other numbers in the tensors.
    """
    (size,) = struct.unpack("<Q", data[:8])
    header, body = json.loads(data[8 : 8 + size]), data[8 + size :]
    if random.random() < 0.3:
        body = bytearray(body)
        for _ in range(random.choice((1, 10))):
            at = random.randrange(max(len(body) - 4, 1)) & ~3
            body[at : at + 4] = random.choice(
                (b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\xff" * 4, random.randbytes(4))
            )
        return data[: 8 + size] + bytes(body[: len(data) - 8 - size])
    about = header.get("__metadata__", {}).get("about")
    if about and random.random() < 0.4:
        header["__metadata__"]["about"] = _json_value(about.encode(), random).decode().strip()
    else:
        holder, key = random.choice(list(_holders(header)))
        holder[key] = random.choice((*_WILD, 2**40, [2**40, 2**40], [0, 4], "F64", "I64", "BOOL"))
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text) if random.random() < 0.95 else 2**62) + text + body


def _zip(data: bytes, random: Random) -> bytes:
    """Members changed by their kinds, dropped, doubled, renamed; a bomb."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    name = (
        random.choice([each for each in members if each.endswith(".json")] or list(members))
        if random.random() < 0.6
        else random.choice(list(members))
    )
    what, out = random.randrange(6), io.BytesIO()
    if what < 3:
        members[name] = (
            _json_value if name.endswith(".json") else _npy if random.random() < 0.3 else _flip
        )(members[name], random)
    elif what == 3:
        del members[name]
    elif what == 4:
        members[random.choice(("../../x", "/tmp/x", "", "a" * 70_000))[:60_000]] = members[name]
    else:
        members[name] = b"\0" * random.choice((10_000_000, 60_000_000))
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for each, content in members.items():
            archive.writestr(each, content)
    return out.getvalue()


_Change = Callable[[bytes, Random], bytes]
_BYTES: tuple[_Change, ...] = (_flip, _cut, _repeat, _overwrite, _at_the_ends, _nothing)
_CHANGES: dict[str, tuple[_Change, ...]] = {
    ".csv": (_cells, _cells, _arithmetic, _arithmetic, _columns, _lines, _as_text),
    ".json": (_json_value,),
    ".jsonl": (_json_value,),
    ".parquet": (_parquet,),
    ".npy": (_npy, _flip),
    ".safetensors": (_tensors,),
}
