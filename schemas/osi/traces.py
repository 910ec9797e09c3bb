"""Traces of OSI messages, read from `.osi` and `.mcap` files with limits on every size that a file
declares.

Source: ASAM OSI 3.8, "OSI trace file formats"; MCAP format 0x30; the omega-prime specification for
maps in a channel. A trace has GroundTruth messages, or SensorView messages whose
`global_ground_truth` is read. Nothing is decompressed or parsed before its declared size has been
compared with the limits. Needs the extra `osi`.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from schemas.common.errors import InvalidFile, Unsupported
from schemas.common.packages import optional
from schemas.common.policy import current
from schemas.common.storage import MAX_BYTES

SUFFIXES = (".osi", ".mcap")
LONGEST = 32 * 1024 * 1024
"""Bytes of a message at most: parsed, a message takes many times its size"""
GROUND_TRUTH, SENSOR_VIEW = "GroundTruth", "SensorView"
TRACE = "net.asam.osi.trace"
"""Name of the metadata record that marks an OSI trace in MCAP"""
_PREFIX = "osi3."
_MAP = "osi3.MapAsamOpenDrive"
_KINDS = (
    GROUND_TRUTH, SENSOR_VIEW, "SensorData", "TrafficCommand", "TrafficUpdate",
    "TrafficCommandUpdate", "HostVehicleData", "MotionRequest", "StreamingUpdate",
    "SensorViewConfiguration",
)  # fmt: skip
"""Top-level messages, in the order of preference where several read the same bytes"""
_READABLE = 0.5
"""Least share of a message's bytes that a message type must know"""
_TRIED = 8
"""Messages by which the type of an `.osi` trace is recognised"""
_LENGTH = struct.Struct("<I")
_BLOCK = 1 << 20


class AttachedMap(NamedTuple):
    """An OpenDRIVE file inside a trace.

    name: of the attachment or the map reference. content: of the file. where: attachment or
    channel.
    """

    name: str
    content: bytes
    where: str


class Channel(NamedTuple):
    """A channel of a trace: its topic, message type, encodings, metadata and number of messages."""

    topic: str
    schema: str
    encoding: str
    message_encoding: str
    metadata: dict[str, str]
    messages: int


@dataclass
class Contents:
    """Contents of an MCAP file besides its messages.

    Attributes:
        channels: by their ids.
        metadata: metadata records by name, each as many times as it is there.
        maps: OpenDRIVE files.
        compressions: of its chunks.
        unchunked: messages outside of chunks.
        indexed: whether the summary has an index of every chunk.
    """

    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    maps: list[AttachedMap] = field(default_factory=list)
    compressions: set[str] = field(default_factory=set)
    unchunked: int = 0
    indexed: bool = True


class TraceMessage(NamedTuple):
    """One message of a trace: its number from 1, the GroundTruth in it, the message itself, its
    publish time in MCAP (ns)."""

    number: int
    truth: Any
    message: Any
    published: int | None = None


class Trace:
    """The ground truth of an OSI trace.

    Example:
        >>> for frame in Trace(Path("cut_in.osi")).frames():
        ...     print(frame.truth.timestamp.seconds, len(frame.truth.moving_object))
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.remarks: list[str] = []
        """what was assumed of the file, one sentence each"""

    @property
    def is_mcap(self) -> bool:
        """Whether the file is an MCAP file, by its name."""
        return self.path.suffix.lower() == ".mcap"

    @cached_property
    def contents(self) -> Contents:
        """Channels, metadata and maps of an MCAP file; nothing of an `.osi` file.

        Raises:
            InvalidFile: the file can't be read, or is damaged.
        """
        return _contents(self.path) if self.is_mcap else Contents()

    @cached_property
    def kind(self) -> str:
        """`GROUND_TRUTH` or `SENSOR_VIEW`.

        Raises:
            InvalidFile: the messages are of no known type, or there is none.
            Unsupported: they hold no ground truth.
        """
        if self.is_mcap:
            return self._channel[1].schema.removeprefix(_PREFIX)
        kind = _recognised(_single(self.path), self.path)
        if kind not in (GROUND_TRUTH, SENSOR_VIEW):
            raise Unsupported(
                f"this is a trace of {kind} messages: GroundTruth or SensorView is expected",
                path=self.path,
            )
        return kind

    @cached_property
    def _channel(self) -> tuple[int, Channel]:
        """The channel that is read: GroundTruth before SensorView, then the first topic by name."""
        channels = self.contents.channels
        for kind in (GROUND_TRUTH, SENSOR_VIEW):
            usable = sorted(
                (channel.topic, key)
                for key, channel in channels.items()
                if channel.schema == _PREFIX + kind
                and channel.messages
                and channel.message_encoding == "protobuf"
            )
            if len(usable) > 1:
                others = ", ".join(topic for topic, _ in usable[1:])
                self.remarks.append(
                    f"of {len(usable)} channels of {kind} {usable[0][0]} is read, without {others}"
                )
            if usable:
                return usable[0][1], channels[usable[0][1]]
        there = ", ".join(
            sorted({channel.schema or channel.message_encoding for channel in channels.values()})
        )
        what = f"; its channels have {there}" if there else ""
        raise Unsupported(
            f"no channel has messages of osi3.GroundTruth or osi3.SensorView{what}", path=self.path
        )

    def frames(self) -> Iterator[TraceMessage]:
        """The messages, one after the other, in the order of the file.

        Raises:
            InvalidFile: the file is truncated or damaged, a size is beyond the limits, or a message
                has no ground truth.
            Unsupported: its messages hold no ground truth.
        """
        kind = self.kind
        create = _message(kind)
        found = 0
        single = ((body, None) for body in _single(self.path)) if not self.is_mcap else ()
        bodies: Iterable[tuple[bytes, int | None]] = (
            _messages(self.path, self._channel[0]) if self.is_mcap else single
        )
        for found, (body, published) in enumerate(bodies, 1):
            message = parsed(create, body)
            if message is None:
                raise InvalidFile(
                    f"message {found} is no {kind}: it can't be parsed", path=self.path
                )
            if kind == SENSOR_VIEW and not message.HasField("global_ground_truth"):
                raise InvalidFile(
                    f"message {found}: a SensorView without global_ground_truth", path=self.path
                )
            yield TraceMessage(
                found,
                message.global_ground_truth if kind == SENSOR_VIEW else message,
                message,
                published,
            )
        if not found:
            raise InvalidFile("the trace has no message", path=self.path)


def parsed(create: Any, body: bytes) -> Any | None:
    """The message of some bytes; None where they are of no such message."""
    try:
        return create.FromString(body)
    except optional("google.protobuf.message").DecodeError:
        return None


def _message(kind: str) -> Any:
    return getattr(optional(f"osi3.osi_{kind.lower()}_pb2"), kind)


def _recognised(bodies: Iterable[bytes], path: Path) -> str:
    """Message type of an `.osi` trace, which the file does not state: the type that parses most
    bytes of the first messages."""
    # Protobuf bytes do not name their message type, and others parse them as unknown fields.
    first = [body for _, body in zip(range(_TRIED), bodies, strict=False)]
    total = sum(map(len, first))
    if not total:
        raise InvalidFile("the trace has no message", path=path)
    known = {
        kind: share
        for kind in _KINDS
        if (share := _known(_message(kind), first) / total) >= _READABLE
    }
    if not known:
        raise InvalidFile("its messages are of no OSI message type", path=path)
    best = max(known.values())
    return next(kind for kind, share in known.items() if share == best)


def _known(create: Any, bodies: Iterable[bytes]) -> int:
    """Bytes of messages that a message type knows; 0 where one can't be parsed."""
    count = 0
    for body in bodies:
        message = parsed(create, body)
        if message is None:
            return 0
        message.DiscardUnknownFields()
        count += message.ByteSize()
    return count


# .osi ---------------------------------------------------------------------------------------


def _size(path: Path) -> int:
    current().admit(path)
    try:
        if not path.is_file():
            raise InvalidFile(
                "no such file" if not path.exists() else "this is not a regular file", path=path
            )
        return path.stat().st_size
    except OSError as error:
        raise InvalidFile(f"the file can't be read: {error.strerror}", path=path) from None


def _largest() -> int:
    return min(MAX_BYTES, current().max_bytes or MAX_BYTES)


def _single(path: Path) -> Iterator[bytes]:
    """The messages of an `.osi` file."""
    left = _size(path)
    with path.open("rb") as file:
        number = 0
        while left:
            number += 1
            head = file.read(_LENGTH.size)
            if len(head) < _LENGTH.size:
                raise InvalidFile(
                    f"the file ends within the length of message {number}: it is truncated",
                    path=path,
                )
            (length,), left = _LENGTH.unpack(head), left - _LENGTH.size
            # Compared before anything is read: a damaged length asks for up to 4 GiB.
            if length > left:
                which = f"message {number} declares {length} bytes, of which the file has {left}"
                raise InvalidFile(f"{which}: it is truncated, or no OSI trace", path=path)
            _check_message(length, number, path)
            left -= length
            yield file.read(length)


def _check_message(length: int, number: int, path: Path) -> None:
    most = min(LONGEST, _largest())
    if length > most:
        raise InvalidFile(
            f"message {number} has {length} bytes, at most {most} are read", path=path
        )


# .mcap --------------------------------------------------------------------------------------


class _Bounded:
    """A file that refuses to read beyond its end: a declared size beyond it is an error at once."""

    def __init__(self, file: Any, size: int, path: Path) -> None:
        self._file, self._left, self._path = file, size, path

    def read(self, count: int) -> bytes:
        """A number of bytes."""
        if count > self._left:
            raise InvalidFile("the file ends within a record: it is truncated", path=self._path)
        self._left -= count
        data: bytes = self._file.read(count)
        return data


def _records(path: Path) -> Iterator[Any]:
    """The records of an MCAP file, those of chunks as chunks."""
    reader, errors = optional("mcap.stream_reader"), optional("mcap.exceptions")
    size = _size(path)
    with path.open("rb") as file:
        try:
            yield from reader.StreamReader(
                _Bounded(file, size, path), emit_chunks=True, record_size_limit=_largest()
            ).records
        except errors.InvalidMagic:
            raise InvalidFile(
                "this is no MCAP file: it begins or ends otherwise", path=path
            ) from None
        except errors.RecordLengthLimitExceeded as error:
            raise InvalidFile(f"this is more than is read: {error}", path=path) from None
        except (errors.McapError, struct.error, ValueError) as error:
            raise InvalidFile(
                f"the MCAP file is damaged: {error or type(error).__name__}", path=path
            ) from None


def _unpacked(chunk: Any, path: Path) -> list[Any]:
    """The records of a chunk."""
    reader, errors, records = (
        optional("mcap.stream_reader"),
        optional("mcap.exceptions"),
        optional("mcap.records"),
    )
    if chunk.uncompressed_size > _largest():
        declared = f"a chunk declares {chunk.uncompressed_size} bytes when decompressed"
        raise InvalidFile(f"{declared}, at most {_largest()} are read", path=path)
    data = _decompressed(chunk, path)
    if len(data) != chunk.uncompressed_size:
        raise InvalidFile(
            f"a chunk has {len(data)} bytes, not the {chunk.uncompressed_size} that it declares",
            path=path,
        )
    # Given to mcap as an uncompressed chunk: its own decompression has no limit.
    plain = records.Chunk(
        "",
        data,
        chunk.message_end_time,
        chunk.message_start_time,
        chunk.uncompressed_crc,
        chunk.uncompressed_size,
    )
    try:
        parts: list[Any] = reader.breakup_chunk(plain, validate_crc=True)
    except (errors.McapError, struct.error, ValueError) as error:
        raise InvalidFile(
            f"a chunk is damaged: {error or type(error).__name__}", path=path
        ) from None
    return parts


def _decompressed(chunk: Any, path: Path) -> bytes:
    """The content of a chunk, no more than it declares."""
    most = chunk.uncompressed_size
    if not chunk.compression:
        return bytes(chunk.data)
    try:
        if chunk.compression == "zstd":
            zstd = optional("zstandard")
            # -1 stands for a frame that does not state its size; the bounded read covers it.
            if (
                not 0 <= zstd.frame_content_size(chunk.data) <= most
                and zstd.frame_content_size(chunk.data) != -1
            ):
                raise InvalidFile("a chunk decompresses to more than it declares", path=path)
            # One byte beyond the declared size shows that there are more, at no cost.
            with zstd.ZstdDecompressor().stream_reader(chunk.data) as stream:
                return bytes(stream.read(most + 1))
        if chunk.compression == "lz4":
            return bytes(
                optional("lz4.frame")
                .LZ4FrameDecompressor()
                .decompress(bytes(chunk.data), max_length=most + 1)
            )
    except (RuntimeError, EOFError, optional("zstandard").ZstdError) as error:
        raise InvalidFile(f"a chunk can't be decompressed: {error}", path=path) from None
    raise Unsupported(
        f"chunks compressed by {chunk.compression!r}: OSI traces have zstd or lz4", path=path
    )


def _contents(path: Path) -> Contents:
    names = optional("mcap.records")
    schemas: dict[int, Any] = {}
    channels: dict[int, Any] = {}
    counts: dict[int, int] = {}
    contents, chunks, indexed = Contents(), 0, 0

    def take(record: Any) -> None:
        if isinstance(record, names.Schema):
            schemas.setdefault(record.id, record)
        elif isinstance(record, names.Channel):
            channels.setdefault(record.id, record)
        elif isinstance(record, names.Message):
            counts[record.channel_id] = counts.get(record.channel_id, 0) + 1
            channel = channels.get(record.channel_id)
            if (
                channel is not None
                and channel.schema_id in schemas
                and schemas[channel.schema_id].name == _MAP
            ):
                contents.maps.extend(_map(record.data))

    for record in _records(path):
        if isinstance(record, names.Chunk):
            chunks += 1
            contents.compressions.add(record.compression)
            for inner in _unpacked(record, path):
                take(inner)
        elif isinstance(record, names.Metadata):
            contents.metadata.append((record.name, dict(record.metadata)))
        elif isinstance(record, names.Attachment):
            if b"<OpenDRIVE" in record.data[:_BLOCK] or record.name.lower().endswith(
                (".xodr", ".odr")
            ):
                contents.maps.append(AttachedMap(record.name, bytes(record.data), "attachment"))
        elif isinstance(record, names.ChunkIndex):
            indexed += 1
        else:
            contents.unchunked += isinstance(record, names.Message)
            take(record)
    for key, channel in channels.items():
        schema = schemas.get(channel.schema_id)
        contents.channels[key] = Channel(
            channel.topic, schema.name if schema else "", schema.encoding if schema else "",
            channel.message_encoding,
            dict(channel.metadata), counts.get(key, 0),
        )  # fmt: skip
    contents.indexed = indexed == chunks
    return contents


def _messages(path: Path, channel: int) -> Iterator[tuple[bytes, int]]:
    """The messages of a channel with their publish times (ns), in the order of the file."""
    names = optional("mcap.records")
    number = 0
    for record in _records(path):
        for inner in _unpacked(record, path) if isinstance(record, names.Chunk) else (record,):
            if isinstance(inner, names.Message) and inner.channel_id == channel:
                number += 1
                _check_message(len(inner.data), number, path)
                yield inner.data, inner.publish_time


def _map(body: bytes) -> Iterator[AttachedMap]:
    """The map in a message of omega-prime: field 1 is its reference, field 2 the content of the
    OpenDRIVE file."""
    unknown = optional("google.protobuf.unknown_fields")
    # Parsed as Empty, all fields are unknown ones: no definition of the message is needed.
    empty = parsed(optional("google.protobuf.empty_pb2").Empty, body)
    if empty is None:
        return
    values = {
        field.field_number: field.data
        for field in unknown.UnknownFieldSet(empty)
        # Length-delimited: texts and bytes.
        if field.wire_type == 2
    }
    if 2 in values:
        yield AttachedMap(values.get(1, b"").decode(errors="replace"), values[2], "channel")
